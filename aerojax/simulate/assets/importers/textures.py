"""Pictures of an imported model: decoded, multiplied by their material's colour and written as PNG beside the stage."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.scene import ImportedScene, Material, Surface
from aerojax.simulate.assets.paint.atlas import linear_from_srgb

Picture = UInt8[np.ndarray, "height width _"]
_WITHIN = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Barycentric points over which a face's mean colour is taken: the middle and halfway to each corner."""


def decode_picture(data: bytes, source: str) -> Picture:
    """Decode PNG or JPEG to 8-bit RGB or RGBA, top row first.

    Raises:
        UserError: if the bytes are no such picture.
    """
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if picture is None:
        raise UserError(
            "unreadable", f"{source}: a texture is not a readable PNG or JPEG picture", "save it as one of them"
        )
    if picture.dtype != np.uint8:
        picture = (picture.astype(np.float64) / np.iinfo(picture.dtype).max * 255).round().astype(np.uint8)
    if picture.ndim == 2:
        picture = np.repeat(picture[:, :, None], 3, axis=2)
    return np.ascontiguousarray(picture[:, :, [2, 1, 0, 3][: picture.shape[2]]])


def tinted(picture: Picture, colour: tuple[float, float, float], *, keep_alpha: bool) -> Picture:
    """The picture times a linear colour, encoded as sRGB; without alpha unless it is kept.

    Multiplied here because UsdUVTexture's `scale`, which says the same, is left out by many readers.
    """
    alpha = picture[:, :, 3:] if keep_alpha else picture[:, :, :0]
    if colour == (1.0, 1.0, 1.0):
        return np.concatenate([picture[:, :, :3], alpha], axis=2)
    linear = linear_from_srgb(np.arange(256) / 255.0)[picture[:, :, :3]] * np.asarray(colour)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear.clip(1e-9) ** (1 / 2.4) - 0.055)
    return np.concatenate([np.rint(encoded.clip(0, 1) * 255).astype(np.uint8), alpha], axis=2)


def write_picture(path: Path, picture: Picture) -> None:
    """Write a PNG in one step; the same picture gives the same bytes."""
    order = [2, 1, 0, 3][: picture.shape[2]]
    done, encoded = cv2.imencode(".png", np.ascontiguousarray(picture[:, :, order]))
    if not done:
        raise UserError("invalid", f"{path}: the texture could not be encoded", "check that OpenCV was built with PNG")
    partial = path.with_name(f".{path.stem}.{os.getpid()}.png")
    partial.write_bytes(encoded.tobytes())
    partial.replace(path)


def bake(scene: ImportedScene, path: Path, source: str) -> dict[Material, tuple[str, Picture]]:
    """Write the pictures that materials need beside the stage `path`: file name and picture of each textured one.

    One picture takes the stage's stem; several are numbered after a dot, which no model's name holds.
    """
    needed: dict[tuple[bytes, tuple[float, float, float], bool], list[Material]] = {}
    for material in dict.fromkeys(s.material for node in scene.nodes for s in node.surfaces if s.st is not None):
        if material.texture is not None:
            key = (scene.textures[material.texture], material.colour, uses_alpha(material))
            needed.setdefault(key, []).append(material)
    found = {}
    for number, ((data, colour, alpha), materials) in enumerate(needed.items()):
        name = f"{path.stem}.png" if len(needed) == 1 else f"{path.stem}.{number}.png"
        picture = tinted(decode_picture(data, source), colour, keep_alpha=alpha)
        write_picture(path.with_name(name), picture)
        found |= dict.fromkeys(materials, (name, picture))
    return found


def uses_alpha(material: Material) -> bool:
    """Whether the texture's alpha means anything."""
    return material.blend or material.cutoff is not None


def mean_colours(surface: Surface, picture: Picture) -> Float[np.ndarray, "face 3"]:
    """Each face's colour in linear light, over a few points of it; pictures repeat."""
    assert surface.st is not None
    st = np.einsum("pc,fci->fpi", _WITHIN, surface.st[surface.faces].astype(np.float64))
    height, width = picture.shape[:2]
    column = np.floor(st[..., 0] * width).astype(np.int64) % width
    row = np.floor((1.0 - st[..., 1]) * height).astype(np.int64) % height
    return linear_from_srgb(picture[row, column, :3] / 255.0).mean(axis=1)
