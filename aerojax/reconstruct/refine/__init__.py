"""Learned reconstruction: Gaussians of the visual hull, corrected by what their renderings show wrong."""
