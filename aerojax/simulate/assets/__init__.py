"""Procedural USD assets, one file a class, and the catalogue of identities."""
