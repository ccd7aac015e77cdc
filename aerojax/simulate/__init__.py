"""Stage 0: the simulator. USD scenes in, captures with exact truth out."""
