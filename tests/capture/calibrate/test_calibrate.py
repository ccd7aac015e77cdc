"""A network is found again from pictures of a board that known cameras took."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.board_pictures import CHARUCO, CHESS, SIZE, board_cameras, write_recording

from aerojax.capture.calibrate.board import Board, BoardConfig
from aerojax.capture.calibrate.network import calibrate_network
from aerojax.capture.calibrate.recording import calibration_document, look_for_board
from aerojax.capture.imports.calibration.opencv import OpencvConfig
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import invert_rigid


@pytest.fixture(scope="module", params=[CHARUCO, CHESS], ids=["charuco", "chessboard"])
def recorded(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param.kind)
    write_recording(folder, request.param)
    board = Board(request.param)
    return request.param, board, look_for_board(folder, board, 1)


def relative(placed):
    return [invert_rigid(placed[0]) @ one for one in placed]


def test_the_network_is_found_again(recorded):
    _, board, views = recorded
    assert all(len(camera.seen) >= 9 for camera in views)
    network = calibrate_network(views, board, "none", None)
    K, placed = board_cameras()
    assert network.network_px < 0.3 and max(network.lens_px) < 0.3
    for index in range(3):
        found = network.K[index].copy()
        found[:2, 2] += 0.5
        np.testing.assert_allclose(found[[0, 1], [0, 1]], K[index][[0, 1], [0, 1]], rtol=0.02)
        np.testing.assert_allclose(found[:2, 2], K[index][:2, 2], atol=12)
    for found, true in zip(relative(network.world_from_cam), relative(placed), strict=True):
        assert np.linalg.norm(found[:3, 3] - true[:3, 3]) < 0.03
        turned = found[:3, :3].T @ true[:3, :3]
        assert np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))) < 1.5
    np.testing.assert_allclose(network.world_from_cam[0][:3, :3], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-9)


def test_the_ground_is_where_the_board_lay(recorded):
    _, board, views = recorded
    network = calibrate_network(views, board, "none", 0)
    _, placed = board_cameras()
    heights = [pose[2, 3] for pose in network.world_from_cam]
    np.testing.assert_allclose(heights, [one[2, 3] - 0.6 for one in placed], atol=0.03)
    with pytest.raises(UserError, match="frame 99") as refused:
        calibrate_network(views, board, "none", 99)
    assert refused.value.code == "missing"


def test_import_cameras_reads_the_calibration(recorded, tmp_path):
    _, board, views = recorded
    network = calibrate_network(views, board, "radial", None)
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(calibration_document(views, network)))
    read = OpencvConfig().read(path).cameras
    for index, camera in enumerate(read):
        assert camera.name == f"cam_{index}" and (camera.width, camera.height) == SIZE
        np.testing.assert_allclose(camera.K[:2, 2], network.K[index][:2, 2] + 0.5)
        np.testing.assert_allclose(camera.world_from_cam, network.world_from_cam[index], atol=1e-9)
        assert camera.distortion == network.distortion[index]


def test_cameras_that_see_too_little_are_named(recorded):
    _, board, views = recorded
    blind = [*views[:2], type(views[2])("blind", *SIZE, dict(list(views[2].seen.items())[:3]))]
    with pytest.raises(UserError, match="camera blind sees the board in 3 frames") as refused:
        calibrate_network(blind, board, "none", None)
    assert refused.value.code == "no-usable-frames"
    later = type(views[2])("apart", *SIZE, {frame + 100: corners for frame, corners in views[2].seen.items()})
    with pytest.raises(UserError, match="no moment in which apart") as refused:
        calibrate_network([*views[:2], later], board, "none", None)
    assert refused.value.code == "no-usable-frames"


@pytest.mark.parametrize(
    ("changes", "code", "named"),
    [
        ({"columns": 2}, "out-of-range", "2×5 squares"),
        ({"square": 0.0}, "out-of-range", "board.square=0"),
        ({"marker": 0.2}, "out-of-range", "board.marker=0.2"),
        ({"dictionary": "DICT_NONE"}, "invalid", "DICT_4X4_50"),
        ({"kind": "chessboard"}, "invalid", "turned by 180°"),
    ],
)
def test_boards_that_cannot_be_are_named(changes, code, named):
    with pytest.raises(UserError, match=named) as refused:
        Board(BoardConfig(**changes))
    assert refused.value.code == code


def test_too_few_cameras_are_named(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(UserError, match="0 videos or folders") as refused:
        look_for_board(tmp_path, Board(CHARUCO), 1)
    assert refused.value.code == "missing"
    with pytest.raises(UserError, match="step=0"):
        look_for_board(tmp_path, Board(CHARUCO), 0)
