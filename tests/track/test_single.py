"""One object: where it is, how fast, and how sure that is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.networks import FOCAL, frame_sets, network, position_at

from aerojax.core.types import FrameSet, Silhouette
from aerojax.segment.given import GivenConfig
from aerojax.track.single import SingleConfig, triangulate


def centred(camera: int, pixel: np.ndarray, *, whole: bool = True) -> Silhouette:
    """A silhouette whose box has this centre."""
    x, y = pixel
    return Silhouette(camera, 1, np.zeros((2, 2), np.float32), (x - 4, y - 4, x + 4, y + 4), whole)


def pixel_of(camera, point: np.ndarray) -> np.ndarray:
    inside = np.linalg.inv(camera.world_from_cam) @ [*point, 1.0]
    return (camera.K @ (inside[:3] / inside[2]))[:2]


def test_rays_through_exact_pixels_meet_at_the_point():
    cameras, point = network(4), np.array([0.3, -0.2, 0.4])
    seen = [centred(i, pixel_of(c, point)) for i, c in enumerate(cameras)]
    position, _ = triangulate(seen, cameras, 1.0)
    np.testing.assert_allclose(position, point, atol=1e-9)


def test_the_covariance_is_that_of_noisy_pixels():
    cameras, point, rng = network(4), np.array([0.1, 0.2, 0.0]), np.random.default_rng(0)
    exact = [pixel_of(c, point) for c in cameras]
    drawn = []
    for _ in range(4000):
        noisy = [centred(i, p + rng.normal(size=2)) for i, p in enumerate(exact)]
        drawn.append(triangulate(noisy, cameras, 1.0)[0])
    _, covariance = triangulate([centred(i, p) for i, p in enumerate(exact)], cameras, 1.0)
    np.testing.assert_allclose(np.cov(np.array(drawn).T), covariance, atol=0.12 * covariance.max())
    assert np.sqrt(covariance[0, 0]) == pytest.approx(5 / FOCAL / np.sqrt(3), rel=0.4)  # depth over focal, 2 of 3 axes


def test_cut_silhouettes_and_single_rays_give_no_position():
    cameras, point = network(3), np.zeros(3)
    seen = [centred(i, pixel_of(c, point), whole=i == 0) for i, c in enumerate(cameras)]
    assert triangulate(seen, cameras, 1.0) is None
    twin = (cameras[0], replace(cameras[0], name="twin"))
    assert triangulate([centred(0, pixel_of(cameras[0], point)), centred(1, np.array([80.0, 60.0]))], twin, 1.0) is None


def test_velocity_comes_with_the_second_frame():
    cameras = network(4)
    segmenter, tracker = GivenConfig().build(3), SingleConfig().build()
    state, tracks = tracker.initial(cameras), []
    for frames in frame_sets(cameras, range(3)):
        found, state = tracker.step(frames, segmenter.step(frames, 3)[0], state)
        tracks += found
    assert [one.number for one in tracks] == [0, 0, 0] and tracks[0].velocity is None
    expected = 30 * (position_at(2) - position_at(1))
    np.testing.assert_allclose(tracks[2].velocity, expected, atol=0.6)  # half a pixel is a centimetre
    nothing, after = tracker.step(FrameSet(3, 0.1, (None,) * 4, (None,) * 4), [], state)
    assert nothing == [] and after is state
