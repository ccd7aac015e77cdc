"""Captures on disk: the one input of the pipeline."""
