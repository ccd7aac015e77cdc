"""Cameras in another tool's convention are told by which one lets the silhouettes meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.networks import mask_of, network, position_at

from aerojax.capture.format import CaptureCamera
from aerojax.geometry.cameras import invert_rigid, look_at
from aerojax.segment.silhouettes import silhouette_of
from aerojax.track.conventions import fitting_convention

WORLD = np.eye(4)
WORLD[:3, :3] = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
WORLD[:3, :3] *= np.linalg.det(WORLD[:3, :3])
WORLD[:3, 3] = 40.0, -25.0, 7.0
"""The rig stands askew and away from the world's origin: looking at the origin, several conventions agree."""
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


def frames_of(cameras, count=4):
    """Silhouettes of the ellipsoid in some frames, `cameras` being right."""
    placed = network(len(cameras))  # the ellipsoid flies about the rig's middle
    found = []
    for frame in range(0, 9 * count, 9):
        masks = [mask_of(camera, position_at(frame)) for camera in placed]
        silhouettes = [silhouette_of(i, 1, mask.astype(np.float32)) for i, mask in enumerate(masks)]
        found.append([one for one in silhouettes if one is not None])
    return found


def posed(change):
    return lambda camera: replace(camera, world_from_cam=change(camera.world_from_cam))


def transposed(pose):
    turned = pose.copy()
    turned[:3, :3] = pose[:3, :3].T
    return turned


def with_translation(pose):
    moved = pose.copy()
    moved[:3, 3] = invert_rigid(pose)[:3, 3]
    return moved


def K_of_half(camera: CaptureCamera) -> CaptureCamera:
    return replace(camera, K=np.diag([0.5, 0.5, 1.0]) @ camera.K)


def K_from_the_middle(camera: CaptureCamera) -> CaptureCamera:
    K = camera.K.copy()
    K[:2, 2] = 0
    return replace(camera, K=K)


WRONG = {
    "cam_from_world": (posed(invert_rigid), "holds cam_from_world", "inverse"),
    "OpenGL axes": (posed(lambda p: p @ OPENGL), "OpenGL axes", "negate its second and third column"),
    "OpenGL view matrix": (posed(lambda p: OPENGL @ invert_rigid(p)), "cam_from_world with OpenGL axes", "negate"),
    "transposed rotation": (posed(transposed), "transposed", "transpose"),
    "translation of the inverse": (posed(with_translation), "translation in world_from_cam", "-R t"),
    "forward, left, up": (
        posed(lambda p: p @ np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])),
        "x forward, y left, z up",
        "columns",
    ),
    "K of half the size": (K_of_half, "another resolution", "scale"),
    "K from the middle": (K_from_the_middle, "principal point", "half the width"),
}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("count", [3, 5])
def test_the_convention_that_fits_is_named(name, count):
    change, words, remedy = WRONG[name]
    cameras = network(count, world_from_rig=WORLD)
    found = fitting_convention(frames_of(cameras), [change(camera) for camera in cameras])
    assert found is not None and words in found.name and remedy in found.remedy


def test_upside_down_images_are_named():
    # From cameras of one tilt, upside-down images are those of a mirrored world, whose rays meet as well.
    centres = np.array([[5, 0, 0.5], [-2, 3, 4], [1, -4, -3], [-3, -3, 3.0]])
    cameras = [
        replace(camera, world_from_cam=np.asarray(look_at(centre, np.zeros(3)), np.float64))
        for camera, centre in zip(network(4), centres, strict=True)
    ]
    frames = [
        [silhouette_of(i, 1, mask_of(c, place)[::-1].astype(np.float32)) for i, c in enumerate(cameras)]
        for place in np.array([[0.3, 0.6, 0.9], [0.5, -0.6, 0.8]])
    ]
    found = fitting_convention([[one for one in frame if one is not None] for frame in frames], cameras)
    assert found is not None and "upside down" in found.name


def test_cameras_that_fit_are_left_alone():
    cameras = network(4, world_from_rig=WORLD)
    assert fitting_convention(frames_of(cameras), cameras) is None


def test_cameras_that_nothing_mends_get_no_advice():
    cameras = network(4, world_from_rig=WORLD)
    rng = np.random.default_rng(0)
    lost = []
    for camera in cameras:
        pose = camera.world_from_cam.copy()
        pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        pose[:3, :3] *= np.linalg.det(pose[:3, :3])
        lost.append(replace(camera, world_from_cam=pose))
    assert fitting_convention(frames_of(cameras), lost) is None


def test_two_cameras_prove_nothing():
    cameras = network(4, world_from_rig=WORLD)
    wrong = [replace(camera, world_from_cam=invert_rigid(camera.world_from_cam)) for camera in cameras]
    assert fitting_convention([frame[:2] for frame in frames_of(cameras)], wrong) is None
