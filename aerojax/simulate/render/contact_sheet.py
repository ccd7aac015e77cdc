"""Contact sheets: every identity in a few views, with its name and split."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes
from aerojax.simulate.assets.catalogue import Identity, build_identity
from aerojax.simulate.render.asset_image import AssetRenderer, srgb_bytes
from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from kernels.rays.raytrace import Lighting

CAPTION = 18
"""Rows below each identity for its name."""

_LIGHT = Lighting(sun=0.6, sky=0.5)


@dataclass(frozen=True)
class SheetConfig:
    """How a sheet looks.

    views: azimuth and elevation of the camera (degrees) and the share of the animation, one for each picture.
    columns: identities side by side. width, height: pixels of one picture. samples: rays along each side of a pixel.
    backdrop: linear grey. largest_bytes: of a sheet's file; its JPEG quality is lowered until it fits.
    """

    views: tuple[tuple[float, float, float], ...] = ((35.0, 25.0, 0.1), (-50.0, -15.0, 0.37))
    columns: int = 6
    width: int = 170
    height: int = 130
    samples: int = 3
    backdrop: float = 0.55
    largest_bytes: int = 390_000


def sheet_cell(identity: Identity, assets: Path, sheet: SheetConfig) -> UInt8[np.ndarray, "row column 3"]:
    """An identity's pictures side by side above its caption, sRGB."""
    mesh = load_animated_mesh(build_identity(identity, assets))
    renderer, pictures = AssetRenderer(mesh), []
    for azimuth, elevation, share in sheet.views:
        size = {"width": sheet.width, "height": sheet.height, "samples": sheet.samples}
        seconds = share * mesh.cycle_seconds
        picture = renderer.image(seconds, azimuth, elevation, lighting=_LIGHT, **size)
        pictures.append(srgb_bytes(picture.over(sheet.backdrop)))
    drawn = np.concatenate(pictures, axis=1)
    caption = np.full((CAPTION, drawn.shape[1], 3), 255, np.uint8)
    text = f"{identity.name.removeprefix(identity.label + '_')} - {identity.split}"
    scale = min(0.4, 0.4 * drawn.shape[1] / (8.0 * len(text)))
    cv2.putText(caption, text, (3, 13), cv2.FONT_HERSHEY_SIMPLEX, scale, (20, 20, 20), 1, cv2.LINE_AA)
    return np.pad(np.concatenate([drawn, caption]), ((0, 4), (0, 4), (0, 0)), constant_values=255)


def arrange_cells(cells: list[UInt8[np.ndarray, "row column 3"]], columns: int) -> UInt8[np.ndarray, "_ _ 3"]:
    """Cells of one size in rows of `columns`, the last row filled with white."""
    blank = np.full_like(cells[0], 255)
    cells = cells + [blank] * (-len(cells) % columns)
    rows = [np.concatenate(cells[i : i + columns], axis=1) for i in range(0, len(cells), columns)]
    return np.concatenate(rows)


def write_jpeg(path: Path, image: UInt8[np.ndarray, "row column 3"], largest_bytes: int) -> int:
    """Write the best JPEG that is not larger; its size in bytes.

    Raises:
        UserError: if even quality 30 is larger.
    """
    for quality in range(92, 29, -4):
        data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(data) <= largest_bytes:
            write_bytes(path, data)
            return len(data)
    raise UserError(
        "out-of-range",
        f"{path} takes more than sheet.largest_bytes={largest_bytes}",
        "make sheet.width and height smaller",
    )
