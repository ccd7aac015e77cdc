"""Gaussians over time as USD: valid files, every variant of other writers; every error names file and remedy."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdValidation
from support.splat_scenes import assert_same, make_gaussians

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.io.usd import read_usd, write_usd


def unit(gaussians: Gaussians) -> Gaussians:
    q = gaussians.quaternion
    return dataclasses.replace(gaussians, quaternion=q / jnp.linalg.norm(q, axis=-1, keepdims=True))


@pytest.mark.parametrize("frames", [1, 3])
def test_usd_round_trip_is_valid_and_time_sampled(tmp_path, frames):
    """Numbers of Gaussians may differ between frames; every validator that ships with OpenUSD is content."""
    sequence = [make_gaussians(i, 5 + i, 9, np.float32) for i in range(frames)]
    path = tmp_path / "a.usdc"
    write_usd(path, sequence, frames_per_second=25.0)
    for gaussians, again in zip(sequence, read_usd(path), strict=True):
        assert_same(again, unit(gaussians), 1e-6)
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    if frames > 1:
        assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (0, frames - 1, 25)
    first = stage.GetDefaultPrim().GetAttribute("orientations").Get(0 if frames > 1 else Usd.TimeCode.Default())[0]
    np.testing.assert_allclose([first.GetReal(), *first.GetImaginary()], unit(sequence[0]).quaternion[0], atol=1e-6)
    registry = UsdValidation.ValidationRegistry()
    validators = [registry.GetOrLoadValidatorByName(m.name) for m in registry.GetAllValidatorMetadata()]
    assert len(validators) >= 20
    assert [e.GetMessage() for e in UsdValidation.ValidationContext(validators).Validate(stage)] == []


def test_usd_mistakes_are_named(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        read_usd(tmp_path / "absent.usda")
    (tmp_path / "a.usda").write_text("no usd")
    with pytest.raises(UserError, match="not a readable USD"):
        read_usd(tmp_path / "a.usda")
    Usd.Stage.CreateInMemory().Export(str(tmp_path / "b.usda"))
    with pytest.raises(UserError, match="no ParticleField3DGaussianSplat prim"):
        read_usd(tmp_path / "b.usda")
    write_usd(tmp_path / "c.usda", [make_gaussians(6, 3, 1, np.float32)])
    stage = Usd.Stage.Open(str(tmp_path / "c.usda"))
    stage.GetDefaultPrim().GetAttribute("opacities").Set([0.5])
    stage.GetRootLayer().Save()
    with pytest.raises(UserError, match="opacities has 1 numbers"):
        read_usd(tmp_path / "c.usda")


def test_what_cannot_be_written_is_refused(tmp_path):
    gaussians = make_gaussians(4, 2, 1, np.float32)
    with jax.debug_nans(False):
        bad = dataclasses.replace(gaussians, scale=jnp.asarray(np.array([[1, 1, np.nan], [1, 1, 1]], np.float32)))
    batched = jax.tree.map(lambda x: x[None], gaussians)
    for broken, message in ((bad, "frame 0: non-finite"), (batched, "batch of shape")):
        with pytest.raises(UserError, match=message):
            write_usd(tmp_path / "a.usda", [broken])
    with pytest.raises(UserError, match="share one colour degree"):
        write_usd(tmp_path / "b.usda", [gaussians, make_gaussians(5, 2, 4, np.float32)])
    with pytest.raises(UserError, match="cannot be written"):
        write_usd(tmp_path / "b.txt", [gaussians])
