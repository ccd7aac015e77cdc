"""Lens distortion: pixels and images of a real lens to those of the ideal pinhole camera with the same K.

Pixels are those of the house (the centre of the top-left pixel is (0.5, 0.5)); OpenCV puts it at (0, 0), so the
principal point is shifted by half a pixel before every call.
"""

from __future__ import annotations

import functools

import cv2
import numpy as np
from jaxtyping import Float32, Float64

COEFFICIENT_COUNTS = {"none": (0,), "opencv": (4, 5, 8, 12, 14), "opencv_fisheye": (4,)}
"""Distortion models and how many coefficients each may have, in OpenCV's order (k1, k2, p1, p2, k3 …; k1 … k4)."""

_ITERATIONS = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
"""The inverse has no closed form; OpenCV's default of five fixed-point steps is off by pixels for strong lenses."""

PixelMap = tuple[Float32[np.ndarray, "height width"], Float32[np.ndarray, "height width"]]


def _opencv_matrix(K: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "3 3"]:
    shifted = K.copy()
    shifted[:2, 2] -= 0.5
    return shifted


def undistort_points(
    pixels: Float64[np.ndarray, "point 2"],
    K: Float64[np.ndarray, "3 3"],
    model: str,
    coefficients: tuple[float, ...],
) -> Float64[np.ndarray, "point 2"]:
    """Pixels of the stored image to pixels of the undistorted one (iterative inverse of the lens model).

    Args:
        pixels: positions in the stored image.
        K: intrinsics in pixels, without skew unless `model` is "none".
        model: "none", "opencv" or "opencv_fisheye".
        coefficients: in OpenCV's order.
    """
    if model == "none" or len(pixels) == 0:
        return pixels.copy()
    matrix, lens = _opencv_matrix(K), np.array(coefficients, dtype=np.float64)
    points = (pixels - 0.5)[:, None, :]
    undistort = cv2.fisheye.undistortPoints if model == "opencv_fisheye" else cv2.undistortPoints
    return undistort(points, matrix, lens, P=matrix, criteria=_ITERATIONS)[:, 0, :] + 0.5


def distort_points(
    pixels: Float64[np.ndarray, "point 2"],
    K: Float64[np.ndarray, "3 3"],
    model: str,
    coefficients: tuple[float, ...],
) -> Float64[np.ndarray, "point 2"]:
    """Pixels of the undistorted image to pixels of the stored one; the exact inverse of `undistort_points`."""
    if model == "none" or len(pixels) == 0:
        return pixels.copy()
    matrix, lens = _opencv_matrix(K), np.array(coefficients, dtype=np.float64)
    homogeneous = np.concatenate([pixels - 0.5, np.ones((len(pixels), 1))], axis=1)
    rays = (homogeneous @ np.linalg.inv(matrix).T)[:, None, :]
    project = cv2.fisheye.projectPoints if model == "opencv_fisheye" else cv2.projectPoints
    return project(rays, np.zeros(3), np.zeros(3), matrix, lens)[0][:, 0, :] + 0.5


def undistort_maps(
    K: Float64[np.ndarray, "3 3"], model: str, coefficients: tuple[float, ...], width: int, height: int
) -> PixelMap:
    """For each undistorted pixel the column and row of the stored image to look at, for `cv2.remap`; cached."""
    return _undistort_maps(K.tobytes(), model, coefficients, width, height)


@functools.lru_cache(maxsize=16)
def _undistort_maps(K: bytes, model: str, coefficients: tuple[float, ...], width: int, height: int) -> PixelMap:
    matrix = _opencv_matrix(np.frombuffer(K, dtype=np.float64).reshape(3, 3))
    lens, turn = np.array(coefficients, dtype=np.float64), np.eye(3)
    build = cv2.fisheye.initUndistortRectifyMap if model == "opencv_fisheye" else cv2.initUndistortRectifyMap
    columns, rows = build(matrix, lens, turn, matrix, (width, height), cv2.CV_32FC1)
    return columns, rows


def undistort_image(
    image: np.ndarray,
    K: Float64[np.ndarray, "3 3"],
    model: str,
    coefficients: tuple[float, ...],
    *,
    blend: bool = True,
) -> np.ndarray:
    """The image that a pinhole camera with the same K would have taken.

    Args:
        image: (height, width) or (height, width, channel).
        blend: interpolate linearly (colour); False takes the nearest pixel (instance ids and depths, whose mean
            means nothing).

    Returns:
        An image of the same size and type; what the lens did not see is 0.
    """
    if model == "none":
        return image
    columns, rows = undistort_maps(K, model, coefficients, image.shape[1], image.shape[0])
    mode = cv2.INTER_LINEAR if blend else cv2.INTER_NEAREST
    return cv2.remap(image, columns, rows, mode, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
