"""A picture of a camera network: where the cameras stand and look, from above and from the side, as one SVG file."""

from __future__ import annotations

import html
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import CaptureCamera
from aerojax.geometry.cameras import pixel_rays
from aerojax.view.svg import nice_ticks

_WIDTH, _PANE, _GAP, _MARGIN = 720, 420, 40, 56
_STYLE = """
text { font: 12px system-ui, sans-serif; fill: #333 }
.title { font-weight: 600; font-size: 14px }
.grid { stroke: #ddd; stroke-width: 1 }
.ground { stroke: #7a6a4f; stroke-width: 2 }
.view { fill: #2c6fbb22; stroke: #2c6fbb; stroke-width: 1 }
.camera { fill: #2c6fbb } .track { fill: none; stroke: #c2410c; stroke-width: 2 } .spot { fill: #c2410c }
@media (prefers-color-scheme: dark) {
  text { fill: #ddd } .grid { stroke: #444 } .paper { fill: #181818 }
  .view { fill: #7db3f033; stroke: #7db3f0 } .camera { fill: #7db3f0 }
  .track { stroke: #fb923c } .spot { fill: #fb923c } .ground { stroke: #b9a67e }
}
"""
_NAME = 52, 13
"""Width and height that the name of a camera takes."""
_REACH = 0.35
"""Length of the drawn pyramids, as a share of the network's size, where no object says how far to look."""


def rig_picture(
    cameras: Sequence[CaptureCamera], positions: Float64[np.ndarray, "frame 3"] | None = None, title: str = ""
) -> str:
    """The network from above (x right, y up) and from the side (along -y or +x, whichever shows more), metres.

    Args:
        cameras: of a capture.
        positions: where an object was, world; drawn as dots with a line.
        title: text at the top.

    Returns:
        A whole SVG document with its own style, for light and dark pages.
    """
    places = np.zeros((0, 3)) if positions is None else positions[np.isfinite(positions).all(axis=1)]
    centres = np.stack([camera.world_from_cam[:3, 3] for camera in cameras])
    pyramids = [_pyramid(camera, _reach(camera, centres, places)) for camera in cameras]
    spread = np.ptp(np.concatenate([centres, places]), axis=0)
    across = 0 if spread[0] >= spread[1] else 1
    body = ""
    for index, (name, axes) in enumerate((("from above", (0, 1)), ("from the side", (across, 2)))):
        top = 30 + index * (_PANE + _GAP)
        body += _pane(f"{name}: {'xyz'[axes[0]]} and {'xyz'[axes[1]]}, metres", axes, top, cameras, pyramids, places)
    height = 30 + 2 * _PANE + 2 * _GAP
    label = html.escape(title or "camera network")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" role="img" aria-label="{label}">'
        f'<style>{_STYLE}</style><rect class="paper" width="100%" height="100%" fill="#fff"/>'
        f'<text class="title" x="{_MARGIN}" y="20">{label}</text>{body}</svg>\n'
    )


def _reach(camera: CaptureCamera, centres: np.ndarray, places: np.ndarray) -> float:
    """How far the camera's pyramid is drawn: to half way to the object."""
    if len(places):
        return 0.5 * float(np.linalg.norm(np.median(places, axis=0) - camera.world_from_cam[:3, 3]))
    return max(_REACH * float(np.linalg.norm(np.ptp(centres, axis=0))), 0.1)


def _pyramid(camera: CaptureCamera, reach: float) -> Float64[np.ndarray, "corner 3"]:
    """The camera's centre and the four corners of its view at a distance, metres, world."""
    w, h = float(camera.width), float(camera.height)
    rays = pixel_rays(np.array([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]]), camera)
    centre = camera.world_from_cam[:3, 3]
    return np.concatenate([centre[None], centre + reach * rays])


def _pane(
    name: str,
    axes: tuple[int, int],
    top: int,
    cameras: Sequence[CaptureCamera],
    pyramids: Sequence[np.ndarray],
    places: np.ndarray,
) -> str:
    points = np.concatenate([*pyramids, places, np.zeros((1, 3))])[:, list(axes)]
    low, high = points.min(axis=0), points.max(axis=0)
    scale = min((_WIDTH - 2 * _MARGIN) / max(high[0] - low[0], 1e-3), (_PANE - 60) / max(high[1] - low[1], 1e-3))
    middle = (low + high) / 2

    def place(point: np.ndarray) -> tuple[float, float]:
        x, y = (point[list(axes)] - middle) * scale
        return _WIDTH / 2 + float(x), top + _PANE / 2 - float(y)

    parts = [f'<text x="{_MARGIN}" y="{top + 14}">{name}</text>']
    parts.append(_grid(middle, scale, top, axes[1] == 2))
    named: list[tuple[float, float]] = []
    for camera, pyramid in zip(cameras, pyramids, strict=True):
        apex, *corners = (place(corner) for corner in pyramid)
        for one, other in zip(corners, [*corners[1:], corners[0]], strict=True):
            shape = " ".join(f"{x:.1f},{y:.1f}" for x, y in (apex, one, other))
            parts.append(f'<polygon class="view" points="{shape}"/>')
        parts.append(f'<circle class="camera" cx="{apex[0]:.1f}" cy="{apex[1]:.1f}" r="4"/>')
        x, y = _free(apex[0] + 6, apex[1] - 6, named)
        parts.append(f'<text x="{x:.1f}" y="{y:.1f}">{html.escape(camera.name)}</text>')
    path = [place(position) for position in places]
    if len(path) > 1:
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in path)
        parts.append(f'<polyline class="track" points="{line}"/>')
    parts += [f'<circle class="spot" cx="{x:.1f}" cy="{y:.1f}" r="3"/>' for x, y in path]
    return "".join(parts)


def _free(x: float, y: float, taken: list[tuple[float, float]]) -> tuple[float, float]:
    """The first place for a name upwards of a point that is clear of the others; it is taken then."""
    while any(abs(x - u) < _NAME[0] and abs(y - v) < _NAME[1] for u, v in taken):
        y -= _NAME[1]
    taken.append((x, y))
    return x, y


def _grid(middle: np.ndarray, scale: float, top: int, side: bool) -> str:
    """Lines at round numbers of metres; the ground, z = 0, is drawn stronger."""
    half_width, half_height = (_WIDTH - 2 * _MARGIN) / 2 / scale, (_PANE - 60) / 2 / scale
    parts = []
    for tick in nice_ticks(middle[0] - half_width, middle[0] + half_width, 6):
        x = _WIDTH / 2 + (tick - middle[0]) * scale
        parts.append(f'<line class="grid" x1="{x:.1f}" y1="{top + 26}" x2="{x:.1f}" y2="{top + _PANE - 20}"/>')
        parts.append(f'<text x="{x:.1f}" y="{top + _PANE - 4}" text-anchor="middle">{tick:g}</text>')
    for tick in nice_ticks(middle[1] - half_height, middle[1] + half_height, 5):
        y = top + _PANE / 2 - (tick - middle[1]) * scale
        kind = "ground" if side and tick == 0 else "grid"
        parts.append(f'<line class="{kind}" x1="{_MARGIN}" y1="{y:.1f}" x2="{_WIDTH - _MARGIN}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{_MARGIN - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    return "".join(parts)
