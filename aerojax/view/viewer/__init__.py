"""The 4D viewer: Gaussians over time, cameras, track and ground in one page, drawn by WebGL2 without a library."""
