"""What is trained: batches, losses and validation of each task."""
