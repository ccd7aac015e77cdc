"""The splatter and its twin against stored scenes of a NumPy implementation that shares no code with them."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_numpy import CONSTANT, FOLDER, INPUTS, SCENES, draw, loss_weights
from support.splat_scenes import QUICK

from kernels.splat import blend as kernel
from kernels.splat import reference
from kernels.splat.projection import Shape, project, usable

MODULES = {"kernel": kernel, "twin": reference}


@functools.cache
def stored(name: str) -> dict[str, np.ndarray]:
    with np.load(FOLDER / f"{name}.npz") as data:
        return dict(data)


def shape_of(data, **changes) -> Shape:
    settings = {"rules": str(data["rules"]), "antialias": bool(data["antialias"])} | changes
    return Shape(int(data["width"]), int(data["height"]), 0.2, **settings)


@functools.cache
def compiled(member: str, shape: Shape):
    """(inputs, weights) -> (gradients, image)."""

    def loss(inputs, weights):
        colour, depth, alpha, _ = MODULES[member].splat(*inputs, shape=shape)
        image = jnp.concatenate([colour, depth[..., None], alpha[..., None]], axis=-1)
        return jnp.sum(weights * image), image

    return jax.jit(jax.grad(loss, has_aux=True), compiler_options=QUICK)


def run(member: str, data, dtype, **changes):
    """Image, and gradients by name without the matrices' constants."""
    inputs = tuple(jnp.asarray(data[key], dtype) for key in INPUTS)
    weights = jnp.asarray(loss_weights(data["fragile"]), dtype)
    slopes, image = compiled(member, shape_of(data, **changes))(inputs, weights)
    gradients = {key: np.array(slope) for key, slope in zip(INPUTS, slopes, strict=True)}
    for key, places in CONSTANT.items():
        gradients[key][tuple(zip(*places, strict=True))] = 0
    return np.asarray(image), gradients


def off_by(image, data) -> float:
    return float(np.abs(image - data["image"])[~data["fragile"]].max())


@pytest.mark.parametrize("name", SCENES)
def test_the_files_are_what_the_program_makes(name):
    """Inputs and images; a file that was changed by hand, or a program that no longer says what it said, shows here."""
    data, scene = stored(name), SCENES[name]
    for key in INPUTS:
        np.testing.assert_allclose(data[key], scene.inputs[key], rtol=1e-12, atol=1e-12)
    drawn = draw(scene)
    np.testing.assert_allclose(data["image"], drawn.image, atol=1e-12)
    np.testing.assert_array_equal(data["tiles"], drawn.tiles)


@pytest.mark.parametrize("member", MODULES)
@pytest.mark.parametrize("name", SCENES)
def test_double_precision(x64, name, member):
    data = stored(name)
    image, gradients = run(member, data, np.float64)
    assert off_by(image, data) <= 1e-11
    for key, slope in gradients.items():
        expected = data[f"gradient_{key}"]
        assert np.linalg.norm(slope - expected) <= 1e-6 * np.linalg.norm(expected), key


@pytest.mark.parametrize("name", SCENES)
def test_kernel_in_single_precision(name):
    data = stored(name)
    image, gradients = run("kernel", data, np.float32)
    assert off_by(image, data) <= 2e-5
    for key, slope in gradients.items():
        expected = data[f"gradient_{key}"]
        cosine = np.sum(slope * expected) / (np.linalg.norm(slope) * np.linalg.norm(expected))
        assert cosine >= 0.9999, (key, cosine)


@pytest.mark.parametrize("name", SCENES)
def test_tiles(x64, name):
    data = stored(name)
    mean, quaternion, scale, opacity, colour, K, camera_from_world, _ = (jnp.asarray(data[key]) for key in INPUTS)
    finite = usable(mean, quaternion, scale, opacity, colour)
    splats = jax.jit(project, static_argnames="shape")(
        mean, quaternion, scale, opacity, K, camera_from_world, finite, shape=shape_of(data)
    )
    listed = np.all(data["tiles"][:, 2:] > data["tiles"][:, :2], axis=1)
    np.testing.assert_array_equal(splats.rectangle, np.where(listed[:, None], data["tiles"], 0))


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("inria_opaque", {"rules": "gsplat"}),
        ("gsplat_wide", {"rules": "inria"}),
        ("gsplat_small", {"antialias": False}),
    ],
)
def test_another_rule_fails_the_same_check(x64, name, changes):
    """Negative control: the scenes tell the rules apart."""
    data = stored(name)
    image, _ = run("twin", data, np.float64, **changes)
    assert off_by(image, data) > 1e-4
