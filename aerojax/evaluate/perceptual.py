"""Learned perceptual distances between images, each under the name of its published weights; none come with aerojax.

A distance is the difference of a trained network's features: unit over channels, squared, weighted by channel, averaged
over places, summed over five depths (Zhang et al. 2018, Eq. 1). Distances of different names are different numbers.

- `stlpips-alex`: shift-tolerant LPIPS on AlexNet (Ghildyal & Liu 2022), whose weights are in the package
  `stlpips-pytorch` (`pip install aerojax[perceptual]`); it is read as data and its code is not run.
- `lpips-alex`, `lpips-vgg`: LPIPS v0.1 (Zhang et al. 2018), from a file that a user has: the whole module's
  `state_dict()`, as `.pth` or `.safetensors`.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from aerojax.core.errors import UserError
from aerojax.core.tensors import read_tensors
from aerojax.core.torch_files import read_torch
from aerojax.core.types import pytree_dataclass, static_field

Distance = Literal["stlpips-alex", "lpips-alex", "lpips-vgg"]
DISTANCES: tuple[Distance, ...] = get_args(Distance)
PACKAGE, PACKED = "stlpips_pytorch", Path("weights") / "vST0.0" / "alex_shift_tolerant.pth"
SHIFT, SCALE = np.array([-0.030, -0.088, -0.188], np.float32), np.array([0.458, 0.448, 0.450], np.float32)
"""ImageNet's mean and deviation for values in -1..1 (Zhang et al. 2018)."""


class _Conv(NamedTuple):
    """A convolution and its ReLU; `blur` low-passes and halves between the two."""

    name: str
    padding: int = 1
    stride: int = 1
    blur: bool = False


class _Pool(NamedTuple):
    """The largest of `size`² values; `blur` low-passes and halves afterwards."""

    size: int
    stride: int
    blur: bool = False


_Layers = tuple[_Conv | _Pool, ...]


def _vgg_slice(number: int, names: tuple[int, ...]) -> _Layers:
    convs = tuple(_Conv(f"slice{number}.{name}") for name in names)
    return convs if number == 1 else (_Pool(2, 2), *convs)


TRUNKS: dict[Distance, tuple[_Layers, ...]] = {
    "stlpips-alex": (
        (_Conv("slice1.0", 2, blur=True),),
        (_Pool(3, 1, blur=True), _Conv("slice2.5", 2)),
        (_Pool(3, 1, blur=True), _Conv("slice3.9")),
        (_Conv("slice4.11"),),
        (_Conv("slice5.13"),),
    ),
    "lpips-alex": (
        (_Conv("slice1.0", 2, 4),),
        (_Pool(3, 2), _Conv("slice2.3", 2)),
        (_Pool(3, 2), _Conv("slice3.6")),
        (_Conv("slice4.8"),),
        (_Conv("slice5.10"),),
    ),
    "lpips-vgg": (
        _vgg_slice(1, (0, 2)),
        _vgg_slice(2, (5, 7)),
        _vgg_slice(3, (10, 12, 14)),
        _vgg_slice(4, (17, 19, 21)),
        _vgg_slice(5, (24, 26, 28)),
    ),
}
"""Layers up to each of the five depths, with the names that their weights have in the published modules."""


@dataclass(frozen=True)
class PerceptualConfig:
    """Which distance, if any.

    name: which network, or none.
    weights: file of the published module's parameters; None takes those of the installed package, which only
        `stlpips-alex` has.
    """

    name: Literal["none", "stlpips-alex", "lpips-alex", "lpips-vgg"] = "none"
    weights: Path | None = None


@pytree_dataclass
class Perceptual:
    """A distance with its weights: `distance(a, b)`.

    tensors: of the published module, by its names.
    """

    tensors: dict[str, Float[Array, "..."]]
    name: Distance = static_field()

    def __call__(
        self, a: Float[Array, "*batch height width 3"], b: Float[Array, "*batch height width 3"]
    ) -> Float[Array, "*batch"]:
        """Distance of images in 0..1, 0 for equal ones; sides of at least 32 pixels."""
        shape, size = a.shape[:-3], a.shape[-3:]
        found = self._features(jnp.concatenate([x.reshape(-1, *size) for x in (a, b)]))
        total = jnp.zeros(1)
        for depth, features in enumerate(found):
            x, y = jnp.split(_unit(features), 2)
            weight = self.tensors[f"lin{depth}.model.1.weight"][0, :, 0, 0]
            total = total + jnp.mean(((x - y) ** 2) @ weight, axis=(1, 2))
        return total.reshape(shape)

    def _features(self, images: Float[Array, "image height width 3"]) -> list[Float[Array, "image row column channel"]]:
        x, found = (2 * images - 1 - SHIFT[None, None, None]) / SCALE[None, None, None], []
        for layers in TRUNKS[self.name]:
            for layer in layers:
                x = self._convolved(x, layer) if isinstance(layer, _Conv) else _pooled(x, layer)
            found.append(x)
        return found

    def _convolved(self, x: Array, layer: _Conv) -> Array:
        kernel, bias = self.tensors[f"net.{layer.name}.weight"], self.tensors[f"net.{layer.name}.bias"]
        pads = [(layer.padding, layer.padding)] * 2
        form = ("NHWC", "OIHW", "NHWC")
        y = jax.lax.conv_general_dilated(x, kernel, (layer.stride,) * 2, pads, dimension_numbers=form)
        y = y + bias[None, None, None]
        return jax.nn.relu(_blurred(y) if layer.blur else y)


def _unit(x: Float[Array, "image row column channel"]) -> Float[Array, "image row column channel"]:
    """Features of length 1 over channels; a finite slope where all are 0."""
    return x * jax.lax.rsqrt(jnp.sum(x * x, axis=-1, keepdims=True) + 1e-20)


def _pooled(x: Array, layer: _Pool) -> Array:
    window, strides = (1, layer.size, layer.size, 1), (1, layer.stride, layer.stride, 1)
    y = jax.lax.reduce_window(x, -jnp.inf, jax.lax.max, window, strides, "VALID")
    return _blurred(y) if layer.blur else y


def _blurred(x: Array) -> Array:
    """Binomial 3×3 with two reflected pixels around, every other pixel kept (Zhang 2019; Ghildyal & Liu 2022)."""
    x = jnp.pad(x, ((0, 0), (2, 2), (2, 2), (0, 0)), mode="reflect")
    for axis in (1, 2):
        length = (x.shape[axis] - 3) // 2 + 1
        parts = [jax.lax.slice_in_dim(x, i, i + 2 * length - 1, 2, axis) for i in range(3)]
        x = 0.25 * parts[0] + 0.5 * parts[1] + 0.25 * parts[2]
    return x


def load_perceptual(config: PerceptualConfig) -> Perceptual | None:
    """The distance that the configuration names; None for "none".

    Raises:
        UserError: there is no such file or package, or it does not hold this network.
    """
    if config.name == "none":
        return None
    path = config.weights or _packed(config.name)
    if not path.is_file():
        raise UserError("missing", f"perceptual.weights={path} does not exist", "correct the path")
    stored = read_tensors(path)[0] if path.suffix == ".safetensors" else read_torch(path)
    wanted = [f"lin{depth}.model.1.weight" for depth in range(len(TRUNKS[config.name]))]
    for layers in TRUNKS[config.name]:
        names = [layer.name for layer in layers if isinstance(layer, _Conv)]
        wanted += [f"net.{name}.{part}" for name in names for part in ("weight", "bias")]
    lost = [name for name in wanted if not isinstance(stored, Mapping) or name not in stored]
    if lost:
        raise UserError("mismatch", f"{path} is no {config.name}: it lacks {lost[0]}", "give that module's parameters")
    return Perceptual(
        {name: jnp.asarray(np.ascontiguousarray(stored[name]), jnp.float32) for name in wanted}, config.name
    )


def _packed(name: Distance) -> Path:
    found = importlib.util.find_spec(PACKAGE) if name == "stlpips-alex" else None
    if found is None or not found.submodule_search_locations:
        remedy = "pip install aerojax[perceptual]" if name == "stlpips-alex" else "set perceptual.weights"
        raise UserError("unavailable", f"perceptual.name={name} has no weights here", remedy)
    return Path(found.submodule_search_locations[0]) / PACKED
