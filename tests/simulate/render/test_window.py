"""The window's renderer beside the rays: the same masks, the same colours but for what rays sample less finely."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.render.window import WindowRenderer
from aerojax.simulate.world.rigs import aimed_camera
from kernels.rays.raytrace import Lighting

DOME = Dome(light=Lighting(sun_colour=(1.0, 0.9, 0.8), sky_colour=(0.8, 0.9, 1.0)), colour=(0.5, 0.6, 0.7))
TARGET = np.array([1.0, 2.0, 8.0])


def camera(distance: float, focal: float, past: tuple[float, float, float] = (0.0, 0.0, 0.0)):
    centre = TARGET + distance * np.array([0.8, 0.5, -0.33])
    return aimed_camera(0, centre, TARGET + past, focal=focal, size=(int(focal), int(0.8 * focal)))


@pytest.mark.parametrize("which", range(4))
@pytest.mark.parametrize(("distance", "focal"), [(10.0, 200.0), (4.0, 300.0), (100.0, 6000.0)])
def test_the_window_is_that_of_the_rays(which, distance, focal):
    mesh, config = build_animated(identities("train")[which]), ImageConfig(depth=False)
    pose = np.eye(4)
    pose[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    pose[:3, 3] = TARGET
    window, rays = WindowRenderer(mesh, DOME, config), SceneRenderer((mesh,), DOME, config)
    window.pose(0.123, pose)
    rays.pose([0.123], pose[None])
    view = camera(distance, focal)
    found, expected = window.image(view), rays.image(view)
    assert found is not None
    x0, y0, x1, y1 = found.window
    mask, rgb = expected.full("mask") > 0, expected.full_rgb()
    assert mask[y0:y1, x0:x1].sum() == mask.sum()
    assert (found.mask != mask[y0:y1, x0:x1]).sum() <= 1 + 0.002 * mask.sum()  # a sample on an edge
    assert np.abs(found.rgb - rgb[y0:y1, x0:x1]).mean() < 0.004


def test_nothing_is_seen_beside_and_behind_the_camera():
    mesh = build_animated(identities("train")[0])
    window = WindowRenderer(mesh, DOME, ImageConfig())
    pose = np.eye(4)
    pose[:3, 3] = TARGET
    window.pose(0.0, pose)
    assert window.image(camera(10.0, 200.0, past=(0.0, 30.0, 0.0))) is None
    assert window.image(camera(-10.0, 200.0, past=tuple(TARGET * 100))) is None
    assert window.image(camera(10.0, 200.0)) is not None
