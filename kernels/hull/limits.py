"""Numbers that both twins of the hull share."""

REACH = 16
"""Pixels at which distances to a silhouette are cut off."""
ENOUGH = -6.0
"""Cells: what one view puts this far outside needs no other view. No surface cell's stencil or moments reach there."""
LEAST_VIEWS = 2
"""Views that must see a cell: of one alone the hull is a cone without an end."""
