"""Multicopters with three to eight arms."""
