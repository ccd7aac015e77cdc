"""Detectors: which box the maps say, sizes that fit, weights that come back, and labels that are counted."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.classify.images.detector import STRIDE, Detector, DetectorConfig, Maps, most_certain
from aerojax.classify.images.votes import cast_labels
from aerojax.classify.images.weights import load_detector, save_detector
from aerojax.core.errors import UserError
from aerojax.core.tensors import parameter_count, write_tensors

TINY = DetectorConfig(frames=1, height=32, width=48, channels=4)


def test_the_box_of_the_highest_heat():
    heat = jnp.full((4, 6, 4), -5.0).at[2, 3, 1].set(1.0).at[0, 0, 2].set(0.5)
    offset = jnp.zeros((4, 6, 2)).at[2, 3].set(jnp.array([0.25, 0.5]))
    extent = jnp.zeros((4, 6, 2)).at[2, 3].set(jnp.log(jnp.array([2.0, 0.5])))
    found = jax.jit(most_certain)(Maps(heat, offset, extent))
    x, y = STRIDE * 3.25, STRIDE * 2.5
    np.testing.assert_allclose(found.box, [x - STRIDE, y - STRIDE / 4, x + STRIDE, y + STRIDE / 4], rtol=1e-5)
    assert found.label == 1 and found.confidence == pytest.approx(1 / (1 + np.exp(-1.0)), rel=1e-5)


@pytest.mark.parametrize("frames", [1, 5])
def test_maps_have_a_place_every_stride_and_begin_with_the_prior(frames):
    config = DetectorConfig(frames=frames)
    shapes = jax.eval_shape(lambda key: Detector(config, key=key), jax.random.key(0))
    images = jax.ShapeDtypeStruct((frames, config.height, config.width, 3), jnp.float32)
    maps = jax.eval_shape(lambda detector, images: detector(images), shapes, images)
    assert maps.heat.shape == (config.height // STRIDE, config.width // STRIDE, 4)
    assert parameter_count(shapes) == {1: 107_792, 5: 149_264}[frames]
    detector = Detector(TINY, key=jax.random.key(0))
    np.testing.assert_allclose(jax.nn.sigmoid(detector.out.bias[:4]), 0.01, rtol=1e-4)


def test_weights_come_back(tmp_path):
    detector = Detector(TINY, key=jax.random.key(1))
    save_detector(tmp_path / "weights.safetensors", detector, TINY)
    again, config = load_detector(tmp_path / "weights.safetensors")
    assert config == TINY
    jax.tree.map(np.testing.assert_array_equal, jax.tree.leaves(again), jax.tree.leaves(detector))
    write_tensors(tmp_path / "other.safetensors", detector, {})
    with pytest.raises(UserError, match="holds no detector"):
        load_detector(tmp_path / "other.safetensors")


@pytest.mark.parametrize("changes", [{"height": 40}, {"width": 100}, {"frames": 0}])
def test_sizes_that_cannot_be_are_refused(changes):
    with pytest.raises(UserError, match=next(iter(changes))):
        DetectorConfig(**changes)


def test_labels_are_counted_in_groups():
    label, group = jnp.array([0, 0, 2, 1, 1]), jnp.array([0, 0, 0, 1, 2])
    confidence = jnp.array([0.1, 0.2, 0.9, 0.5, 0.5])
    counts = jnp.array([True, True, True, True, False])
    ballot = cast_labels(label, confidence, counts, group, groups=3, classes=3)
    np.testing.assert_array_equal(ballot.votes, [[2, 0, 1], [0, 1, 0], [0, 0, 0]])
    np.testing.assert_allclose(ballot.confidence, [[0.3, 0, 0.9], [0, 0.5, 0], [0, 0, 0]], rtol=1e-6)
