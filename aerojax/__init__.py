"""aerojax: flying objects from calibrated camera networks as 4D Gaussians, classified rotation-invariantly."""
