"""Laws of the splatter: permutation, rigid motion, scale, transmittance, batching, reproducibility."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import BACKGROUND, QUICK, assert_same, drawing, make_camera, make_gaussians

from aerojax.gaussians.render import expected_depth, render
from aerojax.gaussians.rotate import transform
from aerojax.geometry.cameras import look_at
from kernels.splat import launch as splat_launch
from kernels.splat.launch import worker_threads
from kernels.splat.warp_kernels import blending_kernels


def test_order_of_gaussians_does_not_matter(x64):
    gaussians, camera = make_gaussians(0), make_camera()
    order = np.random.default_rng(1).permutation(60)
    shuffled = jax.tree.map(lambda x: x[order], gaussians)
    plain = drawing()(gaussians, camera, background=jnp.array(BACKGROUND))
    assert_same(drawing()(shuffled, camera, background=jnp.array(BACKGROUND)), plain, 1e-12)
    assert float(plain.alpha.max()) > 0.5


@pytest.mark.parametrize("turns_colour", [True, False])
def test_rotating_scene_and_camera_together_changes_nothing(x64, turns_colour):
    gaussians, camera = make_gaussians(2, coefficients=16), make_camera()
    dst_from_src = look_at(jnp.array([0.3, -2.0, 0.7]), jnp.array([1.0, 0.5, -0.4]))
    moved = transform(gaussians, dst_from_src)
    if not turns_colour:  # negative control: view-dependent colour left behind
        moved = dataclasses.replace(moved, sh=gaussians.sh)
    moved_camera = dataclasses.replace(camera, world_from_cam=dst_from_src @ camera.world_from_cam)
    plain = drawing()(gaussians, camera, background=jnp.array(BACKGROUND))
    turned = drawing()(moved, moved_camera, background=jnp.array(BACKGROUND))
    assert_same((turned.alpha, turned.depth), (plain.alpha, plain.depth), 1e-11)
    difference = float(jnp.abs(turned.colour - plain.colour).max())
    assert difference < 1e-11 if turns_colour else difference > 1e-2


def test_scaling_scene_and_camera_together_scales_depth_only(x64):
    gaussians, camera = make_gaussians(3), make_camera()
    larger = transform(gaussians, jnp.eye(4), scale=2.0)
    pose = camera.world_from_cam.at[:3, 3].multiply(2.0)
    plain = drawing()(gaussians, camera, background=jnp.array(BACKGROUND))
    scaled = drawing()(larger, dataclasses.replace(camera, world_from_cam=pose), background=jnp.array(BACKGROUND))
    assert_same((scaled.colour, scaled.alpha, scaled.depth / 2), (plain.colour, plain.alpha, plain.depth), 1e-11)


def test_alpha_is_what_hides_the_background(x64):
    gaussians, camera = make_gaussians(4), make_camera()
    black = drawing()(gaussians, camera, background=jnp.zeros(3))
    white = drawing()(gaussians, camera, background=jnp.ones(3))
    transmittance = white.colour - black.colour
    assert_same(transmittance, jnp.broadcast_to(1 - black.alpha[..., None], transmittance.shape), 1e-14)
    grey = dataclasses.replace(gaussians, sh=jnp.zeros_like(gaussians.sh))
    assert_same(drawing()(grey, camera, background=jnp.zeros(3)).colour[..., 1] * 2, black.alpha, 1e-14)


def test_depth_of_one_plane(x64):
    """All Gaussians at one depth z: expected depth is z wherever anything is drawn, and 0 elsewhere."""
    camera = dataclasses.replace(make_camera(), world_from_cam=jnp.eye(4))
    gaussians = make_gaussians(5)
    gaussians = dataclasses.replace(gaussians, mean=gaussians.mean.at[:, 2].set(1.7))
    image = drawing()(gaussians, camera, background=jnp.array(BACKGROUND))
    depth = np.asarray(expected_depth(image))
    np.testing.assert_allclose(depth[np.asarray(image.alpha) > 1e-6], 1.7, atol=1e-10)
    assert np.all(depth[np.asarray(image.alpha) <= 1e-6] == 0)


@pytest.mark.long
def test_vmap_is_the_loop_and_broadcasting_is_one_launch(monkeypatch):
    """Two scenes times three cameras in one call: nested vmap, broadcasting, a scan and a loop agree."""
    scenes = [make_gaussians(s, dtype=np.float32) for s in (6, 7)]
    centres = ((1.6, 0.3, 0.4), (-1.2, 1.1, 0.2), (0.4, -1.4, 0.9))
    cameras = [make_camera(c, dtype=np.float32) for c in centres]
    many_scenes = jax.tree.map(lambda *x: jnp.stack(x), *scenes)
    many_cameras = jax.tree.map(lambda *x: jnp.stack(x), *cameras)
    background = jnp.array(BACKGROUND)

    def loss(gaussians, camera):
        image = render(gaussians, camera, background=background)
        return jnp.sum(image.colour**2) + jnp.sum(image.depth * image.alpha)

    both = jax.value_and_grad(loss, argnums=(0, 1))
    launches = []
    build = splat_launch.build_lists
    monkeypatch.setattr(splat_launch, "build_lists", lambda *a: launches.append(a[2]) or build(*a))
    nested = jax.jit(jax.vmap(jax.vmap(both, (None, 0)), (0, None)), compiler_options=QUICK)(many_scenes, many_cameras)
    assert launches == [6, 6]  # one forward and one backward over all six images
    single = jax.jit(both, compiler_options=QUICK)
    looped = [[single(scene, camera) for camera in cameras] for scene in scenes]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *[jax.tree.map(lambda *x: jnp.stack(x), *row) for row in looped])
    scanned = jax.jit(
        lambda s, c: jax.lax.scan(lambda _, one: (None, both(s, one)), None, c)[1], compiler_options=QUICK
    )
    for a, b in zip(jax.tree.leaves(nested), jax.tree.leaves(stacked), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-4 * float(jnp.abs(b).max()))
    for a, b in zip(jax.tree.leaves(scanned(scenes[0], many_cameras)), jax.tree.leaves(nested), strict=True):
        np.testing.assert_allclose(a, b[0], rtol=1e-4, atol=1e-4 * float(jnp.abs(b).max()))
    expanded = jax.tree.map(lambda x: x[:, None], many_scenes)
    batch = drawing()(expanded, many_cameras, background=background)
    assert batch.colour.shape == (2, 3, 36, 44, 3) and batch.dropped.shape == (2, 3)
    alone = drawing()(scenes[1], cameras[2], background=background)
    np.testing.assert_allclose(batch.colour[1, 2], alone.colour, atol=1e-5)


def test_single_pixel_strips_as_a_gpu_takes_them_agree(monkeypatch):
    """The kernels' other shape, run on the CPU: one pixel a thread instead of a tile row."""
    gaussians, camera = make_gaussians(10, count=150, dtype=np.float32), make_camera(dtype=np.float32)

    def loss(gaussians):
        image = render(gaussians, camera, background=jnp.array(BACKGROUND))
        return jnp.sum(image.colour**2) + jnp.sum(image.depth), image

    run = jax.jit(jax.value_and_grad(loss, has_aux=True), compiler_options=QUICK)
    rows = jax.tree.map(np.asarray, run(gaussians))
    monkeypatch.setattr(splat_launch, "_kernels", lambda real, device: (blending_kernels(real, 1), 256))
    pixels = jax.tree.map(np.asarray, run(gaussians))
    for a, b in zip(jax.tree.leaves(pixels), jax.tree.leaves(rows), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-4 * np.abs(b).max())
    np.testing.assert_array_equal(pixels[0][1].colour, rows[0][1].colour)


def test_single_precision_repeats_bit_for_bit_on_any_number_of_threads():
    gaussians = make_gaussians(8, count=400, dtype=np.float32)
    camera = make_camera(dtype=np.float32, size=(90, 70))

    @functools.partial(jax.jit, compiler_options=QUICK)
    def run(gaussians):
        def loss(gaussians):
            image = render(gaussians, camera, background=jnp.array(BACKGROUND))
            return jnp.sum(image.colour**2) + jnp.sum(image.depth), image

        return jax.value_and_grad(loss, has_aux=True)(gaussians)

    first = jax.tree.map(np.asarray, run(gaussians))
    for threads in (1, 2, 2, 3):
        with worker_threads(threads):
            again = jax.tree.map(np.asarray, run(gaussians))
        for a, b in zip(jax.tree.leaves(first), jax.tree.leaves(again), strict=True):
            assert a.tobytes() == b.tobytes()
