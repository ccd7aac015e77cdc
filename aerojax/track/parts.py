"""Separate parts of a silhouette: what lies near the rest is the object's own, what is far away may be something else.

Masks bring stray pixels and other objects; thin rods and rotors bring gaps. Pixels are one part if the gaps between
them are at most a quarter of the largest connected piece.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Int32

from aerojax.core.types import Box, Silhouette
from aerojax.geometry.boxes import tight_box, touches_border

GAP = 0.25
"""Widest gap within one part, as a share of the longer side of the largest connected piece."""
NARROWEST_GAP = 8
"""Pixels that a gap may always have: rods of distant objects are thinner than a pixel and break up."""
MOST_PARTS = 8
"""Largest parts that are looked at; a mask of noise has thousands."""


@dataclass(frozen=True, eq=False)
class Part:
    """Pixels of one silhouette that belong together.

    box, area: of those that are covered by more than half, pixels. labels: which part each pixel of the image's window
    at `corner` (column, row) belongs to; number: of this one.
    """

    of: Silhouette
    box: Box
    area: int
    number: int
    corner: tuple[int, int]
    labels: Int32[np.ndarray, "rows columns"]

    def silhouette(self) -> Silhouette:
        """The silhouette without all other parts."""
        (x, y), (rows, columns) = self.corner, self.labels.shape
        window = np.s_[y : y + rows, x : x + columns]
        coverage = np.zeros_like(self.of.coverage)
        coverage[window] = np.where(self.labels == self.number, self.of.coverage[window], np.float32(0))
        height, width = coverage.shape
        return replace(self.of, coverage=coverage, box=self.box, whole=not touches_border(self.box, width, height))


def parts_of(one: Silhouette) -> list[Part]:
    """The parts of a silhouette, largest first; at most `MOST_PARTS`."""
    corner, window = _window(one)
    covered = one.coverage[window] > 0.5
    reach = max(NARROWEST_GAP, round(GAP * _longest_piece(covered)))
    # Squares of side reach + 1 around two pixels touch where the gap between these is at most reach.
    square = np.ones((reach // 2 * 2 + 1, reach // 2 * 2 + 1), np.uint8)
    count, labels = cv2.connectedComponents(cv2.dilate(covered.astype(np.uint8), square), connectivity=8)
    areas = np.bincount(labels[covered], minlength=count)
    largest = [int(n) for n in np.argsort(-areas, kind="stable")[:MOST_PARTS] if areas[n]]
    return [Part(one, _box(covered & (labels == n), corner), int(areas[n]), n, corner, labels) for n in largest]


def _window(one: Silhouette) -> tuple[tuple[int, int], tuple[slice, slice]]:
    """The silhouette's box with a rim for pixels that are covered by less than half."""
    height, width = one.coverage.shape
    x0, y0 = (max(int(side) - NARROWEST_GAP, 0) for side in one.box[:2])
    x1, y1 = min(int(one.box[2]) + NARROWEST_GAP, width), min(int(one.box[3]) + NARROWEST_GAP, height)
    return (x0, y0), (slice(y0, y1), slice(x0, x1))


def _longest_piece(covered: Bool[np.ndarray, "rows columns"]) -> int:
    _, _, stats, _ = cv2.connectedComponentsWithStats(covered.astype(np.uint8), connectivity=8)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return int(max(stats[largest, cv2.CC_STAT_WIDTH], stats[largest, cv2.CC_STAT_HEIGHT]))


def _box(covered: Bool[np.ndarray, "rows columns"], corner: tuple[int, int]) -> Box:
    box = tight_box(covered)
    assert box is not None  # parts have pixels
    x, y = corner
    return box[0] + x, box[1] + y, box[2] + x, box[3] + y
