"""Calibration of a camera network from pictures of a board."""
