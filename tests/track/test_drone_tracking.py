"""The layout of the public drone data sets becomes a track, its cameras' clocks as they are said to be."""

from __future__ import annotations

import numpy as np
from support.calibration_files import write_drone_tracking
from support.networks import network

from aerojax.track.drone_tracking import is_drone_tracking, read_drone_tracking
from aerojax.track.following import FollowingConfig
from aerojax.track.offline import follow


def test_a_recording_becomes_its_own_track(tmp_path):
    times = np.arange(60) / 30
    path = np.stack([0.8 * np.cos(times), 0.7 * np.sin(1.3 * times), 0.4 * np.sin(2 * times)], axis=1)
    write_drone_tracking(network(4), tmp_path / "drone", path, starts=[0.0, 3.5, -2.25, 7.0])
    assert is_drone_tracking(tmp_path / "drone") and not is_drone_tracking(tmp_path)
    cameras, detections = read_drone_tracking(tmp_path / "drone")
    assert [c.name for c in cameras] == ["cam_01", "cam_02", "cam_03", "cam_04"] and len(detections.camera) == 240
    done = follow(detections, cameras, FollowingConfig())
    (number, (found_s, places)), *others = done.paths().items()
    assert number == 0 and not others and len(found_s) == 60
    truth = np.stack([np.interp(found_s - found_s[0], times, axis) for axis in path.T], axis=1)
    assert np.linalg.norm(places - truth, axis=1)[5:].max() < 0.05
