"""A classified clip in the formats that other tools read."""
