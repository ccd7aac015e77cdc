"""What is wrong with clocks and poses: values, the cameras that they make, and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from aerojax.track.sights import TimedCamera, Vector

CLOCK, TURN, SHIFT = slice(0, 3), slice(3, 6), slice(6, 9)
OFFSET_RATE, LINE = slice(0, 2), 2
"""Places of the unknowns of a camera: offset, rate, line delay; rotation; position."""
UNKNOWNS = 9


@dataclass(frozen=True, eq=False)
class Correction:
    """What to change of one camera, and how well that is known (standard deviations, `sigma`, in the same order).

    offset_s, rate, line_delay_s: are added to the camera's.
    rotation: a rotation vector in the camera's own axes, radians: R' = R exp(rotation).
    position: is added to the camera's centre, metres, world.
    sigma: nine of them; 0 where the value was not looked for.
    """

    offset_s: float
    rate: float
    line_delay_s: float
    rotation: Vector
    position: Vector
    sigma: Float64[np.ndarray, "9"]

    @staticmethod
    def of(values: Float64[np.ndarray, "9"], sigma: Float64[np.ndarray, "9"]) -> Correction:
        """From the unknowns in their order."""
        offset, rate, line = (float(v) for v in values[CLOCK])
        return Correction(offset, rate, line, values[TURN], values[SHIFT], sigma)

    @property
    def angle_deg(self) -> float:
        """Of the rotation."""
        return float(np.degrees(np.linalg.norm(self.rotation)))

    @property
    def distance_m(self) -> float:
        """By which the camera moves."""
        return float(np.linalg.norm(self.position))

    def values(self) -> Float64[np.ndarray, "9"]:
        """The unknowns in their order."""
        return np.concatenate([[self.offset_s, self.rate, self.line_delay_s], self.rotation, self.position])


def corrected(camera: TimedCamera, correction: Correction) -> TimedCamera:
    """The camera as it is found to be."""
    pose = camera.world_from_cam.copy()
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(correction.rotation).as_matrix()
    pose[:3, 3] += correction.position
    return replace(
        camera,
        world_from_cam=pose,
        time_offset_s=camera.time_offset_s + correction.offset_s,
        clock_rate=camera.clock_rate + correction.rate,
        line_delay_s=camera.line_delay_s + correction.line_delay_s,
    )


def difference(before: TimedCamera, after: TimedCamera, sigma: Float64[np.ndarray, "9"]) -> Correction:
    """The correction that makes one camera the other."""
    turn = Rotation.from_matrix(before.world_from_cam[:3, :3].T @ after.world_from_cam[:3, :3]).as_rotvec()
    return Correction(
        after.time_offset_s - before.time_offset_s,
        after.clock_rate - before.clock_rate,
        after.line_delay_s - before.line_delay_s,
        turn,
        after.world_from_cam[:3, 3] - before.world_from_cam[:3, 3],
        sigma,
    )


def corrections_to_json(cameras: Sequence[TimedCamera], corrections: Sequence[Correction]) -> list[dict[str, Any]]:
    """JSON-ready, with the cameras' names."""
    return [_to_json(camera.name, one) for camera, one in zip(cameras, corrections, strict=True)]


def _to_json(name: str, one: Correction) -> dict[str, Any]:
    sigma = one.sigma.tolist()
    return {
        "camera": name,
        "time_offset_s": one.offset_s,
        "clock_rate": one.rate,
        "line_delay_s": one.line_delay_s,
        "rotation_deg": np.degrees(one.rotation).tolist(),
        "position_m": one.position.tolist(),
        "sigma": {
            "time_offset_s": sigma[0],
            "clock_rate": sigma[1],
            "line_delay_s": sigma[2],
            "rotation_deg": np.degrees(sigma[3:6]).tolist(),
            "position_m": sigma[6:9],
        },
    }
