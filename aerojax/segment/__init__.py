"""Stage 1: where the object is in every image."""
