"""Helicopters with one or two main rotors."""
