"""3D Gaussians: rendering, files, decimation and transforms."""
