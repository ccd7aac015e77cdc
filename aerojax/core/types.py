"""Values that cross a stage border, in the order in which a frame meets them.

FrameSet → Silhouette → Track → Observation (with its View) → Gaussians → Evidence. What JAX computes with (Camera,
View, Gaussians, Crops, Evidence) is a frozen dataclass and a pytree: batches are made by `jax.vmap` or by a leading
axis on every array, and the shapes below are those of one example. The others are host values.
"""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Float64, UInt16

_T = TypeVar("_T")

CLASSES = ("bird", "drone", "airplane", "helicopter")
"""Class names; a label is an index into this tuple (the order of the published data set)."""
UNKNOWN = "unknown"
"""Label of what is none of the classes."""


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
    known: pixels in which the image says whether the object is there; beyond the border of an image that cuts the
        object it does not, and `rgb` and `mask` mean nothing. None where every pixel is known.
    """

    rgb: Float[Array, "*batch height width 3"]
    mask: Float[Array, "*batch height width"]
    camera: Camera
    known: Bool[Array, "*batch height width"] | None = None


Box = tuple[float, float, float, float]
"""x0, y0, x1, y1 in pixels with exclusive ends."""


@dataclasses.dataclass(frozen=True)
class MissingView:
    """A camera that should have recorded something at an instant, and why there is nothing of it.

    camera: index in the network. text: names the file and what is wrong with it.
    """

    camera: int
    text: str


@dataclasses.dataclass(frozen=True, eq=False)
class FrameSet:
    """What all cameras of a network recorded at one instant; one entry a camera, None where it recorded nothing.

    frame: number on the network's common clock. time_s: seconds since frame 0.
    rgb: undistorted sRGB images, 0..1.
    ids: instance masks that came with the images, 0 = background; None without masks.
    coverage: of masks that are pictures of one object, its share of each pixel, 0..1; None, or empty, without.
    missing: cameras of which a file or a picture is missing or damaged; they count as having recorded nothing.
    """

    frame: int
    time_s: float
    rgb: tuple[Float32[np.ndarray, "height width 3"] | None, ...]
    ids: tuple[UInt16[np.ndarray, "height width"] | None, ...]
    coverage: tuple[Float32[np.ndarray, "height width"] | None, ...] = ()
    missing: tuple[MissingView, ...] = ()


@dataclasses.dataclass(frozen=True, eq=False)
class Silhouette:
    """One object in one camera's image.

    camera: index in the network.
    object_id: which object the segmenter says that it is; equal ids in two cameras need not be one object.
    coverage: share of each pixel that the object covers, 0..1.
    box: of the pixels that it covers by more than half.
    whole: whether the box keeps clear of the image's border, so that the outline is the object's own.
    """

    camera: int
    object_id: int
    coverage: Float32[np.ndarray, "height width"]
    box: Box
    whole: bool


@dataclasses.dataclass(frozen=True, eq=False)
class Track:
    """One object in one frame: its silhouettes in all cameras, and where it is.

    number: of the object, the same in every frame.
    silhouettes: one entry a camera; None where the camera does not show it.
    position, velocity: metres and metres a second, in the frame of the cameras that the tracker was given; None where
        fewer than two cameras show the object whole, or before a second frame.
    covariance: of the position, square metres, from the pixel noise that the tracker assumes.
    """

    number: int
    silhouettes: tuple[Silhouette | None, ...]
    position: Float64[np.ndarray, "3"] | None
    velocity: Float64[np.ndarray, "3"] | None
    covariance: Float64[np.ndarray, "3 3"] | None


@dataclasses.dataclass(frozen=True, eq=False)
class Observation:
    """One object's crops in one frame, as the reconstructor gets them, and how they were cut.

    frame: number.
    views: crops of all cameras; their cameras stand in the crop's frame, which has the rig's axes and the object at
        its origin. Those of cameras that do not count are black.
    valid: cameras that count.
    cut: those of them whose image's border cuts the object.
    boxes: of the object in the images; None where a camera does not show it.
    crop_from_image: homographies from pixels of the images to pixels of the crops (centres at +0.5).
    rig_from_crop, world_from_rig: rigid transforms; the rig's frame is that of its first camera.
    """

    frame: int
    views: View
    valid: Bool[np.ndarray, "view"]
    cut: Bool[np.ndarray, "view"]
    boxes: tuple[Box | None, ...]
    crop_from_image: Float64[np.ndarray, "view 3 3"]
    rig_from_crop: Float64[np.ndarray, "4 4"]
    world_from_rig: Float64[np.ndarray, "4 4"]

    @property
    def whole(self) -> Bool[np.ndarray, "view"]:
        """Cameras that show the whole object."""
        return self.valid & ~self.cut

    @property
    def world_from_crop(self) -> Float64[np.ndarray, "4 4"]:
        """Rigid transform of what was reconstructed to the world, metres."""
        return self.world_from_rig @ self.rig_from_crop

    @property
    def windows(self) -> Float64[np.ndarray, "view 4 2"]:
        """Corners of the crops in the images, pixels, clockwise from the top left."""
        size = float(self.views.camera.width)
        corners = np.array([[0, 0, 1], [size, 0, 1], [size, size, 1], [0, size, 1]])
        inside = corners @ np.linalg.inv(self.crop_from_image).transpose(0, 2, 1)
        return inside[..., :2] / inside[..., 2:]


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


@pytree_dataclass
class Crops:
    """Small images of the object from every camera: what a classifier of views reads.

    rgba: sRGB times coverage, and coverage, 0..1; whatever it holds where the camera does not count.
    valid: cameras that count.
    """

    rgba: Float[Array, "*batch view size size 4"]
    valid: Bool[Array, "*batch view"]


@pytree_dataclass
class Evidence:
    """What a classifier is given of one object in one frame.

    gaussians: its reconstruction, metres.
    crops: its images; None where there are none, as in clips of Gaussians alone.
    """

    gaussians: Gaussians
    crops: Crops | None = None


SH_C0 = 0.28209479177387814
"""Value of the degree-0 real spherical harmonic, 1/(2*sqrt(pi))."""
