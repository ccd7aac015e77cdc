"""The splatter: tile lists and blending in Warp, projection in JAX, and the plain-JAX twin."""
