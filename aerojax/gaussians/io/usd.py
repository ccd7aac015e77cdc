"""Gaussians over time in one USD file, as OpenUSD's own `ParticleField3DGaussianSplat` prim.

Scales are linear, opacities 0..1, quaternions w x y z, colour coefficients particle after particle: the same numbers as
in memory. Every array is time-sampled, so a sequence is one file; the number of Gaussians may change between frames.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdVol, Vt

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.sh import degree_of

PRIM = "/Gaussians"
SUFFIXES = (".usd", ".usda", ".usdc")
EXTENT_SIGMAS = 3.0
"""Standard deviations that the bounding box covers."""


def write_usd(path: Path | str, frames: Sequence[Gaussians], *, frames_per_second: float = 30.0) -> None:
    """Write a sequence of Gaussians (+Z up, metres) as one prim; frame i is time code i.

    Args:
        path: ends with .usd, .usda or .usdc; an existing file is replaced.
        frames: one set of Gaussians an instant, all of one colour degree; a single one is written without time.
        frames_per_second: time codes a second.

    Raises:
        UserError: no frames, batched or non-finite Gaussians, differing degrees, or a file that cannot be written.
    """
    coefficients = {gaussians.sh.shape[-2] for gaussians in frames}
    if len(coefficients) != 1:
        raise UserError(
            "mismatch", f"{path}: frames must exist and share one colour degree", f"coefficients found: {coefficients}"
        )
    degree = degree_of(coefficients.pop())
    values = [_values(gaussians, f"{path}: frame {index}") for index, gaussians in enumerate(frames)]
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    splats = UsdVol.ParticleField3DGaussianSplat.Define(stage, Sdf.Path(PRIM))
    stage.SetDefaultPrim(splats.GetPrim())
    splats.CreateRadianceSphericalHarmonicsDegreeAttr(degree)
    if len(frames) > 1:
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(len(frames) - 1)
        stage.SetTimeCodesPerSecond(frames_per_second)
        stage.SetFramesPerSecond(frames_per_second)
    for index, arrays in enumerate(values):
        time = Usd.TimeCode(index) if len(frames) > 1 else Usd.TimeCode.Default()
        for name, array in arrays.items():
            splats.GetPrim().GetAttribute(name).Set(array, time)
    _export(stage, path)


def _export(stage: Usd.Stage, path: Path | str) -> None:
    """Write a stage; a file that is open elsewhere in the process is replaced all the same."""
    try:
        written = Path(path).suffix in SUFFIXES and stage.GetRootLayer().Export(str(path))
    except Tf.ErrorException:
        written = False
    if not written:
        raise UserError(
            "invalid",
            f"{path}: cannot be written",
            f"the name must end with {', '.join(SUFFIXES)} in a writable folder",
        )


def _values(gaussians: Gaussians, source: str) -> dict[str, Any]:
    """The prim's attributes for one frame, by name."""
    mean, quaternion, scale, opacity, sh = (
        np.asarray(getattr(gaussians, field.name), np.float32) for field in dataclasses.fields(gaussians)
    )
    if mean.ndim != 2:
        raise UserError("invalid", f"{source}: one set of Gaussians is needed", f"got a batch of shape {mean.shape}")
    if not all(np.all(np.isfinite(x)) for x in (mean, quaternion, scale, opacity, sh)):
        raise UserError("invalid", f"{source}: non-finite numbers", "drop those rows")
    norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
    unit = np.where(norm > 0, quaternion / np.where(norm > 0, norm, 1), np.array([1, 0, 0, 0], np.float32))
    reach = EXTENT_SIGMAS * scale.max(axis=1, keepdims=True, initial=0)
    extent = np.stack([(mean - reach).min(axis=0), (mean + reach).max(axis=0)]) if len(mean) else np.zeros((2, 3))
    # Arrays of quaternions lie in memory with the real part last.
    turned = np.ascontiguousarray(unit[:, [1, 2, 3, 0]], np.float32)
    return {
        "positions": Vt.Vec3fArray.FromNumpy(mean),
        "orientations": Vt.QuatfArray.FromNumpy(turned),
        "scales": Vt.Vec3fArray.FromNumpy(scale),
        "opacities": Vt.FloatArray.FromNumpy(opacity),
        "radiance:sphericalHarmonicsCoefficients": Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(sh.reshape(-1, 3))),
        "extent": Vt.Vec3fArray.FromNumpy(extent.astype(np.float32)),
    }


def read_usd(path: Path | str) -> list[Gaussians]:
    """Read the first Gaussian-splat prim of a USD file: one set of Gaussians for every time sample of its positions.

    The numbers are those of the prim's own frame; transforms above it are not applied.

    Raises:
        UserError: the file cannot be opened, holds no such prim, or its arrays do not fit each other.
    """
    if not Path(path).is_file():
        raise UserError("missing", f"{path}: no such file", "correct the path")
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        raise UserError("unreadable", f"{path}: not a readable USD file", "export it again") from None
    found = next((p for p in stage.Traverse() if p.IsA(UsdVol.ParticleField3DGaussianSplat)), None)
    if found is None:
        raise UserError("invalid", f"{path}: no ParticleField3DGaussianSplat prim", "name a stage that holds Gaussians")
    splats = UsdVol.ParticleField3DGaussianSplat(found)
    samples = splats.GetPositionsAttr().GetTimeSamples()
    times = [Usd.TimeCode(t) for t in samples] or [Usd.TimeCode.Default()]
    return [_frame(splats, time, str(path)) for time in times]


def _frame(splats: UsdVol.ParticleField3DGaussianSplat, time: Usd.TimeCode, path: str) -> Gaussians:
    coefficients = (splats.GetRadianceSphericalHarmonicsDegreeAttr().Get() + 1) ** 2
    attributes = {
        "positions": (splats.GetPositionsAttr(), (3,)),
        "orientations": (splats.GetOrientationsAttr(), (4,)),
        "scales": (splats.GetScalesAttr(), (3,)),
        "opacities": (splats.GetOpacitiesAttr(), ()),
        "sphericalHarmonicsCoefficients": (
            splats.GetRadianceSphericalHarmonicsCoefficientsAttr(),
            (coefficients, 3),
        ),
    }
    arrays = {}
    for name, (attribute, shape) in attributes.items():
        values = np.array(attribute.Get(time), np.float32)
        count = len(arrays["positions"]) if arrays else len(values)
        if values.size != count * int(np.prod(shape)):
            raise UserError(
                "invalid", f"{path}: {name} has {values.size} numbers at time {time}", f"{count} Gaussians need {shape}"
            )
        arrays[name] = values.reshape(count, *shape)
    arrays["orientations"] = arrays["orientations"][:, [3, 0, 1, 2]]
    return Gaussians(*(jnp.asarray(x) for x in arrays.values()))
