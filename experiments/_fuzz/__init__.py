"""What `python -m experiments.fuzz` reads: inputs that are right, and a reader for each format."""
