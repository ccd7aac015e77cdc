"""Broken captures: one clear error each, all errors at once, and nothing is written."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.broken_captures import BROKEN, EXPECTED, HEIGHT, WIDTH, make_good

from aerojax.capture.codecs.headers import read_header
from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_mask
from aerojax.capture.paths import frame_path, pattern_problem
from aerojax.capture.validate.examination import problems
from aerojax.core.errors import UserError


def snapshot(folder: Path) -> dict[str, tuple[bytes, int]]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path): (path.read_bytes(), path.stat().st_mtime_ns) for path in files}


def test_good_capture_has_no_problem(tmp_path):
    make_good(tmp_path)
    assert problems(tmp_path) == []


@pytest.mark.parametrize("name", BROKEN)
def test_broken_capture_gives_one_clear_error(name, tmp_path):
    folder = tmp_path / "capture"
    BROKEN[name](folder)
    before = snapshot(tmp_path)
    with pytest.raises(UserError) as caught:
        read_capture(folder)
    message = str(caught.value)
    assert message.startswith(f"capture {folder} has 1 problem:\n"), message
    assert all(words in message for words in EXPECTED[name]), message
    (problem,) = problems(folder)
    assert problem.file and problem.message and problem.remedy
    assert len(message) < 600
    assert snapshot(tmp_path) == before


def test_all_problems_at_once(tmp_path):
    make_good(tmp_path)
    raw = json.loads((tmp_path / "capture.json").read_text())
    raw["fps"], raw["missing"] = -1, "refuse"
    raw["cameras"][0]["K"][0][0] = 0
    raw["cameras"][1]["distortion"]["model"] = "brown"
    (tmp_path / "capture.json").write_text(json.dumps(raw))
    (tmp_path / "cam_03/rgb/000000.png").unlink()
    truth = json.loads((tmp_path / "truth.json").read_text())
    truth["objects"][0]["class"] = "kite"
    (tmp_path / "truth.json").write_text(json.dumps(truth))
    with pytest.raises(UserError, match="has 5 problems") as caught:
        read_capture(tmp_path)
    for word in ("fps", "cameras[0].K", "brown", "cam_03/rgb/000000.png", "kite"):
        assert word in str(caught.value)


def test_same_complaint_about_many_files_is_one_line(tmp_path):
    make_good(tmp_path)
    for path in (tmp_path / "cam_01/mask").iterdir():
        path.unlink()
    (problem,) = problems(tmp_path)
    assert problem.file == "cam_01/mask/000000.png"
    assert "and 1 more of 2" in problem.message


def test_missing_folder_is_named(tmp_path):
    with pytest.raises(UserError, match="nowhere is not a folder"):
        read_capture(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("pattern", "path"),
    [("a/{frame}.png", "a/7.png"), ("a/{frame:03d}.png", "a/007.png"), ("{frame:01d}/x.png", "7/x.png")],
)
def test_frame_path(pattern, path):
    assert pattern_problem(pattern, (".png",)) is None
    assert frame_path(pattern, 7) == path


def test_headers_match_files(tmp_path):
    make_good(tmp_path)
    colour, mask = read_header(tmp_path / "cam_01/rgb/000000.png"), read_header(tmp_path / "cam_01/mask/000000.png")
    depth = read_header(tmp_path / "cam_01/depth/000000.tiff")
    assert (colour.width, colour.height, colour.channels, colour.bits) == (32, 24, 3, 8)
    assert (mask.width, mask.height, mask.channels, mask.bits) == (32, 24, 1, 16)
    assert (depth.width, depth.height, depth.channels, depth.bits, depth.floating) == (32, 24, 1, 32, True)


def test_shared_captures_validate(shared):
    folders = sorted(path.parent for path in (shared / "data/captures").glob("*/capture.json"))
    assert len(folders) >= 8
    for folder in folders:
        assert problems(folder) == []


def test_missing_and_damaged_files_are_warnings_unless_none_is_left(tmp_path):
    make_good(tmp_path)
    (tmp_path / "cam_02/rgb/000001.png").unlink()
    (tmp_path / "cam_03/depth/000000.tiff").write_bytes(b"")
    first, second = read_capture(tmp_path).warnings
    assert "cam_02/rgb/000001.png" in first and "the camera is left out of these frames" in first
    assert "cam_03/depth/000000.tiff" in second and "there is no depth in them" in second
    (tmp_path / "cam_02/rgb/000000.png").unlink()
    with pytest.raises(UserError, match=r"the file is missing \(and 1 more of 2\)"):
        read_capture(tmp_path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "utf-32"])
def test_json_of_any_unicode_encoding_is_read(tmp_path, encoding):
    made = make_good(tmp_path)
    for name in ("capture.json", "truth.json"):
        path = tmp_path / name
        path.write_bytes(path.read_text().encode(encoding))
    read = read_capture(tmp_path)
    assert (read.frames, read.truth) == (made.frames, made.truth)


@pytest.mark.parametrize(("off", "answer"), [(1e-7, "kept"), (5e-5, "mended"), (4e-4, "mended"), (2e-3, "refused")])
def test_rotations_are_mended_within_a_thousandth(tmp_path, off, answer):
    make_good(tmp_path)
    path = tmp_path / "capture.json"
    raw = json.loads(path.read_text())
    raw["cameras"][1]["world_from_cam"][:3] = [[1, off, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7]]
    path.write_text(json.dumps(raw))
    if answer == "refused":
        with pytest.raises(UserError, match=r"cameras\[1\]\.world_from_cam: .* not orthonormal \(off by 0\.002\)"):
            read_capture(tmp_path)
        return
    capture = read_capture(tmp_path)
    assert len(capture.warnings) == (answer == "mended")
    rotation = capture.cameras[1].world_from_cam[:3, :3]
    np.testing.assert_allclose(rotation, np.eye(3), atol=off)
    if answer == "mended":
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert f"off by {off:.2g} and was made orthonormal" in capture.warnings[0]


@pytest.mark.parametrize(
    ("values", "declared", "kind", "read"),
    [
        ((255, 255, 255), None, "picture", (1, 1, 1)),
        ((255, 3, 255), None, "ids", (255, 3, 255)),
        ((1, 1, 1), None, "ids", (1, 1, 1)),
        ((0, 0, 0), None, None, (0, 0, 0)),
        ((255, 255, 255), "ids", None, (255, 255, 255)),
        ((200, 200, 255), "picture", None, (1, 1, 1)),
    ],
)
def test_pictures_and_ids_are_told_apart_by_all_masks(tmp_path, values, declared, kind, read):
    make_good(tmp_path)
    for camera, value in enumerate(values, start=1):
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        mask[6:18, 8:24] = value
        for path in (tmp_path / f"cam_0{camera}/mask").iterdir():
            cv2.imwrite(str(path), mask)
    if declared is not None:
        path = tmp_path / "capture.json"
        raw = json.loads(path.read_text())
        for one in raw["cameras"]:
            one["mask_kind"] = declared
        path.write_text(json.dumps(raw))
    capture = read_capture(tmp_path)
    assert capture.mask_kind == kind
    assert tuple(int(read_mask(capture, camera, 0).max()) for camera in range(3)) == read
