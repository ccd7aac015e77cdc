"""Texture images of an imported model: decoded, multiplied by the material's colour, written beside the stage."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.scene import ImportedScene, Material, Surface
from aerojax.simulate.assets.paint.texture_file import write_texture
from aerojax.simulate.usd.pictures import decode_picture

Image = UInt8[np.ndarray, "height width _"]
_WITHIN = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Barycentric points over which a face's mean colour is taken: the middle and halfway to each corner."""


def decode_image(data: bytes, source: str) -> Image:
    """Decode PNG or JPEG to 8-bit RGB or RGBA, top row first.

    Raises:
        UserError: if the bytes are no such image.
    """
    image = decode_picture(data, f"{source}: a texture", cv2.IMREAD_UNCHANGED)
    if not np.issubdtype(image.dtype, np.integer):
        raise UserError("invalid", f"{source}: a texture holds floating-point values", "save it as PNG or JPEG")
    if image.dtype != np.uint8:
        image = (image.astype(np.float64) / np.iinfo(image.dtype).max * 255).round().astype(np.uint8)
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    return np.ascontiguousarray(image[:, :, [2, 1, 0, 3][: image.shape[2]]])


def multiplied(image: Image, colour: tuple[float, float, float], *, keep_alpha: bool) -> Image:
    """The image times a linear colour, encoded as sRGB; without alpha unless it is kept.

    Multiplied here because UsdUVTexture's `scale`, which says the same, is left out by many readers.
    """
    alpha = image[:, :, 3:] if keep_alpha else image[:, :, :0]
    if colour == (1.0, 1.0, 1.0):
        return np.concatenate([image[:, :, :3], alpha], axis=2)
    linear = linear_from_srgb(np.arange(256) / 255.0)[image[:, :, :3]] * np.asarray(colour)
    encoded = np.rint(srgb_from_linear(linear).clip(0, 1) * 255).astype(np.uint8)
    return np.concatenate([encoded, alpha], axis=2)


def write_textures(scene: ImportedScene, path: Path, source: str) -> dict[Material, tuple[str, Image]]:
    """Write the textures that materials need beside the stage `path`: file name and image of each textured one.

    One texture takes the stage's stem; several are numbered after a dot, which no model's name holds.
    """
    needed: dict[tuple[bytes, tuple[float, float, float], bool], list[Material]] = {}
    for material in dict.fromkeys(s.material for node in scene.nodes for s in node.surfaces if s.st is not None):
        if material.texture is not None:
            key = (scene.textures[material.texture], material.colour, uses_alpha(material))
            needed.setdefault(key, []).append(material)
    found = {}
    for number, ((data, colour, alpha), materials) in enumerate(needed.items()):
        name = f"{path.stem}.png" if len(needed) == 1 else f"{path.stem}.{number}.png"
        image = multiplied(decode_image(data, source), colour, keep_alpha=alpha)
        write_texture(path.with_name(name), image)
        found |= dict.fromkeys(materials, (name, image))
    return found


def uses_alpha(material: Material) -> bool:
    """Whether the texture's alpha means anything."""
    return material.blend or material.cutoff is not None


def mean_colours(surface: Surface, image: Image) -> Float[np.ndarray, "face 3"]:
    """Each face's colour in linear light, over a few points of it; textures repeat."""
    assert surface.st is not None
    st = np.einsum("pc,fci->fpi", _WITHIN, surface.st[surface.faces].astype(np.float64))
    height, width = image.shape[:2]
    column = np.floor(st[..., 0] * width).astype(np.int64) % width
    row = np.floor((1.0 - st[..., 1]) * height).astype(np.int64) % height
    return linear_from_srgb(image[row, column, :3] / 255.0).mean(axis=1)
