"""Training: loop, optimisers, checkpoints and data; nothing model-specific."""
