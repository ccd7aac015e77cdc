"""How acts start, show progress and leave records."""
