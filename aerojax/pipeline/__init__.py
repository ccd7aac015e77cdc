"""Stage 4: the only place where the stages meet."""
