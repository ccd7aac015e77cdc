"""Colours of assets: albedo patterns, texture atlases, materials."""
