"""Stage 2: from views of the object to 3D Gaussians."""
