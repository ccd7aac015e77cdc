"""Recordings of other simulators as captures."""
