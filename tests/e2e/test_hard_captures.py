"""Captures as people really make them: the right position, or a refusal that names what to mend."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cv2
import jax
import numpy as np
import pytest
from support.networks import HEIGHT, WIDTH, position_at
from support.written_networks import write_network

from aerojax.capture.format import read_capture
from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.geometry.cameras import invert_rigid
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import Clip, reconstruct_capture
from aerojax.reconstruct.hull import HullConfig

SMALL = PipelineConfig(
    reconstruct=HullConfig(grid=32, capacity=512), crop_size=64, decimation=DecimationConfig(512, 96, 64)
)
ASKEW = np.eye(4)
ASKEW[:3, :3] = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
ASKEW[:3, :3] *= np.linalg.det(ASKEW[:3, :3])
ASKEW[:3, 3] = 40.0, -25.0, 7.0


def clip_of(folder: Path) -> Clip:
    return reconstruct_capture(read_capture(folder), SMALL, key=jax.random.key(0))


def check(clip: Clip, frames: list[int]) -> None:
    """The clip has these frames, with the ellipsoid where it was."""
    assert list(clip.frames) == frames
    np.testing.assert_allclose(clip.position, [position_at(frame) for frame in frames], atol=0.03)


def change_masks(folder: Path, change) -> None:
    """Rewrite every mask, a boolean array, as what `change` makes of it."""
    for path in sorted(folder.glob("*/mask/*.png")):
        mask = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) > 0
        cv2.imwrite(str(path), change(mask))


def change_json(folder: Path, change) -> None:
    path = folder / "capture.json"
    raw = json.loads(path.read_text())
    change(raw)
    path.write_text(json.dumps(raw))


def grey(mask):
    return np.uint8(255) * mask


def blurred(mask):
    return cv2.GaussianBlur(grey(mask), (0, 0), 1.0)


def through_jpeg(mask):
    return cv2.imdecode(cv2.imencode(".jpg", grey(mask), [cv2.IMWRITE_JPEG_QUALITY, 70])[1], cv2.IMREAD_GRAYSCALE)


def with_speck(place):
    def change(mask):
        mask = mask.copy()
        mask[place] = True
        return np.uint16(3) * mask

    return change


MASKS = {
    "0 and 255": grey,
    "0 and 65535": lambda mask: np.uint16(65535) * mask,
    "ids of 8 bits": lambda mask: np.uint8(3) * mask,
    "anti-aliased": blurred,
    "anti-aliased, 16 bits": lambda mask: blurred(mask).astype(np.uint16) * np.uint16(257),
    "from JPEG": through_jpeg,
    "RGBA cut-out": lambda mask: np.dstack([np.full((*mask.shape, 3), 60, np.uint8), grey(mask)]),
    "white on black RGB": lambda mask: np.repeat(grey(mask)[..., None], 3, axis=2),
    "speck in the corner": with_speck((0, 0)),
    "speck near the corner": with_speck((6, 6)),
    "row of noise": with_speck((HEIGHT - 1, slice(0, 5))),
}


@pytest.mark.parametrize("name", MASKS)
def test_masks_of_any_make_give_the_position(tmp_path, name):
    write_network(tmp_path, 2)
    change_masks(tmp_path, MASKS[name])
    check(clip_of(tmp_path), [0, 1])


def test_masks_without_an_extra_speck_are_not_changed_by_looking(tmp_path):
    write_network(tmp_path / "plain", 2)
    write_network(tmp_path / "speck", 2)
    change_masks(tmp_path / "speck", with_speck((2, 150)))
    plain, speck = clip_of(tmp_path / "plain"), clip_of(tmp_path / "speck")
    np.testing.assert_array_equal(plain.position, speck.position)
    np.testing.assert_array_equal(plain.gaussians.mean, speck.gaussians.mean)


def test_an_object_that_is_seen_briefly_is_found(tmp_path):
    write_network(tmp_path, 12, blind=tuple(f for f in range(12) if f not in (3, 4)))
    check(clip_of(tmp_path), [3, 4])


@pytest.mark.parametrize("kind", ["rgb", "mask"])
def test_a_missing_file_costs_one_view(tmp_path, kind):
    write_network(tmp_path, 3)
    pattern = "cam_02/000001.png" if kind == "rgb" else "cam_02/mask/000001.png"
    (tmp_path / pattern).unlink()
    clip = clip_of(tmp_path)
    check(clip, [0, 1, 2])
    ((frame, view),) = clip.missing
    assert (frame, view.camera) == (1, 1) and pattern in view.text
    assert any("camera cam_02: left out of 1 of 3 frames" in warning for warning in clip.warnings)
    change_json(tmp_path, lambda raw: raw.update(missing="refuse"))
    with pytest.raises(UserError, match="the file is missing"):
        clip_of(tmp_path)


def test_a_damaged_image_costs_one_view_and_is_named(tmp_path):
    write_network(tmp_path, 3)
    path = tmp_path / "cam_03/000002.png"
    data = path.read_bytes()
    middle = data.index(b"IDAT") + 12  # the end stays, so that the header's check finds nothing
    path.write_bytes(data[:middle] + bytes(8) + data[middle + 8 :])
    clip = clip_of(tmp_path)
    check(clip, [0, 1, 2])
    assert [(frame, view.camera) for frame, view in clip.missing] == [(2, 2)]
    assert any("cam_03" in warning and "000002.png" in warning for warning in clip.warnings)


def test_a_frame_that_too_few_cameras_have_is_dropped_and_the_others_stay(tmp_path):
    write_network(tmp_path, 4)
    for camera, frame in (("cam_01", 1), ("cam_02", 1), ("cam_03", 1), ("cam_01", 2), ("cam_02", 2)):
        (tmp_path / f"{camera}/{frame:06d}.png").unlink()
    clip = clip_of(tmp_path)
    check(clip, [0, 2, 3])  # two cameras are enough
    assert [event.frame for event in clip.dropped] == [1] and len(clip.missing) == 5


@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0])
def test_videos_of_any_rate_are_taken_by_time(tmp_path, fps):
    capture = write_network(tmp_path, 6)
    pictures = [cv2.imread(str(tmp_path / f"cam_01/{frame:06d}.png")) for frame in range(6)]
    writer = cv2.VideoWriter(str(tmp_path / "film.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), fps, (WIDTH, HEIGHT))
    for index in range(round(6 * fps / 30)):
        writer.write(pictures[int(index * 30 / fps)])
    writer.release()
    change_json(tmp_path, lambda raw: raw["cameras"][0].update(rgb="film.mp4"))
    clip = clip_of(tmp_path)
    check(clip, [*range(6)])
    gaps = [frame for frame, _ in clip.missing]
    assert gaps == ([1, 3, 5] if fps == 15.0 else []) and len(capture.cameras) == 4
    assert any("left out of 3 of 6 frames" in warning for warning in clip.warnings) == (fps == 15.0)


CONVENTIONS = {
    "cam_from_world": (invert_rigid, "holds cam_from_world"),
    "OpenGL axes": (lambda pose: pose @ np.diag([1.0, -1.0, -1.0, 1.0]), "OpenGL axes"),
}


@pytest.mark.parametrize("name", CONVENTIONS)
def test_another_convention_is_named(tmp_path, name):
    change, words = CONVENTIONS[name]
    write_network(tmp_path, 3, world_from_rig=ASKEW)

    def turn(raw):
        for camera in raw["cameras"]:
            camera["world_from_cam"] = change(np.array(camera["world_from_cam"])).tolist()

    change_json(tmp_path, turn)
    with pytest.raises(UserError, match=f"the silhouettes meet if .*{words}") as refused:
        clip_of(tmp_path)
    assert refused.value.code == "no-usable-frames"


def test_rounded_rotations_and_byte_order_marks_are_read(tmp_path):
    write_network(tmp_path, 2)

    def rounded(raw):
        for camera in raw["cameras"]:
            camera["world_from_cam"] = np.round(np.array(camera["world_from_cam"]), 4).tolist()

    change_json(tmp_path, rounded)
    path = tmp_path / "capture.json"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    clip = clip_of(tmp_path)
    check(clip, [0, 1])
    assert len(clip.warnings) >= 3 and all("was made orthonormal" in warning for warning in clip.warnings)
    for camera in read_capture(tmp_path).cameras:
        rotation = camera.world_from_cam[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


# --- captures of the reference data ---------------------------------------------------------------------------------

BASE = np.array([-2.253, -1.628, 12.617])
"""Where the drone is in frame 0, metres, as the undisturbed capture gives it."""
SHARED = {
    "bom": [*range(6)],
    "soft": [*range(6)],
    "speck": [*range(6)],
    "speck2": [*range(6)],
    "jpgcut": [*range(6)],
    "late2": [3, 4],
    "exif3_with_truth": [0, 1],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SHARED)
def test_reference_captures_that_failed(shared, name):
    folder = shared / "bugs/captures" / name
    if not folder.is_dir():
        pytest.skip(f"no capture at {folder}")
    capture = read_capture(folder)
    clip = reconstruct_capture(capture, PipelineConfig(), load_classifier(), key=jax.random.key(0))
    assert list(clip.frames) == SHARED[name]
    if name != "late2":
        np.testing.assert_allclose(clip.position[0], BASE, atol=0.05)
    assert clip.log_probabilities is not None
    assert CLASSES[int(np.argmax(clip.log_probabilities[-1]))] == "drone"
    named = [(frame, capture.cameras[view.camera].name) for frame, view in clip.missing]
    assert named == ([(3, "cam_01")] if name == "jpgcut" else [])


@pytest.mark.slow
def test_a_speck_changes_no_number(shared):
    folder = shared / "bugs/captures"
    if not folder.is_dir():
        pytest.skip(f"no captures at {folder}")
    clips = [
        reconstruct_capture(
            dataclasses.replace(read_capture(folder / name), frames=2), PipelineConfig(), key=jax.random.key(0)
        )
        for name in ("bom", "speck", "speck2")
    ]
    for other in clips[1:]:
        np.testing.assert_array_equal(clips[0].gaussians.mean, other.gaussians.mean)
