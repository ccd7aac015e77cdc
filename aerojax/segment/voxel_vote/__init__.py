"""Masks without annotation: what moves in the images and meets in space (thesis, Appendix C)."""
