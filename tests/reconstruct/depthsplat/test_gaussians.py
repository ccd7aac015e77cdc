"""What the head's numbers mean, by hand."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.depthsplat_examples import SMALL, rig

from aerojax.core.types import SH_C0, View
from aerojax.geometry.cameras import project_points
from aerojax.geometry.covariances import covariance_from_axes
from aerojax.reconstruct.depthsplat.draws import drawn
from aerojax.reconstruct.depthsplat.gaussians import GaussianHead, bounded_scale, pixel_gaussians

SIZE = 8


@pytest.fixture(scope="module")
def made():
    rng = np.random.default_rng(0)
    cameras = rig(2, SIZE)
    raw = jnp.asarray(rng.normal(0, 3, (2, SIZE, SIZE, 13)), jnp.float32)
    depth = jnp.asarray(rng.uniform(1, 2, (2, SIZE, SIZE)), jnp.float32)
    gate = jnp.asarray(rng.uniform(0, 1, (2, SIZE, SIZE)), jnp.float32)
    rgb = jnp.asarray(rng.uniform(0, 1, (2, SIZE, SIZE, 3)), jnp.float32)
    unit = jnp.asarray(2.0)
    gaussians = pixel_gaussians(raw, depth, gate, View(rgb, gate, cameras), unit, SMALL)
    shaped = jax.tree.map(lambda leaf: leaf.reshape(2, SIZE, SIZE, *leaf.shape[1:]), gaussians)
    return raw, depth, gate, rgb, cameras, shaped


def test_means_lie_at_the_depth_within_their_pixel(made):
    _, depth, _, _, cameras, gaussians = made
    for view in range(2):
        camera = jax.tree.map(lambda leaf, view=view: leaf[view], cameras)
        pixels = np.asarray(project_points(gaussians.mean[view].reshape(-1, 3), camera)).reshape(SIZE, SIZE, 2)
        rows, columns = np.mgrid[:SIZE, :SIZE]
        inside = pixels - np.stack([columns, rows], axis=-1)
        assert inside.min() > -1e-4 and inside.max() < 1 + 1e-4
        forward = np.asarray(camera.world_from_cam[:3, 2])
        along = (np.asarray(gaussians.mean[view]) - np.asarray(camera.world_from_cam[:3, 3])) @ forward
        np.testing.assert_allclose(along, depth[view], rtol=1e-5)


def test_bounds_and_gates(made):
    raw, _, gate, rgb, _, gaussians = made
    np.testing.assert_allclose(gaussians.opacity, jax.nn.sigmoid(raw[..., 0]) * gate, rtol=1e-6)
    expected = 2.0 * (SMALL.scale_max * jax.nn.sigmoid(raw[..., 3:6]) + SMALL.scale_min)
    np.testing.assert_allclose(gaussians.scale, expected, rtol=1e-6)
    colour = 0.5 + SH_C0 * (gaussians.sh[..., 0, :] - raw[..., 10:])
    np.testing.assert_allclose(colour, rgb, atol=1e-5)
    np.testing.assert_allclose(jnp.linalg.norm(gaussians.quaternion, axis=-1), 1.0, atol=1e-5)


def test_axes_turn_with_the_camera(made):
    """Σ = R_cam (R_q S² R_qᵀ) R_camᵀ with the head's quaternion in the order x, y, z, w."""
    raw, _, _, _, cameras, gaussians = made
    wxyz = jnp.roll(raw[..., 6:10], 1, axis=-1)
    own = covariance_from_axes(wxyz, gaussians.scale)
    turn = cameras.world_from_cam[:, None, None, :3, :3]
    expected = turn @ own @ jnp.swapaxes(turn, -1, -2)
    np.testing.assert_allclose(covariance_from_axes(gaussians.quaternion, gaussians.scale), expected, atol=1e-7)


def test_scales_stay_within_equation_5_1():
    scale = bounded_scale(jnp.asarray([[-1e3, 0.0, 1e3]]), jnp.ones(()), SMALL)
    expected = [SMALL.scale_min, SMALL.scale_max / 2 + SMALL.scale_min, SMALL.scale_max + SMALL.scale_min]
    np.testing.assert_allclose(scale[0], expected, rtol=1e-5)


def test_the_head_starts_with_the_image_s_colours_and_medium_scales():
    head = drawn(lambda draws: GaussianHead(SMALL, draws=draws), key=jax.random.key(0))
    rng = np.random.default_rng(1)
    image, depth, features = (
        jnp.asarray(rng.normal(size=(1, 8, 8, c)), jnp.float32) for c in (3, 1, SMALL.feature_width)
    )
    raw = np.asarray(head(image, depth, depth, features))
    assert np.abs(raw[..., 3:6]).max() == 0.0 == np.abs(raw[..., 10:]).max()
    assert np.abs(raw[..., 6:10]).max() > 0
