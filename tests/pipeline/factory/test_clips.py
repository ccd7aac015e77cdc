"""A factory's clip is the one that the recorded scene and the pipeline give; its facts; what cannot be used."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np
import pytest
from support.factory_configs import IDEAL, small_factory

from aerojax.capture.format import read_capture
from aerojax.core.seeds import number_of
from aerojax.data.clips import crop_bytes
from aerojax.pipeline.factory.clips import clip_of, clips_of
from aerojax.pipeline.factory.plan import plan_clip
from aerojax.pipeline.offline import reconstruct_capture
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import build_identity, identities
from aerojax.simulate.plan.scene import FlyingObject, ScenePlan, image_patterns
from aerojax.simulate.record import record_scene

PLANE = identities("train")[2]
MEANS, SHAPES = slice(0, 3), slice(3, 11)


@pytest.mark.slow
def test_a_clip_is_that_of_the_recorded_scene(tmp_path):
    config = small_factory(faults=replace(IDEAL, rotation_deg=(0.1, 0.1)))
    mesh = build_animated(PLANE)
    plan = plan_clip(PLANE, mesh, "one", 0, config)
    flown = FlyingObject(PLANE, build_identity(PLANE, tmp_path), plan.flight, plan.phase)
    images = replace(config.images, mask_threshold=plan.faults.mask_threshold, coverage=False)
    cameras, calibration = (tuple(image_patterns(c, images) for c in some) for some in (plan.cameras, plan.calibration))
    scene = ScenePlan((flown,), cameras, calibration, plan.environment, images, config.frames, plan.fps, plan.margin)
    record_scene(scene, tmp_path / "capture")
    key = jax.random.key(number_of(config.seed, "one") % 2**31)
    expected = reconstruct_capture(read_capture(tmp_path / "capture"), config.pipeline, key=key, object_id=1)

    clip = clip_of(PLANE, mesh, "one", 0, config)
    assert clip is not None
    columns = np.asarray(expected.in_world().columns())[:, : config.tokens]
    assert clip.columns.shape == columns.shape == (2, config.tokens, 14)
    # Equal distances may be ranked otherwise by another rounding: then some tokens are others.
    same = np.abs(clip.columns[..., MEANS] - columns[..., MEANS]).max(axis=-1) < 1e-3
    assert same.mean() > 0.9
    np.testing.assert_allclose(clip.columns[same][:, SHAPES], columns[same][:, SHAPES], atol=5e-3)
    crops = expected.seen.crops
    assert crops is not None and clip.crops is not None
    np.testing.assert_array_equal(clip.crop_valid, np.asarray(crops.valid))
    difference = clip.crops.astype(int) - crop_bytes(np.asarray(crops.rgba)).astype(int)
    assert np.abs(difference[..., 3]).max() <= 1  # silhouettes are the same
    assert np.abs(difference[..., :3]).mean() < 3.0  # a face has one colour instead of a texture


def test_facts_say_how_a_clip_came_about():
    config = small_factory(faults=replace(IDEAL, mask_threshold=(0.4, 0.4), clock_ms=(5.0, 5.0)))
    [(name, clip)] = clips_of(PLANE, [3], config)
    assert name == f"{PLANE.name}_c003" and clip is not None
    facts = clip.facts
    assert (facts["rig"], facts["cameras"], facts["clock_ms"], facts["mask_threshold"]) == ("sphere", 4, 5.0, 0.4)
    assert facts["distance_m"] == pytest.approx(8.0, rel=0.2) and facts["width_px"] == pytest.approx(40.0, rel=0.2)
    assert clip.label == "airplane" and clip.identity == PLANE.name
    assert clip.columns.dtype == np.float32 and np.isfinite(clip.columns).all()


def test_a_clip_that_nobody_sees_is_tried_again_and_given_up():
    faults = replace(IDEAL, rotation_deg=(40.0, 40.0))  # silhouettes never meet
    [(_, clip)] = clips_of(PLANE, [0], small_factory(faults=faults, attempts=2))
    assert clip is None
