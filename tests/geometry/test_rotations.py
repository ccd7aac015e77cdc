"""Rotations by hand-computed numbers."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.geometry.rotations import (
    canonical_sign,
    normalise,
    quaternion_from_rotation,
    quaternion_multiply,
    rotation_about_z,
    rotation_between,
    rotation_from_quaternion,
    skew,
)

HALF = np.sqrt(0.5)


def test_quaternions_by_hand():
    quarter_z = jnp.array([HALF, 0.0, 0.0, HALF])
    expected = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(rotation_from_quaternion(quarter_z), expected, atol=1e-6)
    np.testing.assert_allclose(rotation_from_quaternion(-3.0 * quarter_z), expected, atol=1e-6)
    np.testing.assert_allclose(rotation_about_z(jnp.array(np.pi / 2)), expected, atol=1e-6)
    half_z = quaternion_multiply(quarter_z, quarter_z)
    np.testing.assert_allclose(half_z, [0, 0, 0, 1], atol=1e-6)
    # i ⊗ j = k, j ⊗ i = -k
    i, j = jnp.array([0.0, 1.0, 0.0, 0.0]), jnp.array([0.0, 0.0, 1.0, 0.0])
    np.testing.assert_allclose(quaternion_multiply(i, j), [0, 0, 0, 1])
    np.testing.assert_allclose(quaternion_multiply(j, i), [0, 0, 0, -1])


@pytest.mark.parametrize(
    ("diagonal", "quaternion"),
    [
        ((1, 1, 1), (1, 0, 0, 0)),
        ((1, -1, -1), (0, 1, 0, 0)),
        ((-1, 1, -1), (0, 0, 1, 0)),
        ((-1, -1, 1), (0, 0, 0, 1)),
    ],
)
def test_each_branch_of_shepperd(diagonal, quaternion):
    np.testing.assert_allclose(quaternion_from_rotation(jnp.diag(jnp.array(diagonal, jnp.float32))), quaternion)


def test_canonical_sign_keeps_half_turns():
    halves = jnp.array([[0.0, -1.0, 0.0, 0.0], [-0.6, 0.8, 0.0, 0.0], [0.6, -0.8, 0.0, 0.0]])
    np.testing.assert_allclose(canonical_sign(halves), [[0, -1, 0, 0], [0.6, -0.8, 0, 0], [0.6, -0.8, 0, 0]], atol=1e-7)


def test_zero_is_handled():
    np.testing.assert_array_equal(normalise(jnp.zeros(3)), np.zeros(3))
    np.testing.assert_allclose(rotation_from_quaternion(jnp.zeros(4)), np.eye(3))


def test_skew_is_the_cross_product():
    v, u = jnp.array([1.0, 2.0, 3.0]), jnp.array([-2.0, 0.5, 4.0])
    np.testing.assert_allclose(skew(v) @ u, [6.5, -10.0, 4.5])


def test_rotation_between_by_hand():
    x, y = jnp.array([1.0, 0.0, 0.0]), jnp.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(rotation_between(x, y), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-6)
    np.testing.assert_allclose(rotation_between(x, x), np.eye(3), atol=1e-6)
    assert np.isfinite(rotation_between(x, -x)).all()
