"""Hydra configuration: one file an experiment, and groups."""
