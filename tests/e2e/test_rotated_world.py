"""The answer does not depend on how the world is placed: rotated captures, through files, from images to label."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aerojax.capture.format import Capture, read_capture, rotate_world, write_capture_json
from aerojax.capture.paths import frame_path
from aerojax.classify.base import Classifier, with_card
from aerojax.classify.load import load_classifier
from aerojax.core.types import Evidence, Gaussians
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.gaussians.rotate import covariance, rotate
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import Clip, reconstruct_capture
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.plan.planner import SequenceConfig
from aerojax.simulate.sample import simulate_sequence
from aerojax.simulate.world.random_rigs import RandomRigConfig

FRAMES, TOKENS = 6, 128
CONFIG = PipelineConfig(decimation=DecimationConfig(draw=8192, farthest=300, keep=256))
RIG = RandomRigConfig(cameras=4, width=400, height=300, span_px=(80.0, 90.0), distance=(12.0, 14.0))
TURNS = Rotation.random(2, random_state=7).as_matrix()


@pytest.fixture(scope="module")
def classifier() -> Classifier:
    """The shipped classifier of Gaussians, whose card is not asked about the smaller decimation of this test."""
    return with_card(load_classifier(Path("mambasplat")), settings=())


def shortened(capture: Capture) -> Capture:
    truth = capture.truth
    if truth is not None:
        objects = tuple(replace(o, frames=tuple(s for s in o.frames if s.frame < FRAMES)) for o in truth.objects)
        truth = replace(truth, objects=objects)
    return replace(capture, frames=min(FRAMES, capture.frames), truth=truth)


def copy_rotated(capture: Capture, turn: np.ndarray, folder: Path) -> Capture:
    """Write the capture in a turned world with the same images, and read it back."""
    for camera in capture.cameras:
        for pattern in (camera.rgb, camera.mask):
            for frame in range(capture.frames if pattern else 0):
                target = folder / frame_path(pattern, frame)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(capture.folder / frame_path(pattern, frame), target)
    bare = replace(capture, folder=folder, cameras=tuple(replace(c, depth=None) for c in capture.cameras))
    write_capture_json(rotate_world(bare, turn))
    return read_capture(folder)


def answer(capture: Capture, classifier: Classifier) -> Clip:
    return reconstruct_capture(capture, CONFIG, classifier, key=jax.random.key(0))


def check(capture: Capture, classifier: Classifier, folder: Path) -> None:
    straight = answer(capture, classifier)
    assert len(straight.frames) == capture.frames
    for index, turn in enumerate(TURNS):
        turned = answer(copy_rotated(capture, turn, folder / f"turn_{index}"), classifier)
        change = np.abs(np.exp(turned.log_probabilities) - np.exp(straight.log_probabilities)).max()
        print(f"{capture.folder.name}, turn {index}: probabilities change by {change:.2e} at most")
        assert change < 1e-3
        expected = rotate(straight.in_world(), jnp.asarray(turn, jnp.float32))
        found = turned.in_world()
        np.testing.assert_allclose(turned.position, straight.position @ turn.T, atol=1e-8)
        # Relative to where the object is and to the largest Gaussian.
        away = float(jnp.linalg.norm(expected.mean, axis=-1).max())
        np.testing.assert_allclose(found.mean, expected.mean, atol=1e-4 * away)
        largest = float(jnp.abs(covariance(expected)).max())
        np.testing.assert_allclose(covariance(found), covariance(expected), atol=1e-4 * largest)
        np.testing.assert_allclose(found.sh, expected.sh, atol=1e-3)


def test_simulated_sample(classifier, tmp_path):
    identity = identities("test", 1)[1]
    config = SequenceConfig(rigs=(RIG,), frames=FRAMES, samples=2, max_travel=0.5, depth=False)
    capture = simulate_sequence(identity, config, seed=2, folder=tmp_path / "sample", assets=tmp_path / "assets")
    check(capture, classifier, tmp_path)


def test_reference_capture(shared, classifier, tmp_path):
    folder = shared / "data/captures/bird_animalia_cardinal"
    if not folder.is_dir():
        pytest.skip(f"no capture at {folder}")
    check(shortened(read_capture(folder)), classifier, tmp_path)


@pytest.mark.long
def test_the_check_can_fail(classifier):
    """Untied from the rig, the columns of a clip turned without its quaternions change the answer."""
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(3, TOKENS, 14)).astype(np.float32)
    columns[..., 7:10] = np.exp(columns[..., 7:10])
    columns[..., 10] = 0.9
    broken = columns.copy()
    broken[..., :3] = columns[..., :3] @ TURNS[0].T.astype(np.float32)
    real = jnp.ones(3, bool)
    here, there = (classifier.clip(Evidence(Gaussians.from_columns(jnp.asarray(c))), real) for c in (columns, broken))
    assert float(jnp.abs(jnp.exp(here) - jnp.exp(there)).max()) > 1e-5
