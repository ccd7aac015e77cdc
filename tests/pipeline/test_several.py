"""Every track of a recording with its own answer."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from support.networks import HEIGHT, WIDTH, mask_of, network

from aerojax.classify.base import untrained
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.types import FrameSet
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.several import classify_tracks
from aerojax.pipeline.step import make_pipeline
from aerojax.pipeline.trust import TrustConfig
from aerojax.reconstruct.hull import HullConfig
from aerojax.segment.instances import InstancesConfig
from aerojax.track.several import SeveralConfig

SMALL = PipelineConfig(
    segment=InstancesConfig(),
    track=SeveralConfig(),
    reconstruct=HullConfig(grid=32, capacity=512),
    crop_size=64,
    decimation=DecimationConfig(512, 96, 64),
)
NETWORK = MambaSplatConfig(d_model=32, depth=1, mamba_layers=2, scale_normalisation="running")
PLACES = np.array([[0.55, 0.3, 0.1], [-0.55, -0.3, -0.1]])


def frame_of(cameras, frame: int) -> FrameSet:
    """Two ellipsoids, the second one from frame 2 on."""
    masks = []
    for camera in cameras:
        ids = np.zeros((HEIGHT, WIDTH), np.uint16)
        for number, place in enumerate(PLACES[: 1 + (frame >= 2)]):
            ids[mask_of(camera, place)] = 7 + number
        masks.append(ids)
    images = tuple(np.full((HEIGHT, WIDTH, 3), 0.5, np.float32) for _ in cameras)
    return FrameSet(frame, frame / 30, images, tuple(masks))


def test_each_track_has_an_answer_and_a_place():
    cameras = network()
    classifier = untrained(NETWORK, tokens=32, frames=8, key=jax.random.key(1))
    pipeline = make_pipeline(cameras, SMALL, classifier, key=jax.random.key(0))
    found = classify_tracks(pipeline, (frame_of(cameras, frame) for frame in range(7)), trust=TrustConfig())
    assert [one.numbers.tolist() for one in found.moments] == [[], [], [0], [0], [0, 1], [0, 1], [0, 1]]
    np.testing.assert_allclose(found.moments[-1].places, PLACES, atol=0.05)
    assert {number: one.frames for number, one in found.answers.items()} == {0: 5, 1: 3}
    for one in found.answers.values():
        assert np.exp(one.log_probabilities).sum() == pytest.approx(1.0, abs=1e-5)
        assert one.verdict.status in ("ok", "unsure") and one.label in ("bird", "drone", "airplane", "helicopter")
