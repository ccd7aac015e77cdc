"""Fixed-wing aircraft."""
