"""Gaussians over time in one USD file, as OpenUSD's own `ParticleField3DGaussianSplat` prim.

Scales are linear, opacities 0..1, quaternions w x y z, colour coefficients particle after particle: the same numbers as
in memory. Every array is time-sampled, so a sequence is one file; the number of Gaussians may change between frames.
`aerojax.gaussians.io.usd_reading` reads them back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64
from pxr import Gf, Sdf, Usd, UsdGeom, UsdVol, Vt

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.core.usd_files import export_stage
from aerojax.gaussians.sh import degree_of

PRIM = "/Gaussians"
SUFFIXES = (".usd", ".usda", ".usdc")
EXTENT_SIGMAS = 3.0
"""Standard deviations that the bounding box covers."""


def write_usd(
    path: Path | str,
    frames: Sequence[Gaussians],
    *,
    frames_per_second: float = 30.0,
    origin: Float64[np.ndarray, "3"] | None = None,
    time_codes: Sequence[int] | None = None,
) -> None:
    """Write a sequence of Gaussians (+Z up, metres) as one prim; frame i is time code i unless codes are given.

    Args:
        path: ends with .usd, .usda or .usdc; an existing file is replaced.
        frames: one set of Gaussians an instant, all of one colour degree; a single one is written without time.
        frames_per_second: time codes a second.
        origin: where the Gaussians' origin lies in the world, metres; becomes the prim's translation (float64) unless
            it is None or zero.
        time_codes: of the frames, ascending.

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
    if origin is not None and np.any(origin):
        if not np.all(np.isfinite(origin)):
            raise UserError("invalid", f"{path}: origin has non-finite numbers", "give metres")
        splats.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*(float(x) for x in origin)))
    codes = range(len(frames)) if time_codes is None else time_codes
    if len(frames) > 1:
        stage.SetStartTimeCode(codes[0])
        stage.SetEndTimeCode(codes[-1])
        stage.SetTimeCodesPerSecond(frames_per_second)
        stage.SetFramesPerSecond(frames_per_second)
    for code, arrays in zip(codes, values, strict=True):
        time = Usd.TimeCode(code) if len(frames) > 1 else Usd.TimeCode.Default()
        for name, array in arrays.items():
            splats.GetPrim().GetAttribute(name).Set(array, time)
    _export(stage, path)


def _export(stage: Usd.Stage, path: Path | str) -> None:
    """Write a stage, whole or not at all."""
    if Path(path).suffix not in SUFFIXES:
        raise UserError("invalid", f"{path}: cannot be written", f"the name must end with {', '.join(SUFFIXES)}")
    export_stage(stage, Path(path))


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
