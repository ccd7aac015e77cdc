"""Solids of no class: shapes that a reconstructor learns from besides those that fly."""
