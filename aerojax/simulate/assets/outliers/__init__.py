"""Outliers: flying things of none of the classes, by which it is measured whether they are called unknown."""
