"""2D baselines: plain convolutional networks that read crops or whole images, and majority votes over their answers."""
