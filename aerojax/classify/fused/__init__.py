"""Fused: MambaSplat on Gaussians and the views network on crops, joined where each has read the clip."""
