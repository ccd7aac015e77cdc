"""Gaussians of one object by optimisation on its own views."""
