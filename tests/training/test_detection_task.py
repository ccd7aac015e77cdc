"""Detectors learn: targets and loss by hand, variation that keeps box and image together, squares that are found."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.classify.images.detector import Detector, DetectorConfig, Maps, most_certain
from aerojax.data.frame_images import FrameImages
from aerojax.training.loop import Fit, TrainingConfig, fit
from aerojax.training.optimisers import OptimiserConfig
from aerojax.training.tasks.detection import (
    DetectionLossConfig,
    DetectionTask,
    detection_loss,
    heat_target,
    in_box,
    vary_image,
)

PLAIN = DetectionLossConfig(colour=0.0)


def test_targets_peak_in_the_place_of_the_middle():
    heat, place = heat_target(jnp.array([16.0, 4.0, 40.0, 12.0]), (4, 6), 8.0)
    np.testing.assert_array_equal(place, [1, 3])  # the middle (28, 8) in strides: column 3.5, row 1
    assert heat[1, 3] == 1.0 and jnp.sum(heat == 1.0) == 1
    np.testing.assert_allclose(heat[1, 4], np.exp(-1 / (2 * 0.5**2)), rtol=1e-5)


def test_the_loss_by_hand():
    maps = Maps(jnp.zeros((2, 2, 2)), jnp.zeros((2, 2, 2)), jnp.zeros((2, 2, 2)))
    box, label = jnp.array([2.0, 2.0, 10.0, 6.0]), jnp.array(1)
    loss = lambda seen: detection_loss(maps, box, jnp.asarray(seen), label, 8.0, PLAIN)  # noqa: E731
    background = 0.25 * np.log(2)  # a place of heat 1/2 without an object
    np.testing.assert_allclose(loss(False), 8 * background, rtol=1e-5)
    target = np.exp(-np.array([[0, 1], [1, 2]]) / (2 * 0.5**2))
    near = ((1 - target) ** 4 * background).sum()  # of the right class, the middle's own place left out
    expected = 0.25 * np.log(2) + near + 4 * background + (0.75 + 0.5) + 0.1 * np.log(2)
    np.testing.assert_allclose(loss(True), expected, rtol=1e-5)


def test_boxes_are_mirrored_with_their_images():
    images = np.zeros((1, 16, 32, 3), np.float32)
    images[:, 4:8, 2:10] = 1.0
    seen = set()
    for seed in range(8):
        varied, box = vary_image(jnp.asarray(images), jnp.array([2.0, 4.0, 10.0, 8.0]), PLAIN, key=jax.random.key(seed))
        box, columns = np.asarray(box), np.flatnonzero(np.asarray(varied)[0, 5, :, 0])
        assert (columns[0], columns[-1] + 1) == (box[0], box[2])
        seen.add(float(box[0]))
    assert seen == {2.0, 22.0}


def test_found_means_the_middle_in_the_box():
    true = np.array([[10, 10, 20, 14]] * 3, np.float32)
    found = np.array([[0, 0, 28, 26], [30, 8, 40, 12], [18, 13, 22, 16]], np.float32)
    np.testing.assert_array_equal(in_box(found, true), [True, False, True])


def squares(count: int) -> FrameImages:
    """Bright squares of four colours, one a class, anywhere before noise; the last image shows nothing."""
    rng = np.random.default_rng(0)
    images = rng.integers(60, 90, (count, 1, 32, 48, 3)).astype(np.uint8)
    box, label = np.zeros((count, 4), np.float32), np.arange(count) % 4
    colours = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]])
    for index in range(count - 1):
        x, y = rng.integers(2, 34), rng.integers(2, 18)
        box[index] = x, y, x + 10, y + 10
        images[index, 0, y : y + 10, x : x + 10] = colours[label[index]]
    zeros = np.zeros(count, np.int64)
    seen = np.arange(count) < count - 1
    return FrameImages(images, box, seen, label, zeros, zeros, zeros, np.full(count, 10, np.float32))


@pytest.mark.long
def test_squares_are_found_and_told_apart(tmp_path):
    images = squares(16)
    training = TrainingConfig(
        epochs=60, batch=8, average=0.5, optimiser=OptimiserConfig(learning_rate=1e-2), checkpoint_steps=0
    )
    task = DetectionTask(images, images, training, 0, most_certain, PLAIN)
    detector = Detector(DetectorConfig(height=32, width=48, channels=8), key=jax.random.key(0))
    before = task.validate(detector)
    rows: list[dict[str, float]] = []
    todo = Fit(task.loss, task.batches, task.steps_per_epoch, task.validate, report=rows.append)
    after = task.validate(fit(detector, todo, training, seed=0, directory=tmp_path))
    assert rows[-1]["loss"] < 0.3 * rows[0]["loss"]
    assert before["accuracy"] < 0.6 < 0.85 < after["accuracy"] and after["found"] > 0.9
