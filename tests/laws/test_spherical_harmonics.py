"""Colour harmonics and the motion of Gaussians: rotation identities, and SciPy's harmonics as an independent basis."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import sph_harm_y
from support.splat_scenes import make_gaussians

from aerojax.core.errors import UserError
from aerojax.gaussians.rotate import covariance, rotate, transform
from aerojax.gaussians.sh import basis, colour_in_direction, rotate_sh, rotation_of_degree


def directions(count: int, seed: int) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def rotations(count: int) -> list[np.ndarray]:
    return list(Rotation.random(count, random_state=3).as_matrix())


def test_basis_is_scipys_real_harmonics(x64):
    """Y_lm real from the complex ones: sqrt(2)·Im or Re of (l, |m|), without a sign flip beyond Condon-Shortley's."""
    d = directions(20, 0)
    polar, azimuth = np.arccos(d[:, 2]), np.arctan2(d[:, 1], d[:, 0])
    expected = []
    for degree in range(4):
        for order in range(-degree, degree + 1):
            value = sph_harm_y(degree, abs(order), polar, azimuth)
            parts = {-1: np.sqrt(2) * value.imag, 0: value.real, 1: np.sqrt(2) * value.real}
            expected.append(parts[int(np.sign(order))])
    np.testing.assert_allclose(basis(jnp.asarray(d), 3), np.stack(expected, -1), atol=1e-12)


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_rotated_colour_is_the_colour_rotated(x64, coefficients):
    sh = jnp.asarray(np.random.default_rng(1).normal(0, 0.1, (coefficients, 3)))
    d = jnp.asarray(directions(30, 2))
    for matrix in rotations(4):
        turned = rotate_sh(sh, jnp.asarray(matrix))
        here = jax.vmap(lambda x: colour_in_direction(sh, x))(d)
        there = jax.vmap(lambda x, c=turned: colour_in_direction(c, x))(d @ matrix.T)
        np.testing.assert_allclose(there, here, atol=1e-12)
        if coefficients > 1:  # negative control: the inverse rotation is wrong
            back = rotate_sh(sh, jnp.asarray(matrix.T))
            wrong = jax.vmap(lambda x, c=back: colour_in_direction(c, x))(d @ matrix.T)
            assert float(jnp.abs(wrong - here).max()) > 1e-2


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_rotation_matrices_are_an_orthogonal_representation(x64, degree):
    a, b = map(jnp.asarray, rotations(2))
    first, second = rotation_of_degree(a, degree), rotation_of_degree(b, degree)
    np.testing.assert_allclose(first @ first.T, np.eye(2 * degree + 1), atol=1e-12)
    np.testing.assert_allclose(rotation_of_degree(a @ b, degree), first @ second, atol=1e-12)


def test_wrong_number_of_coefficients_is_refused():
    with pytest.raises(UserError, match="5 coefficients"):
        colour_in_direction(jnp.zeros((5, 3)), jnp.ones(3))


def test_covariance_turns_with_the_frame(x64):
    gaussians = make_gaussians(0, coefficients=9)
    matrix = jnp.asarray(rotations(1)[0])
    turned = rotate(gaussians, matrix)
    np.testing.assert_allclose(covariance(turned), matrix @ covariance(gaussians) @ matrix.T, atol=1e-12)
    assert np.all(np.asarray(turned.quaternion[:, 0]) >= 0)


def test_transform_composes_and_inverts(x64):
    gaussians = make_gaussians(1, coefficients=16)
    a = jnp.eye(4).at[:3, :3].set(rotations(1)[0]).at[:3, 3].set(jnp.array([1.0, -2.0, 0.5]))
    there = transform(gaussians, a, scale=3.0)
    np.testing.assert_allclose(there.mean, 3 * gaussians.mean @ a[:3, :3].T + a[None, :3, 3], atol=1e-12)
    back = transform(transform(gaussians, a), jnp.linalg.inv(a))
    for name in ("mean", "scale", "opacity", "sh"):
        np.testing.assert_allclose(getattr(back, name), getattr(gaussians, name), atol=1e-12)
    np.testing.assert_allclose(covariance(back), covariance(gaussians), atol=1e-12)
