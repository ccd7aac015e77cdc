"""Broken captures: one clear error each, all errors at once, and nothing is written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.broken_captures import BROKEN, EXPECTED, make_good

from aerojax.capture.codecs.headers import read_header
from aerojax.capture.format import read_capture
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
