"""Perceptual distances: names, zero for equal images, growing with damage, and what their files must hold."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save_file

from aerojax.core.errors import UserError
from aerojax.core.torch_files import read_torch
from aerojax.evaluate.perceptual import (
    DISTANCES,
    SCALE,
    SHIFT,
    TRUNKS,
    PerceptualConfig,
    _blurred,
    _Conv,
    _packed,
    load_perceptual,
)

WIDTHS = {"stlpips-alex": (64, 192, 384, 256, 256), "lpips-alex": (64, 192, 384, 256, 256)}
WIDTHS["lpips-vgg"] = (64, 128, 256, 512, 512)
SIDES = {"slice1.0": 11, "slice2.5": 5, "slice2.3": 5}


def module(name: str) -> dict[str, np.ndarray]:
    """Random parameters of a published module."""
    rng, found, inputs = np.random.default_rng(0), {}, 3
    for depth, (layers, width) in enumerate(zip(TRUNKS[name], WIDTHS[name], strict=True)):
        found[f"lin{depth}.model.1.weight"] = rng.uniform(0, 1, (1, width, 1, 1)).astype(np.float32)
        for layer in layers:
            if isinstance(layer, _Conv):
                side = SIDES.get(layer.name, 3) if "vgg" not in name else 3
                weight = rng.normal(size=(width, inputs, side, side)) / np.sqrt(inputs * side * side)
                found[f"net.{layer.name}.weight"] = weight.astype(np.float32)
                found[f"net.{layer.name}.bias"] = np.zeros(width, np.float32)
                inputs = width
    return found


@pytest.mark.long
@pytest.mark.parametrize("name", DISTANCES)
def test_equal_images_are_at_no_distance_and_damage_adds_to_it(tmp_path, name):
    save_file(module(name), tmp_path / "w.safetensors")
    distance = load_perceptual(PerceptualConfig(name, tmp_path / "w.safetensors"))
    image = jax.random.uniform(jax.random.key(0), (2, 40, 40, 3))
    noise = jax.random.normal(jax.random.key(1), image.shape)
    assert distance.name == name and distance(image, image).shape == (2,)
    zero, little, much = (distance(image, image + s * noise) for s in (0.0, 0.05, 0.3))
    np.testing.assert_array_equal(zero, 0.0)
    assert (little > 0).all() and (much > little).all()
    assert np.isfinite(jax.grad(lambda x: distance(x, image).sum())(image)).all()


def test_the_low_pass_keeps_what_is_even_and_halves():
    even = _blurred(jnp.full((1, 9, 12, 2), 0.7))
    assert even.shape == (1, 6, 7, 2)
    np.testing.assert_allclose(even, 0.7, rtol=1e-6)
    spike = _blurred(jnp.zeros((1, 8, 8, 1)).at[0, 4, 4, 0].set(1.0))
    np.testing.assert_allclose(spike.sum(), 0.25, rtol=1e-6)


def test_weights_that_are_not_there_are_asked_for(tmp_path):
    assert load_perceptual(PerceptualConfig()) is None
    for config, code in (
        (PerceptualConfig("lpips-vgg"), "unavailable"),
        (PerceptualConfig("lpips-alex", tmp_path / "absent.pth"), "missing"),
    ):
        with pytest.raises(UserError) as error:
            load_perceptual(config)
        assert error.value.code == code
    save_file(module("lpips-alex"), tmp_path / "w.safetensors")
    with pytest.raises(UserError, match=r"no stlpips-alex: it lacks net\.slice2\.5\.weight"):
        load_perceptual(PerceptualConfig("stlpips-alex", tmp_path / "w.safetensors"))


def test_the_packaged_weights_rank_damage():
    pytest.importorskip("stlpips_pytorch", reason="aerojax[perceptual] is not installed")
    stored = read_torch(_packed("stlpips-alex"))
    np.testing.assert_allclose(stored["net.slice1.1.filt"][5, 0], np.outer([1, 2, 1], [1, 2, 1]) / 16)
    np.testing.assert_allclose(stored["scaling_layer.shift"].ravel(), SHIFT)
    np.testing.assert_allclose(stored["scaling_layer.scale"].ravel(), SCALE)
    distance = load_perceptual(PerceptualConfig("stlpips-alex"))
    x, y = jnp.meshgrid(jnp.linspace(0, 1, 64), jnp.linspace(0, 1, 64))
    image = jnp.stack([x, y, 0.5 + 0.5 * jnp.sin(20 * x * y)], axis=-1)
    shifted, blurred = jnp.roll(image, 1, axis=1), jnp.broadcast_to(image.mean(axis=(0, 1), keepdims=True), image.shape)
    assert 0 < distance(image, shifted) < distance(image, blurred)
