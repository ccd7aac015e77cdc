"""Configuration of LGM: a small one of ours, and the published one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from jaxtyping import Array, Key

from aerojax.core.errors import UserError
from aerojax.reconstruct.base import TrainableConfig

if TYPE_CHECKING:
    from aerojax.reconstruct.lgm.reconstructor import Lgm


@dataclass(frozen=True)
class LgmConfig(TrainableConfig):
    """Widths of the U-Net (Tang et al. 2024, §4.2); a view of n pixels a side becomes (n/2)² Gaussians.

    size: side of the images that the network reads, pixels; crops of another size are resampled.
    down, up: channels of the levels on the way down and up again; one level less on the way up.
    attends_down, attends_up: levels at which the views see each other.
    heads: of that attention. groups: of the group normalisation.
    blocks: residual blocks of a level on the way down; one more on the way up.
    precision: of the network's arithmetic; parameters are float32.
    """

    adjustable: ClassVar[tuple[str, ...]] = ("precision",)
    name: Literal["lgm"] = "lgm"
    size: int = 64
    down: tuple[int, ...] = (32, 64, 96, 128)
    up: tuple[int, ...] = (128, 96, 64)
    attends_down: tuple[bool, ...] = (False, False, False, True)
    attends_up: tuple[bool, ...] = (True, False, False)
    heads: int = 4
    groups: int = 16
    blocks: int = 1
    precision: Literal["float32", "bfloat16"] = "float32"

    def __post_init__(self) -> None:
        levels, back = len(self.down), len(self.up)
        if (levels, back) != (len(self.attends_down), len(self.attends_up)) or back != levels - 1:
            text = f"lgm: {levels} levels down, {back} up, attends {len(self.attends_down)} and {len(self.attends_up)}"
            raise UserError("mismatch", text, "give one level less on the way up, and each of them attends or not")
        if self.size % 2 ** (levels - 1):
            raise UserError("mismatch", f"lgm: size {self.size} does not halve {levels - 1} times", "choose another")

    def untrained(self, *, key: Key[Array, ""]) -> Lgm:
        """The member with random parameters."""
        from aerojax.reconstruct.lgm.reconstructor import Lgm
        from aerojax.reconstruct.lgm.unet import LgmNetwork

        return Lgm(LgmNetwork(self, key=key), self)


def published_config() -> LgmConfig:
    """The released "big" model: 415,042,848 parameters at 256 px (thesis Table 6.19)."""
    return LgmConfig(
        size=256,
        down=(64, 128, 256, 512, 1024, 1024),
        up=(1024, 1024, 512, 256, 128),
        attends_down=(False, False, False, True, True, True),
        attends_up=(True, True, True, False, False),
        heads=16,
        groups=32,
        blocks=2,
        precision="bfloat16",
    )
