"""Sampling of point sets."""
