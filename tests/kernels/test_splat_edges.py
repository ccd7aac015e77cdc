"""What the splatter does at its borders: bad numbers, nothing to draw, ties, too much to draw."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import warp as wp
from support.splat_scenes import (
    BACKGROUND,
    LOOKING_ALONG_Z,
    QUICK,
    assert_same,
    drawing,
    make_camera,
    make_gaussians,
    single,
)

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.render import render
from kernels.splat import launch as splat_launch
from kernels.splat.launch import callables


@pytest.mark.parametrize("poison", [float("nan"), 7.0])
def test_every_element_of_poisoned_outputs_is_written(poison):
    """Outputs arrive uninitialised: pixels without Gaussians and Gaussians without pixels must be written too."""
    forward, backward = (callable_.func for callable_ in callables(wp.float32))
    width, height, count = 37, 21, 3
    record = np.tile(np.array([8, 8, 0.1, 0, 0.1, 0.5, -9, 1], np.float32), (count, 1))
    rectangles = np.array([[0, 0, 1, 1], [0, 0, 0, 0], [1, 0, 2, 2]], np.int32)

    def array(values, dtype):
        return wp.array(values, dtype=dtype, device="cpu")

    vec8, vec10 = wp.types.vector(length=8, dtype=wp.float32), wp.types.vector(length=10, dtype=wp.float32)
    inputs = (array(record, vec8), array(np.ones((count, 3), np.float32), wp.vec3))
    inputs += (array(np.ones(count, np.float32), wp.float32), array(rectangles, wp.vec4i))
    pixels = width * height
    floats = [np.full(shape, poison, np.float32) for shape in ((pixels, 3), (pixels,), (pixels,), (count, 10))]
    image, depth, final, gradient = (
        array(x, t) for x, t in zip(floats, (wp.vec3, wp.float32, wp.float32, vec10), strict=True)
    )
    last = array(np.full(pixels, -77, np.int32), wp.int32)
    background = array(np.full((1, 3), 0.25, np.float32), wp.vec3)
    forward(*inputs, background, width, height, 0.99, 1e-4, image, depth, final, last)
    ones = (array(np.ones((pixels, 3), np.float32), wp.vec3), *[array(np.ones(pixels, np.float32), wp.float32)] * 2)
    backward(*inputs, final, last, *ones, 1, width, height, 0.99, gradient)
    image, final = image.numpy().reshape(height, width, 3), final.numpy().reshape(height, width)
    np.testing.assert_array_equal(image[:, 32:], 0.25)
    np.testing.assert_array_equal(final[:, 32:], 1.0)
    np.testing.assert_allclose(image, (1 - final + 0.25 * final)[..., None].repeat(3, -1), atol=1e-6)
    np.testing.assert_allclose(depth.numpy().reshape(height, width), 1 - final, atol=1e-6)
    assert last.numpy().min() == 0 and last.numpy().max() == 1
    gradient = gradient.numpy()
    assert np.all(np.isfinite(gradient)) and np.all(gradient[1] == 0) and np.all(gradient[[0, 2], 6] > 0)


def test_non_finite_gaussians_are_dropped_counted_and_harmless():
    gaussians, camera = make_gaussians(9, dtype=np.float32), make_camera(dtype=np.float32)
    columns = [np.array(x) for x in jax.tree.leaves(gaussians)]
    mean, quaternion, scale, opacity, sh = columns
    mean[0, 1], mean[1, 2], quaternion[2, 0], scale[3, 0] = np.nan, np.inf, np.nan, -np.inf
    opacity[4], sh[5, 2, 1], scale[7] = np.nan, np.nan, 1e11
    with jax.debug_nans(False):  # the inputs may hold NaN; whatever comes out may not
        bad = Gaussians(*map(jnp.asarray, columns))
        lost = dataclasses.replace(camera, world_from_cam=jnp.full((4, 4), jnp.nan, jnp.float32))
    rest = jax.tree.map(lambda x: x[jnp.array([6, *range(8, 60)])], gaussians)

    @functools.partial(jax.jit, compiler_options=QUICK)
    def run(gaussians, camera):
        def loss(gaussians, camera):
            image = render(gaussians, camera, background=jnp.array(BACKGROUND))
            return jnp.sum(image.colour) + jnp.sum(image.depth), image

        return jax.grad(loss, argnums=(0, 1), has_aux=True)(gaussians, camera)

    (gradient, camera_gradient), image = run(bad, camera)
    assert int(image.dropped) == 6  # row 7 is finite; its projection overflows, so it is not drawn
    assert_same(image.colour, drawing()(rest, camera, background=jnp.array(BACKGROUND)).colour, 1e-6)
    assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves((gradient, camera_gradient, image)))
    assert all(np.all(np.asarray(x)[np.array([0, 1, 2, 3, 4, 5, 7])] == 0) for x in jax.tree.leaves(gradient))
    gradient, image = run(gaussians, lost)
    assert float(image.alpha.max()) == 0 and all(np.all(np.asarray(x) == 0) for x in jax.tree.leaves(gradient))


def test_zero_size_gaussian_is_the_low_pass():
    """Variance 0.3 square pixels at the centre (9.5, 10.5): alpha = o there and o·exp(-1/0.6) one pixel away."""
    image = drawing()(single((0, 0, 1), 0.0), LOOKING_ALONG_Z, background=jnp.zeros(3))
    np.testing.assert_allclose(image.alpha[10, 9], 0.8, rtol=1e-6)
    np.testing.assert_allclose(image.alpha[10, 10], 0.8 * np.exp(-0.5 / 0.3), rtol=1e-6)
    np.testing.assert_allclose(image.depth[10, 9], 0.8, rtol=1e-6)
    for antialias in (False, True):
        draw = functools.partial(render, camera=LOOKING_ALONG_Z, background=jnp.zeros(3), antialias=antialias)
        slope = jax.jit(jax.grad(lambda g, draw=draw: jnp.sum(draw(g).colour)), compiler_options=QUICK)
        gradient = slope(single((0, 0, 1), 0.0))
        assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(gradient))


@pytest.mark.parametrize("mean", [(0, 0, -1), (0, 0, 0.2), (0, 0, 0), (900, 0, 1)])
def test_behind_near_and_outside_are_not_drawn(mean):
    image = drawing()(single(mean, 0.1), LOOKING_ALONG_Z, background=jnp.full(3, 0.5))
    assert float(image.alpha.max()) == 0 and np.all(np.asarray(image.colour) == 0.5)


def test_empty_scene_is_background():
    empty = jax.tree.map(lambda x: x[:0], single((0, 0, 1), 0.1))
    image = drawing()(empty, LOOKING_ALONG_Z, background=jnp.array([0.1, 0.2, 0.3]))
    assert image.colour.shape == (19, 23, 3) and int(image.dropped) == 0
    np.testing.assert_allclose(image.colour[3, 4], [0.1, 0.2, 0.3])


@pytest.mark.parametrize("backend", ["warp", "reference"])
def test_coincident_gaussians_keep_index_order(backend):
    red, green = single((0, 0, 1), 0.2), single((0, 0, 1), 0.2, rgb=(0.0, 1.0, 0.0))
    pair = jax.tree.map(lambda *x: jnp.concatenate(x), red, green)
    image = drawing(backend=backend)(pair, LOOKING_ALONG_Z, background=jnp.zeros(3))
    np.testing.assert_allclose(image.colour[10, 9], [0.8, 0.16, 0.0], atol=1e-6)


def test_too_many_pairs_are_an_error_that_names_the_number(monkeypatch):
    monkeypatch.setattr(splat_launch, "MAX_PAIRS", 3)
    with pytest.raises(jax.errors.JaxRuntimeError, match="4 Gaussian-tile pairs are needed"):
        jax.block_until_ready(drawing()(single((0, 0, 1), 0.2), LOOKING_ALONG_Z, background=jnp.zeros(3)))


def test_antialias_keeps_the_energy_of_thin_gaussians():
    """Sum of alpha of a small isotropic Gaussian is 2π·o·σ² in pixels, with the low-pass only if compensated."""
    sigma_pixels = 0.92
    gaussian = single((0, 0, 1), sigma_pixels / 30, opacity=0.5)
    energy = 2 * np.pi * 0.5 * sigma_pixels**2
    sums = [
        float(drawing("gsplat", flag)(gaussian, LOOKING_ALONG_Z, background=jnp.zeros(3)).alpha.sum())
        for flag in (True, False)
    ]
    np.testing.assert_allclose(sums[0], energy, rtol=0.03)
    np.testing.assert_allclose(sums[1], energy * 1.146 / 0.846, rtol=0.03)


def test_unknown_names_are_refused():
    with pytest.raises(UserError, match="rules: unknown name 'nerf'; choose one of inria, gsplat"):
        render(single((0, 0, 1), 0.2), LOOKING_ALONG_Z, background=jnp.zeros(3), rules="nerf")
    odd = dataclasses.replace(single((0, 0, 1), 0.2), sh=jnp.zeros((1, 3, 3)))
    with pytest.raises(UserError, match="3 coefficients"):
        render(odd, LOOKING_ALONG_Z, background=jnp.zeros(3))
