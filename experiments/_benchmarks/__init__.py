"""Sections of the benchmark: each module has `measure() -> dict`, ready for JSON."""
