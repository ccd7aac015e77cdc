"""Silhouettes that do not meet are shifted until they do: by how much, when not, and what is reconstructed then."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.disagreeing_cameras import observed, turned
from support.networks import AXES, frame_sets, network

from aerojax.core.types import View
from aerojax.geometry.rotations import haar_rotation
from aerojax.reconstruct.alignment import MOST_UNCOVERED, misplaced, reconstruct_aligned
from aerojax.reconstruct.consistency import uncovered_shares
from aerojax.reconstruct.hull import HullConfig, visual_hull

CAMERAS = network(5)
FRAME = next(iter(frame_sets(CAMERAS, range(1))))
HULL = jax.jit(lambda views, valid: visual_hull(views, valid, config=HullConfig(grid=48, capacity=2048))[:2])
DEGREES = 6.0
"""Half a metre at the object, half of its length."""


def aligned(seen):
    """The reconstruction, and how often the hull was asked."""
    asked = []

    def hull(views: View):
        asked.append(views)
        found, count = HULL(views, jnp.asarray(seen.valid))
        return found, int(count)

    return reconstruct_aligned(hull, seen.views, seen.valid), asked


def axes_of(made) -> np.ndarray:
    """Half axes of the reconstruction's bounding ellipsoid, sorted."""
    points = np.asarray(made.gaussians.mean)[: made.count]
    spread = np.linalg.eigvalsh(np.cov(points.T))
    return np.sqrt(spread / 0.3)  # about 0.3 a² along each axis of an ellipsoid's surface


def test_silhouettes_that_fit_are_left_alone():
    made, asked = aligned(observed(FRAME, CAMERAS))
    assert len(asked) == 1 and made.count > 500 and not made.shift_m.any()
    assert np.nanmax(made.uncovered) < 0.1


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.7, -0.7, 0.0)])
def test_a_turned_camera_is_shifted_back(axis):
    right, _ = aligned(observed(FRAME, CAMERAS))
    seen = observed(FRAME, turned(CAMERAS, 1, DEGREES * np.array(axis)))
    made, asked = aligned(seen)
    assert len(asked) == 2 and np.nanmedian(made.uncovered) > MOST_UNCOVERED  # as they are stated
    assert 0.05 < made.shift_m.max() < 0.6
    np.testing.assert_allclose(axes_of(made), axes_of(right), atol=0.04)
    spoilt, count = HULL(seen.views, jnp.asarray(seen.valid))  # without shifts it is another shape
    assert count == 0 or abs(axes_of(replace(made, gaussians=spoilt, count=int(count)))[2] - AXES[0]) > 0.1


def test_shifts_restore_what_the_turn_displaced():
    """Up to the object's own place: between cameras the displacement along a pair's normal is that of the turn."""
    seen = observed(FRAME, turned(CAMERAS, 1, (DEGREES, 0.0, 0.0)))
    shift = misplaced(seen.views, seen.valid)
    assert shift is not None
    along = np.einsum("ck,ck->c", shift, np.asarray(seen.views.camera.world_from_cam)[:, :3, 2])
    assert np.abs(along).max() < 0.02  # across the central rays
    assert np.linalg.norm(shift, axis=1).argmax() == 1


def test_shifts_turn_with_the_rig():
    seen = observed(FRAME, turned(CAMERAS, 1, (DEGREES, 0.0, 0.0)))
    turn = haar_rotation(key=jax.random.key(4))
    pose = seen.views.camera.world_from_cam
    moved = pose.at[:, :3, 3].set(pose[:, :3, 3] @ turn.T).at[:, :3, :3].set(turn @ pose[:, :3, :3])
    views = replace(seen.views, camera=replace(seen.views.camera, world_from_cam=moved))
    here, there = misplaced(seen.views, seen.valid), misplaced(views, seen.valid)
    assert here is not None and there is not None
    np.testing.assert_allclose(there, here @ np.asarray(turn).T, atol=1e-4)
    assert np.abs(there - here).max() > 0.05


def test_what_is_far_away_is_another_object():
    seen = observed(FRAME, turned(CAMERAS, 1, (0.0, 30.0, 0.0)))
    assert misplaced(seen.views, seen.valid) is None
    made, asked = aligned(seen)
    assert made.count == 0 and len(asked) == 1 and not made.shift_m.any()
    np.testing.assert_array_equal(made.uncovered, uncovered_shares(seen.views, seen.valid, np.zeros((0, 3))))


def test_cameras_that_do_not_count_are_not_asked():
    blind = replace(FRAME, ids=(*FRAME.ids[:4], None))
    shift = misplaced(*(lambda s: (s.views, s.valid))(observed(blind, turned(CAMERAS, 1, (DEGREES, 0.0, 0.0)))))
    assert shift is not None and not shift[4].any()
