"""What all rigs share: the monitored volume, and who sees what."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.world.fixed_rigs import Condition, FixedRigConfig, place_cameras
from aerojax.simulate.world.rigs import Volume, cameras_that_see


def test_cameras_that_see_counts_whole_balls():
    rig = FixedRigConfig("sphere", 4, 200, 100, 100.0, radii=(10.0,))
    cameras = place_cameras(rig, Condition("", 10.0, 0.0))
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 4.0], [0.0, 0.0, 4.6], [-60.0, 0.0, 0.0]])
    # At 10 m half the height is 5 m; from 70 m everything near the axis is in sight of the one camera that faces it.
    assert cameras_that_see(points, cameras, 0.5).tolist() == [4, 4, 0, 1]


def test_a_volume_holds_its_border():
    volume = Volume((0.0, 0.0, 1.0), (2.0, 2.0, 3.0))
    assert volume.contains(np.array([[0.0, 2.0, 1.0], [1.0, 1.0, 3.0]]))
    assert not volume.contains(np.array([[1.0, 1.0, 2.0], [1.0, 1.0, 3.01]]))
