"""The page of a data set's description."""
