"""The factory cuts out what the pipeline would, also of views whose border cuts the object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.cut_views import aimed_aside
from support.factory_configs import IDEAL, small_factory

from aerojax.core.types import FrameSet
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.factory.observations import crop_clip, see_clip
from aerojax.pipeline.factory.plan import plan_clip
from aerojax.reconstruct.constant import ConstantConfig
from aerojax.reconstruct.observe import observe
from aerojax.segment.silhouettes import silhouette_of
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import identities

PLANE = identities("train")[2]


def silhouettes_of(sights, cameras):
    """Whole images of the masks, of which the factory has windows."""
    found = []
    for index, (one, camera) in enumerate(zip(sights, cameras, strict=True)):
        coverage = np.zeros((camera.height, camera.width), np.float32)
        if one is not None:
            x0, y0, x1, y1 = one.window
            coverage[y0:y1, x0:x1] = one.mask
        found.append(silhouette_of(index, 1, coverage))
    return found


@pytest.mark.parametrize("whole", [1, 2])
def test_cut_views_are_those_of_the_pipeline(whole):
    config = small_factory(faults=IDEAL, pipeline=PipelineConfig(min_views=2))
    mesh = build_animated(PLANE)
    plan = plan_clip(PLANE, mesh, "one", 0, config)
    middle = [0.5 * (one.box[0] + one.box[2]) for one in see_clip(plan, mesh, config)[0] if one is not None]
    cameras = plan.cameras[:3]
    assert len(middle) == len(plan.cameras)
    for camera in range(whole, 3):
        cameras = aimed_aside(cameras, camera, int(middle[camera]))
    plan = replace(plan, cameras=cameras, calibration=cameras)
    frames = see_clip(plan, mesh, config)[:1]
    assert [one is not None and one.whole for one in frames[0]] == [camera < whole for camera in range(3)]

    found = crop_clip(frames, plan, config)
    assert found is not None and found.known is not None
    rig_from_world = np.linalg.inv(cameras[0].world_from_cam)
    in_rig = [replace(c, world_from_cam=rig_from_world @ c.world_from_cam) for c in cameras]
    pictures = tuple(np.zeros((c.height, c.width, 3), np.float32) for c in cameras)
    size, silhouettes = config.pipeline.crop_size, silhouettes_of(frames[0], cameras)
    seen = observe(
        FrameSet(0, 0.0, pictures, (None,) * 3),
        silhouettes,
        in_rig,
        size=size,
        world_from_rig=np.eye(4),
        cut_views=True,
    )
    np.testing.assert_array_equal(found.cut[0, :3], [camera >= whole for camera in range(3)])
    np.testing.assert_array_equal(found.valid[0, :3], seen.valid)
    np.testing.assert_array_equal(found.known[0, :3], np.asarray(seen.views.known))
    np.testing.assert_allclose(found.mask[0, :3], seen.views.mask, atol=1e-5)
    np.testing.assert_allclose(found.rig_from_crop[0], seen.rig_from_crop[:3, 3], atol=1e-6)

    without = crop_clip(frames, plan, config, cut_views=False)
    unread = replace(config, pipeline=replace(config.pipeline, reconstruct=ConstantConfig()))
    for left in (without, crop_clip(frames, plan, unread)):
        if whole < config.pipeline.min_views:
            assert left is None
        else:
            assert left is not None and left.known is None and not left.cut.any()
            np.testing.assert_array_equal(left.valid[0, :3], seen.whole)
