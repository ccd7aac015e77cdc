"""Which silhouettes are one object, in all cameras and over time."""
