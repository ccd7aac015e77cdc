"""Gradients are finite where geometry degenerates."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.types import Camera
from aerojax.geometry.cameras import project_points
from aerojax.geometry.rotations import normalise, quaternion_from_rotation, rotation_between, rotation_from_quaternion


def camera(world_from_cam=None, skew_px=0.0):
    K = jnp.array([[100.0, skew_px, 32.0], [0.0, 200.0, 24.0], [0.0, 0.0, 1.0]])
    return Camera(K, jnp.eye(4) if world_from_cam is None else world_from_cam, 64, 48)


@pytest.mark.parametrize(
    ("function", "at"),
    [
        (normalise, np.zeros(3)),
        (rotation_from_quaternion, np.zeros(4)),
        (lambda p: project_points(p, camera()), np.zeros(3)),
        (lambda p: rotation_between(p, jnp.array([0.0, 0.0, 1.0])), np.array([0.0, 0.0, 1.0])),
        (lambda p: rotation_between(p, jnp.array([0.0, 0.0, 1.0])), np.array([0.0, 0.0, -1.0])),
        (quaternion_from_rotation, np.eye(3)),
        (quaternion_from_rotation, np.diag([1.0, -1.0, -1.0])),
    ],
)
def test_gradients_are_finite_where_things_degenerate(function, at):
    gradient = jax.grad(lambda v: jnp.sum(function(v) ** 2 + function(v)))(jnp.asarray(at, jnp.float32))
    assert np.isfinite(gradient).all()
