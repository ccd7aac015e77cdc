"""Clocks and poses of cameras from what flies before them."""
