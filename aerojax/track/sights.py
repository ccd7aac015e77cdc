"""What cameras saw, when and where: cameras with clocks of their own, detections, and scans on the network's clock."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.stats import chi2

from aerojax.capture.format import CalibratedCamera, CaptureCamera
from aerojax.capture.lenses import undistort_points
from aerojax.geometry.cameras import points_in_camera

Vector = Float64[np.ndarray, "3"]

UNKNOWN = -1
"""Row of a sight whose detections are not at hand: of another file, or of a run before."""


@dataclass(frozen=True, eq=False)
class TimedCamera(CalibratedCamera):
    """A calibrated camera with a clock of its own.

    What it stamps as τ in row v was there at clock_rate·τ + time_offset_s + line_delay_s·(v - height/2) on the
    network's clock: the offset is that of the middle row, so that it hardly depends on the line delay.

    clock_rate: seconds of the network that pass in one second of the camera's clock.
    line_delay_s: from one row of a rolling shutter to the next, seconds; 0 for a global one.
    """

    time_offset_s: float = 0.0
    clock_rate: float = 1.0
    line_delay_s: float = 0.0

    def network_time(
        self, stamp_s: Float64[np.ndarray, "sight"], row: Float64[np.ndarray, "sight"]
    ) -> Float64[np.ndarray, "sight"]:
        """Seconds on the network's clock at which rows (pixels of the stored image) of stamped images were exposed."""
        return self.clock_rate * stamp_s + self.time_offset_s + self.line_delay_s * (row - self.height / 2)


def timed(camera: CaptureCamera) -> TimedCamera:
    """A camera of a capture, whose shutter is global."""
    return TimedCamera(
        camera.name,
        camera.width,
        camera.height,
        camera.K,
        camera.distortion_model,
        camera.distortion,
        camera.world_from_cam,
        camera.time_offset_s,
    )


@dataclass(frozen=True)
class NoiseConfig:
    """How well detections and calibration are known; decides what may belong together.

    pixel: standard deviation of a detection, pixels.
    outline: of a box's centre about what other cameras see as the middle, in diagonals of the box.
    shape: of what all of them see as the middle about the body, as wings beat, in diagonals of the box.
    rotation_deg, position_m: standard deviations of a camera's pose, each axis.
    """

    pixel: float = 1.0
    outline: float = 0.05
    shape: float = 0.1
    rotation_deg: float = 0.02
    position_m: float = 0.02


@dataclass(frozen=True, eq=False)
class Detections:
    """Points in images, one a row, in any order.

    camera: index into the cameras. stamp_s: seconds on that camera's clock.
    pixels: in the stored image, u right, v down; the centre of the top-left pixel is (0.5, 0.5).
    diagonal: of the box whose centre it is, pixels; 0 for points.
    """

    camera: Int64[np.ndarray, "sight"]
    stamp_s: Float64[np.ndarray, "sight"]
    pixels: Float64[np.ndarray, "sight 2"]
    diagonal: Float64[np.ndarray, "sight"]

    def chosen(self, rows: np.ndarray) -> Detections:
        """Some of them, by index or mask."""
        return Detections(self.camera[rows], self.stamp_s[rows], self.pixels[rows], self.diagonal[rows])


@dataclass(frozen=True, eq=False)
class Scan:
    """What one camera saw in one image.

    camera: index. time_s: of its middle row, network's clock.
    times: of each sight. pixels: of the undistorted image. variance: of a sight's pixel without the calibration's
    share, square pixels. diagonal: of the box whose centre it is, pixels; 0 for points.
    rows: of the sights in the `Detections` that they came from, or `UNKNOWN`.
    """

    camera: int
    time_s: float
    times: Float64[np.ndarray, "sight"]
    pixels: Float64[np.ndarray, "sight 2"]
    variance: Float64[np.ndarray, "sight"]
    diagonal: Float64[np.ndarray, "sight"]
    rows: Int64[np.ndarray, "sight"]

    def chosen(self, which: np.ndarray) -> Scan:
        """With some of the sights, by index or mask."""
        return Scan(
            self.camera,
            self.time_s,
            self.times[which],
            self.pixels[which],
            self.variance[which],
            self.diagonal[which],
            self.rows[which],
        )


def network_times(detections: Detections, cameras: Sequence[TimedCamera]) -> Float64[np.ndarray, "sight"]:
    """When each detection was, seconds on the network's clock."""
    found = np.zeros(len(detections.camera))
    for index, camera in enumerate(cameras):
        own = detections.camera == index
        found[own] = camera.network_time(detections.stamp_s[own], detections.pixels[own, 1])
    return found


def undistorted(detections: Detections, cameras: Sequence[TimedCamera]) -> Float64[np.ndarray, "sight 2"]:
    """Pixels of the images without distortion."""
    found = np.zeros_like(detections.pixels)
    for index, camera in enumerate(cameras):
        own = detections.camera == index
        found[own] = undistort_points(detections.pixels[own], camera.K, camera.distortion_model, camera.distortion)
    return found


def scans_of(detections: Detections, cameras: Sequence[TimedCamera], noise: NoiseConfig) -> list[Scan]:
    """Detections by image, in the order of the network's clock; those of one moment in the order of the cameras."""
    times, pixels = network_times(detections, cameras), undistorted(detections, cameras)
    variance = noise.pixel**2 + (noise.outline * detections.diagonal) ** 2
    moments = np.array([c.clock_rate for c in cameras])[detections.camera] * detections.stamp_s
    moments += np.array([c.time_offset_s for c in cameras])[detections.camera]
    # Moments of one image are equal to the bit, being worked out from equal numbers.
    order = np.lexsort((np.arange(len(moments)), detections.camera, moments))
    if len(order) == 0:
        return []
    ordered_camera, ordered_moment = detections.camera[order], moments[order]
    begins = np.flatnonzero((np.diff(ordered_camera) != 0) | (np.diff(ordered_moment) != 0)) + 1
    return [
        Scan(
            camera=int(detections.camera[rows[0]]),
            time_s=float(moments[rows[0]]),
            times=times[rows],
            pixels=pixels[rows],
            variance=variance[rows],
            diagonal=detections.diagonal[rows],
            rows=rows,
        )
        for rows in np.split(order, begins)
    ]


def sight_of_points(
    points: Float64[np.ndarray, "*batch 3"], camera: TimedCamera
) -> tuple[Float64[np.ndarray, "*batch 2"], Float64[np.ndarray, "*batch 2 3"], Float64[np.ndarray, "*batch"]]:
    """Where a pinhole sees points (metres, world), how that changes with them, and their depths.

    The derivative of u = fx·X/Z + s·Y/Z + cx, v = fy·Y/Z + cy by the world's axes (Hartley & Zisserman 2004, §6.1).
    What lies behind the camera has no meaning in the first two; look at the depth.
    """
    rotation = camera.world_from_cam[:3, :3]
    inside = points_in_camera(points, camera)
    depth = inside[..., 2]
    safe = np.where(np.abs(depth) < 1e-6, 1e-6, depth)
    slopes = inside[..., :2] / safe[..., None]
    pixels = slopes @ camera.K[:2, :2].T + camera.K[:2, 2]
    by_slope = np.zeros((*depth.shape, 2, 3))
    by_slope[..., :2] = camera.K[:2, :2]
    by_slope[..., 2] = -(slopes @ camera.K[:2, :2].T)
    return pixels, by_slope / safe[..., None, None] @ rotation.T, depth


def calibration_variance(
    depth: Float64[np.ndarray, "*batch"], camera: TimedCamera, noise: NoiseConfig
) -> Float64[np.ndarray, "*batch"]:
    """Share of the calibration in a sight's variance, square pixels: (f·σ_rotation)² + (f·σ_position/depth)²."""
    focal = float(camera.K[0, 0])
    return (focal * np.radians(noise.rotation_deg)) ** 2 + (focal * noise.position_m / np.maximum(depth, 1e-3)) ** 2


@functools.cache
def gate(confidence: float, degrees: int) -> float:
    """Squared Mahalanobis distance that a share `confidence` of true values of so many degrees of freedom keeps."""
    return float(chi2.ppf(confidence, degrees))
