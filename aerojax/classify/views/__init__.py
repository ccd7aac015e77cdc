"""Views: silhouettes of the crops in polar coordinates, pooled over cameras, Mamba over time."""
