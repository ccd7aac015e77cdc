"""Gaussians on disk: PLY, compressed PLY, USD."""
