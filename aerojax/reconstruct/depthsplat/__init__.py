"""DepthSplat-OC: depth from a plane sweep and a monocular branch, one Gaussian a pixel (thesis §5.5.1)."""
