"""LGM, the thesis' baseline: a U-Net over all views whose output pixels are Gaussians."""
