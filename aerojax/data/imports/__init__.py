"""Data sets of others as ours."""
