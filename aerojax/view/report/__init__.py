"""The page of one classified capture."""
