"""What `train_detector` asks detectors, and what it makes of their answers."""
