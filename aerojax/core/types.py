"""Values that cross a stage border: cameras, views and Gaussians.

Every type is a frozen dataclass and a JAX pytree. Batches are made by `jax.vmap` or by a leading axis on every array;
the shapes below are those of one example.
"""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

_T = TypeVar("_T")

CLASSES = ("bird", "drone", "airplane", "helicopter")
"""Class names; a label is an index into this tuple (the order of the published data set)."""


@dataclass_transform(frozen_default=True)
def pytree_dataclass(cls: type[_T]) -> type[_T]:
    """Make `cls` a frozen dataclass that is a pytree; fields with `metadata={"static": True}` are structure.

    Unflattening skips `__init__`, because JAX builds trees of placeholders that no shape annotation would accept.
    """
    cls = dataclasses.dataclass(frozen=True)(cls)
    fields = dataclasses.fields(cls)  # pyrefly: ignore
    data = [f.name for f in fields if not f.metadata.get("static")]
    meta = [f.name for f in fields if f.metadata.get("static")]

    def flatten_with_keys(x: Any) -> tuple[list[tuple[Any, Any]], tuple[Any, ...]]:
        return [(jax.tree_util.GetAttrKey(n), getattr(x, n)) for n in data], tuple(getattr(x, n) for n in meta)

    def flatten(x: Any) -> tuple[list[Any], tuple[Any, ...]]:
        return [getattr(x, n) for n in data], tuple(getattr(x, n) for n in meta)

    def unflatten(structure: tuple[Any, ...], children: Any) -> Any:
        x = object.__new__(cls)
        for name, value in zip(data + meta, (*children, *structure), strict=True):
            object.__setattr__(x, name, value)
        return x

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)
    return cls


def static_field(**kwargs: Any) -> Any:
    """A dataclass field that is part of the pytree's structure, not of its data."""
    return dataclasses.field(metadata={"static": True}, **kwargs)


@pytree_dataclass
class Camera:
    """A pinhole camera with OpenCV axes (+x right, +y down, +z forward).

    K: intrinsics in pixels; the centre of the top-left pixel is (0.5, 0.5).
    world_from_cam: rigid transform, metres.
    width, height: image size in pixels (static).
    """

    K: Float[Array, "*batch 3 3"]
    world_from_cam: Float[Array, "*batch 4 4"]
    width: int = static_field()
    height: int = static_field()


@pytree_dataclass
class View:
    """One image of the object and the camera that took it.

    rgb: sRGB, 0..1.
    mask: the object's coverage, 0..1.
    camera: its pinhole camera.
    """

    rgb: Float[Array, "*batch height width 3"]
    mask: Float[Array, "*batch height width"]
    camera: Camera


@pytree_dataclass
class Gaussians:
    """3D Gaussians in one frame of reference (the world frame wherever they leave a stage).

    mean: centres, metres.
    quaternion: w, x, y, z of the rotation whose columns are the principal axes; `q` and `-q` are the same.
    scale: standard deviation along the axes, metres, linear.
    opacity: 0..1.
    sh: real spherical-harmonic colour coefficients, degree 0..3 (1, 4, 9 or 16 of them); row 0 is (rgb-0.5)/0.28209479.
    """

    mean: Float[Array, "*batch gaussian 3"]
    quaternion: Float[Array, "*batch gaussian 4"]
    scale: Float[Array, "*batch gaussian 3"]
    opacity: Float[Array, "*batch gaussian"]
    sh: Float[Array, "*batch gaussian coefficient 3"]

    def columns(self) -> Float[Array, "*batch gaussian 14"]:
        """The 14 attribute columns: mean 0:3, quaternion 3:7, scale 7:10, opacity 10, DC coefficient 11:14."""
        parts = (self.mean, self.quaternion, self.scale, self.opacity[..., None], self.sh[..., 0, :])
        return jnp.concatenate(parts, axis=-1)

    @staticmethod
    def from_columns(columns: Float[Array, "*batch gaussian 14"]) -> Gaussians:
        """Inverse of `columns` for Gaussians with degree-0 colour."""
        return Gaussians(
            mean=columns[..., 0:3],
            quaternion=columns[..., 3:7],
            scale=columns[..., 7:10],
            opacity=columns[..., 10],
            sh=columns[..., None, 11:14],
        )


SH_C0 = 0.28209479177387814
"""Value of the degree-0 real spherical harmonic, 1/(2*sqrt(pi))."""
