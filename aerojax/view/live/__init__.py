"""The page of a running service."""
