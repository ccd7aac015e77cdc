"""Quality of generated data sets: composition, consistency, coverage, motion, leakage."""
