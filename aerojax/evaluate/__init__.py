"""Measures of images, labels, shapes and invariance."""
