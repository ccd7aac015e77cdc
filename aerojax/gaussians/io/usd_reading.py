"""Gaussian splats of a USD file, whoever wrote it: `ParticleField3DGaussianSplat` prims as UsdVol defines them.

Attributes are read in single precision, or in half precision (their names end with `h`) where only that is authored.
The prim's place in the stage counts: transforms above it, and the stage's up axis and metres per unit where they are
authored. A stage that says neither is taken as +Z up in metres, as splat tools write it (UsdGeom's fallbacks, +Y up in
centimetres, would shrink a drone to a fly).
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64
from pxr import Tf, Usd, UsdGeom, UsdVol

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.core.usd_copies import usd_copy
from aerojax.gaussians.io.placement import place, refuse_far
from aerojax.gaussians.sh import COEFFICIENTS

ATTRIBUTES = {
    "positions": (3,),
    "orientations": (4,),
    "scales": (3,),
    "opacities": (),
    "radiance:sphericalHarmonicsCoefficients": (3,),
}
"""The prim's arrays, in the order of the fields of `Gaussians`, and the shape of one entry."""
DEGREE = "radiance:sphericalHarmonicsDegree"
WORLD_FROM_STAGE = {
    "Z": np.eye(3),
    "Y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
}
"""Rotation to +Z up from each up axis that a stage may have."""
NOT_RIGID = 1e-5
"""Largest deviation from a rotation that rounding explains."""
OPACITY_ROUNDING = 1e-3
"""How far half precision may carry an opacity out of 0..1."""


def read_usd(path: Path | str, *, prim: str | None = None) -> list[Gaussians]:
    """Read the Gaussian-splat prim of a USD file: one set of Gaussians for every time sample, +Z up, metres.

    Args:
        path: the file.
        prim: path of the prim in the stage; needed where there are several.

    Raises:
        UserError: as `read_placed_usd`; or the Gaussians lie so far from the origin that float32 would round
            millimetres away, which `read_placed_usd` reads.
    """
    frames, origin = read_placed_usd(path, prim=prim)
    refuse_far(path, origin, "read_placed_usd")
    return frames


def read_placed_usd(path: Path | str, *, prim: str | None = None) -> tuple[list[Gaussians], Float64[np.ndarray, "3"]]:
    """Read the Gaussian-splat prim of a USD file, and where its Gaussians' origin lies in the world.

    Args:
        path: the file.
        prim: path of the prim in the stage; needed where there are several.

    Returns:
        One set of Gaussians for every time at which an attribute or a transform has a sample, and their origin in
        metres: world = origin + mean. The origin is zero unless the prim lies far from the stage's.

    Raises:
        UserError: the file cannot be opened or composed, holds no such prim or several, an array is missing, does not
            fit the others or holds impossible numbers, or a transform shears, mirrors or flattens: names it.
    """
    try:
        return _placed(path, prim)
    except UserError:
        raise
    except (Tf.ErrorException, TypeError, ValueError, OverflowError) as error:  # values are unpacked when asked for
        raise UserError(
            "unreadable",
            f"{path}: a value in it is damaged or of another type ({type(error).__name__})",
            "export it again",
        ) from None


def _placed(path: Path | str, prim: str | None) -> tuple[list[Gaussians], Float64[np.ndarray, "3"]]:
    if not Path(path).is_file():
        raise UserError("missing", f"{path}: no such file", "correct the path")
    with usd_copy(Path(path)) as copy:
        if copy.broken:
            first = copy.broken[0][1].strip().splitlines()[0]
            raise UserError(
                "missing",
                f"{path}: {len(copy.broken)} of the layers, references or payloads that it names cannot be composed: "
                f"{first}",
                "put the files where it names them, or flatten it",
            )
        stage = Usd.Stage.Open(str(copy.path))
        return _placed_prim(stage, _prim(stage, path, prim), path)


def _placed_prim(
    stage: Usd.Stage, splats: Usd.Prim, path: Path | str
) -> tuple[list[Gaussians], Float64[np.ndarray, "3"]]:
    source = f"{path}: prim {splats.GetPath()}"
    times = [Usd.TimeCode(t) for t in _samples(splats)] or [Usd.TimeCode.Default()]
    frames, origin = [], None
    for time in times:
        at = source if time.IsDefault() else f"{source} at time {time.GetValue():g}"
        gaussians = _gaussians(splats, time, at)
        world_from_prim, scale = _transform(stage, splats, time, at)
        if np.array_equal(world_from_prim, np.eye(4)) and scale == 1:
            placed, here = gaussians, np.zeros(3)
        else:
            placed, here = place(gaussians, world_from_prim, scale=scale)
        origin = here if origin is None else origin
        frames.append(dataclasses.replace(placed, mean=placed.mean + jnp.asarray(here - origin, jnp.float32)[None]))
    assert origin is not None  # there is at least the default time
    return frames, origin


def _prim(stage: Usd.Stage, path: Path | str, wanted: str | None) -> Usd.Prim:
    """The prim by name, or the only one."""
    found = {str(p.GetPath()): p for p in stage.Traverse() if p.IsA(UsdVol.ParticleField3DGaussianSplat)}
    if not found:
        raise UserError("invalid", f"{path}: no ParticleField3DGaussianSplat prim", "name a stage that holds Gaussians")
    if wanted is None and len(found) > 1:
        raise UserError(
            "invalid",
            f"{path}: {len(found)} ParticleField3DGaussianSplat prims: {', '.join(found)}",
            "say which (prim)",
        )
    if wanted is not None and wanted not in found:
        raise UserError("missing", f"{path}: no ParticleField3DGaussianSplat prim {wanted}", f"has {', '.join(found)}")
    return found[wanted] if wanted else next(iter(found.values()))


def _samples(splats: Usd.Prim) -> list[float]:
    """Every time at which an array of the prim or a transform on the way to it changes."""
    times = {t for name in ATTRIBUTES for end in ("", "h") for t in splats.GetAttribute(name + end).GetTimeSamples()}
    above = splats
    while above and not above.IsPseudoRoot():
        if above.IsA(UsdGeom.Xformable):
            times |= set(UsdGeom.Xformable(above).GetTimeSamples())
        above = above.GetParent()
    return sorted(times)


def _gaussians(splats: Usd.Prim, time: Usd.TimeCode, source: str) -> Gaussians:
    """The prim's arrays at one time, in its own frame and units."""
    degree = splats.GetAttribute(DEGREE).Get()
    if degree not in range(len(COEFFICIENTS)):
        raise UserError("invalid", f"{source}: {DEGREE} is {degree}", "0, 1, 2 and 3 are read")
    arrays = {name: _array(splats, name, shape, time, source) for name, shape in ATTRIBUTES.items()}
    count = len(arrays["positions"])
    *_, colours = ATTRIBUTES
    needed = {name: count * (COEFFICIENTS[degree] if name == colours else 1) for name in ATTRIBUTES}
    for name, values in arrays.items():
        if len(values) != needed[name]:
            raise UserError(
                "invalid",
                f"{source}: {name} has {len(values)} entries",
                f"{count} positions with colour of degree {degree} need {needed[name]}",
            )
        if not np.all(np.isfinite(values)):
            raise UserError("invalid", f"{source}: {name} holds numbers that are not finite", "drop those Gaussians")
    opacity, scale = arrays["opacities"], arrays["scales"]
    if np.any((opacity < -OPACITY_ROUNDING) | (opacity > 1 + OPACITY_ROUNDING)) or np.any(scale < 0):
        raise UserError(
            "invalid",
            f"{source}: opacities must lie in 0..1 and scales must not be negative",
            "UsdVol stores them as they are, not as logit and logarithm; export it again",
        )
    return Gaussians(
        jnp.asarray(arrays["positions"]),
        jnp.asarray(arrays["orientations"][:, [3, 0, 1, 2]]),  # arrays of quaternions have the real part last
        jnp.asarray(scale),
        jnp.asarray(np.clip(opacity, 0, 1)),
        jnp.asarray(arrays[colours].reshape(count, COEFFICIENTS[degree], 3)),
    )


def _array(splats: Usd.Prim, name: str, shape: tuple[int, ...], time: Usd.TimeCode, source: str) -> np.ndarray:
    """One attribute in single precision, else in half precision; UsdVol prefers the first where both are there."""
    for attribute in (splats.GetAttribute(name), splats.GetAttribute(name + "h")):
        if attribute.HasAuthoredValue() and (values := attribute.Get(time)) is not None:
            found = np.array(values, np.float32)
            if found.shape[1:] == shape or not found.size:
                return found.reshape(-1, *shape)
            raise UserError(
                "invalid", f"{source}: {attribute.GetName()} has entries of another type", "export it again"
            )
    raise UserError("missing", f"{source}: neither {name} nor {name}h has a value", "export it again")


def _transform(
    stage: Usd.Stage, splats: Usd.Prim, time: Usd.TimeCode, source: str
) -> tuple[Float64[np.ndarray, "4 4"], float]:
    """Rigid transform from the prim to the world (+Z up, metres), and the uniform scale that comes before it."""
    unit = UsdGeom.GetStageMetersPerUnit(stage) if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else 1.0
    turned = stage.HasAuthoredMetadata(UsdGeom.Tokens.upAxis)
    turn = WORLD_FROM_STAGE.get(str(UsdGeom.GetStageUpAxis(stage)), np.eye(3)) if turned else np.eye(3)
    matrix = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(splats)).T  # USD multiplies rows
    linear, translation = unit * turn @ matrix[:3, :3], unit * turn @ matrix[:3, 3]
    scale = float(np.cbrt(np.linalg.det(linear)))
    if not (np.all(np.isfinite(matrix)) and np.isfinite(unit) and scale > 0):
        raise UserError("invalid", f"{source}: its transform mirrors, flattens or is not finite", "apply it first")
    rotation = linear / scale
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > NOT_RIGID:
        raise UserError(
            "invalid",
            f"{source}: its transform shears or scales unequally, which colours cannot follow",
            "apply it first",
        )
    world_from_prim = np.eye(4)
    world_from_prim[:3, :3], world_from_prim[:3, 3] = rotation, translation
    return world_from_prim, 1.0 if abs(scale - 1) < NOT_RIGID else scale
