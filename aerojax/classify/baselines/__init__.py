"""Published networks for point clouds, made anew: what the classifier of Gaussians is compared with."""
