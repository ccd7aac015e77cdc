"""Pure functions of three-dimensional geometry."""
