"""Clips straight from simulated flights: rays where the object is, crops, Gaussians; no picture of a whole image."""
