"""The splatter and its plain-JAX twin against scenes made by three independent programs in double precision."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels.splat import blend as kernel
from kernels.splat import reference
from kernels.splat.projection import Shape, project, usable

SCENES = (
    "01_single",
    "02_two_overlap",
    "03_random_aniso",
    "04_nonsquare_offcentre",
    "05_near_behind_outside",
    "06_elongated",
    "07_opaque_stop",
    "08_subpixel",
    "09_empty",
    "10_tied_depths",
    "11_offcentre_clamped",
)
INPUTS = ("means", "quats", "scales", "opacities", "colors", "K", "world_to_cam", "background")
GRADIENTS = ("means", "quats", "scales", "opacities", "colors", "world_to_cam")
PADDED = 300
MODULES = {"kernel": kernel, "reference": reference}


@functools.cache
def compiled(name: str, width: int, height: int, rules: str = "inria"):
    """(arguments, weights) -> (gradients, images), compiled once for all scenes of one size."""
    shape = Shape(width=width, height=height, near=0.2, rules=rules, antialias=False)

    def loss(arguments, weights):
        images = MODULES[name].splat(*arguments, shape=shape)[:3]
        return sum(jnp.sum(w * image) for w, image in zip(weights, images, strict=True)), images

    # Little optimisation: compiling is most of this file's time.
    return jax.jit(jax.grad(loss, has_aux=True), compiler_options={"xla_backend_optimization_level": 0})


def load(shared, scene: str, dtype):
    """A scene's file and its arguments, padded with transparent Gaussians so that sizes repeat (not the empty one)."""
    data = np.load(shared / "golden" / "splat" / f"{scene}.npz")
    arguments = [np.asarray(data[name], dtype) for name in INPUTS]
    if len(data["means"]):
        rows = PADDED - len(data["means"])
        arguments[:5] = [np.pad(x, [(0, rows)] + [(0, 0)] * (x.ndim - 1)) for x in arguments[:5]]
    weights = tuple(np.asarray(data[f"loss_w_{name}"], dtype) for name in ("color", "depth", "alpha"))
    return data, tuple(arguments), weights


def check(data, result, forward_limit: float, gradient_limit: float) -> None:
    gradients, images = result
    solid = ~data["fragile"]
    for image, name in zip(images, ("color", "depth", "alpha"), strict=True):
        np.testing.assert_allclose(np.asarray(image)[solid], data[f"out_{name}"][solid], rtol=0, atol=forward_limit)
        np.testing.assert_allclose(image, data[f"out_{name}"], rtol=0, atol=0.02)
    count = len(data["means"])
    for gradient, name in zip((*gradients[:5], gradients[6]), GRADIENTS, strict=True):
        expected = data[f"grad_{name}"]
        got = np.asarray(gradient)[: 3 if name == "world_to_cam" else count]
        difference = np.linalg.norm(got - expected) / max(np.linalg.norm(expected), 1e-30)
        assert got.shape == expected.shape and difference <= gradient_limit, f"{name}: relative error {difference:.2e}"


@pytest.mark.parametrize("scene", SCENES)
def test_kernel_in_single_precision(shared, scene):
    data, arguments, weights = load(shared, scene, np.float32)
    run = compiled("kernel", int(data["width"]), int(data["height"]))
    forward_limit, gradient_limit = (5e-4, 1e-3) if scene == "06_elongated" else (2e-5, 2e-5)
    check(data, run(arguments, weights), forward_limit, gradient_limit)


@pytest.mark.parametrize("name", ["kernel", "reference"])
@pytest.mark.parametrize("scene", SCENES)
def test_double_precision(shared, scene, name, x64):
    data, arguments, weights = load(shared, scene, np.float64)
    run = compiled(name, int(data["width"]), int(data["height"]))
    check(data, run(arguments, weights), 1e-11, 1e-11)


@pytest.mark.parametrize("scene", ["03_random_aniso", "05_near_behind_outside", "11_offcentre_clamped"])
def test_projection_in_the_middle(shared, scene, x64):
    """Screen-space quantities, so that two errors cannot cancel in the image."""
    data, arguments, _ = load(shared, scene, np.float64)
    mean, quaternion, scale, opacity, colour, K, camera_from_world, _ = map(jnp.asarray, arguments)
    shape = Shape(int(data["width"]), int(data["height"]), 0.2, "inria", False)
    finite = usable(mean, quaternion, scale, opacity, colour)
    splats = jax.jit(project, static_argnames="shape")(
        mean, quaternion, scale, opacity, K, camera_from_world, finite, shape=shape
    )
    drawn = data["mid_visible"]
    splats = jax.tree.map(lambda x: np.asarray(x)[: len(drawn)], splats)
    np.testing.assert_array_equal(np.all(splats.rectangle[:, 2:] > splats.rectangle[:, :2], axis=1), drawn)
    np.testing.assert_array_equal(splats.rectangle[drawn], data["mid_tile_rect"][drawn])
    np.testing.assert_allclose(splats.centre[drawn], data["mid_mean2d"][drawn], atol=1e-11)
    np.testing.assert_allclose(splats.conic[drawn], data["mid_conic"][drawn], atol=1e-11)
    np.testing.assert_allclose(splats.depth[drawn], data["mid_depth"][drawn], atol=1e-12)


def test_a_wrong_rule_fails_the_same_check(shared):
    """Negative control: the other rule set (0.999 clamp, elliptic extent) must not pass the golden check."""
    data, arguments, weights = load(shared, "07_opaque_stop", np.float32)
    run = compiled("kernel", int(data["width"]), int(data["height"]), "gsplat")
    with pytest.raises(AssertionError):
        check(data, run(arguments, weights), 2e-5, 2e-5)
