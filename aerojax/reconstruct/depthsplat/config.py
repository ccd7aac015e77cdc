"""Sizes and geometry of DepthSplat-OC: frozen dataclasses, refused where their fields contradict each other."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, ClassVar, Literal

from jaxtyping import Array, Key

from aerojax.core.errors import UserError
from aerojax.reconstruct.base import TrainableConfig

if TYPE_CHECKING:
    from aerojax.reconstruct.depthsplat.reconstructor import DepthSplat

CELL = 4
"""Pixels along each side of a cell of the cost volume and of the features that it compares."""
PATCH = 14
"""Pixels along each side of a patch of the monocular branch (DINOv2 ViT-S/14)."""
TAPS = 4
"""Blocks of the monocular branch whose output the upsamplers read."""


@dataclasses.dataclass(frozen=True)
class DepthSplatSizes(TrainableConfig):
    """What the two members have in common; the defaults are the thesis' encoder of 38.12 M parameters.

    size: side of the images that the network sees, pixels; crops of another size are resampled. A multiple of 16.
    candidates: of the plane sweep, uniform in inverse depth.
    near, far: depths between which candidates lie, metres before a camera 1.5 m from the object (thesis §5.5.1).
    bins: "window" scales that range to the width that the widest crop window has at the object, so that it fits
        whatever the focal length is; "global" scales it to the cameras' mean distance, as the thesis does.
    compat: True takes upstream's shortcuts, for comparison with its numbers: the reference camera's K for every camera,
        cells at whole pixels, `align_corners` resizing, samples outside an image counted as zero, and the shift mask of
        the cross-attention on the wrong keys. False is correct in all of these.
    stem_width, half_width, width: channels of the convolutions' features at 1/2, 1/2 and 1/4 of the resolution; `width`
        is that of the transformer, too.
    blocks: of the multi-view transformer, an even number; every other one has shifted windows.
    windows: of its attention, along each axis.
    neighbours: other views at most that a view is compared with, the nearest ones.
    expansion: of its feed-forward layers.
    vit_width, vit_blocks, vit_heads: of the monocular branch.
    vit_grid: patches along each side of the image that its position embedding is stored for.
    unet_width: channels of the cost volume's U-Net, a multiple of `unet_head`.
    unet_head: channels of one of its attention heads.
    depth_width, feature_width: of the two upsamplers.
    head_width: of the convolutions in front of the Gaussian head.
    sh_degree: of the head's colour coefficients; the degree-0 ones are used, the others only have their parameters.
    scale_max, scale_min: bounds of a Gaussian's standard deviations (thesis Eq. 5.1), metres at a camera distance of
        1.5 m and a field of view of 50°; they grow with the object as the depth range does.
    capacity: Gaussians kept at most; more pixels than that are thinned evenly.
    """

    adjustable: ClassVar[tuple[str, ...]] = ("bins", "neighbours", "capacity")

    size: int = 256
    candidates: int = 64
    near: float = 0.55
    far: float = 2.54
    bins: Literal["window", "global"] = "window"
    compat: bool = False
    stem_width: int = 64
    half_width: int = 96
    width: int = 128
    blocks: int = 6
    windows: int = 2
    neighbours: int = 5
    expansion: int = 4
    vit_width: int = 384
    vit_blocks: int = 12
    vit_heads: int = 6
    vit_grid: int = 37
    unet_width: int = 128
    unet_head: int = 32
    depth_width: int = 32
    feature_width: int = 64
    head_width: int = 64
    sh_degree: int = 2
    scale_max: float = 1e-2
    scale_min: float = 1e-6
    capacity: int = 65536

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the fields, their values and what fits.
        """
        counts = [field.name for field in dataclasses.fields(self) if field.type == "int" and field.name != "sh_degree"]
        rules = [(f"{name} is {getattr(self, name)}", getattr(self, name) >= 1, "at least 1") for name in counts]
        rules += [
            (f"size is {self.size}", self.size % 16 == 0 and self.size >= 2 * CELL * self.windows, "a multiple of 16"),
            (f"sh_degree is {self.sh_degree}", 0 <= self.sh_degree <= 3, "0, 1, 2 or 3"),
            (f"blocks is {self.blocks}", self.blocks % 2 == 0, "an even number"),
            (f"vit_blocks is {self.vit_blocks}", self.vit_blocks % TAPS == 0, f"a multiple of {TAPS}"),
            (f"windows is {self.windows}", self.size // CELL % (2 * self.windows) == 0, "a divisor of size/8"),
            (f"vit_width is {self.vit_width}", self.vit_width % (8 * self.vit_heads) == 0, "a multiple of 8 vit_heads"),
            (f"width is {self.width}", self.width % 4 == 0, "a multiple of 4"),
            (f"unet_width is {self.unet_width}", self.unet_width % max(self.unet_head, 4) == 0, "a multiple of heads"),
            (f"near is {self.near} and far {self.far}", 0 < self.near < self.far, "0 < near < far"),
            (f"candidates is {self.candidates}", self.candidates >= 2, "at least 2"),
            (f"scale_max is {self.scale_max}", 0 < self.scale_min < self.scale_max, "greater than scale_min > 0"),
        ]
        for problem, fits, remedy in rules:
            if not fits:
                raise UserError("out-of-range", f"{problem} in {type(self).__name__}", f"it must be {remedy}")

    def untrained(self, *, key: Key[Array, ""]) -> DepthSplat:
        """The member with random weights."""
        # The network is made of this configuration, so its module cannot be imported before this one is.
        from aerojax.reconstruct.depthsplat.reconstructor import untrained_depthsplat

        return untrained_depthsplat(self, key=key)


@dataclasses.dataclass(frozen=True)
class DepthSplatConfig(DepthSplatSizes):
    """The thesis' sizes: 256² pixels, 64 candidates, 38.12 M parameters."""

    name: Literal["depthsplat"] = "depthsplat"


@dataclasses.dataclass(frozen=True)
class DepthSplatTinyConfig(DepthSplatSizes):
    """The same network at 64² pixels and about a million parameters: it trains on two cores.

    The bounds of the scales grow with the pixels, which are four times as wide.
    """

    name: Literal["depthsplat_tiny"] = "depthsplat_tiny"
    size: int = 64
    candidates: int = 32
    stem_width: int = 16
    half_width: int = 24
    width: int = 32
    blocks: int = 2
    vit_width: int = 48
    vit_blocks: int = 4
    vit_heads: int = 3
    vit_grid: int = 4
    unet_width: int = 32
    unet_head: int = 16
    depth_width: int = 16
    feature_width: int = 16
    head_width: int = 32
    sh_degree: int = 0
    scale_max: float = 4e-2
    capacity: int = 8192


def parity_config() -> DepthSplatConfig:
    """What the thesis and upstream compute, shortcuts included."""
    return DepthSplatConfig(compat=True, bins="global")
