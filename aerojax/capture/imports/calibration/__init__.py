"""Calibrations of camera networks as other tools write them: one door, a member a format."""
