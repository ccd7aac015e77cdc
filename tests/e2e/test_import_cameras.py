"""A capture that another renderer made, brought back from every calibration format: same label, same places."""

from __future__ import annotations

import dataclasses
import json
import xml.etree.ElementTree as ET

import cv2
import jax
import numpy as np
import pytest
from support import calibration_files
from support.board_pictures import CHARUCO, board_cameras, write_recording
from support.command_line import run_command

from aerojax.capture.format import read_capture
from aerojax.capture.imports.calibration.base import CalibrationConfig
from aerojax.capture.imports.calibration.colmap import ColmapConfig
from aerojax.capture.imports.calibration.drone_tracking import DroneTrackingConfig
from aerojax.capture.imports.calibration.kalibr import KalibrConfig
from aerojax.capture.imports.calibration.nerfstudio import NerfstudioConfig
from aerojax.capture.imports.calibration.opencv import OpencvConfig
from aerojax.capture.imports.calibration.projections import ProjectionsConfig
from aerojax.capture.imports.calibration.ros import RosConfig, extract_images
from aerojax.capture.imports.cameras import CameraImport, WorldConfig, import_cameras
from aerojax.classify.load import load_classifier
from aerojax.core.types import CLASSES
from aerojax.data.exports.export import export_dataset
from aerojax.data.exports.sources import ExportOptions, find_sequences
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import reconstruct_capture
from aerojax.segment.given import GivenConfig
from experiments import calibrate, classify
from experiments import import_cameras as import_act

pytestmark = pytest.mark.slow
FRAMES = 3
NAME = "drone_crazyflie"


@pytest.fixture
def capture(shared):
    folder = shared / "data/captures" / NAME
    if not folder.is_dir():
        pytest.skip(f"no capture at {folder}")
    return dataclasses.replace(read_capture(folder), frames=FRAMES)


@pytest.fixture(scope="module")
def answers():
    """Function from a capture to its label and places; the original's is worked out once."""
    classifier, known = load_classifier(None), {}

    def answer(capture):
        if capture.folder not in known:
            config = PipelineConfig(segment=GivenConfig())
            clip = reconstruct_capture(capture, config, classifier, key=jax.random.key(0))
            assert clip.log_probabilities is not None
            known[capture.folder] = CLASSES[int(np.argmax(clip.log_probabilities[-1]))], clip.position
        return known[capture.folder]

    return answer


def exported(capture, folder, name):
    options = ExportOptions(images="symlink")
    return export_dataset(find_sequences(capture.folder), name, folder, options) / "all" / NAME


def write(kind, capture, folder) -> tuple[CalibrationConfig, object]:
    """A calibration of the capture's cameras, and the member that reads it."""
    cameras = capture.cameras
    if kind == "colmap text":
        return ColmapConfig(), exported(capture, folder, "colmap") / "sparse/0"
    if kind == "colmap binary":
        pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is missing; see requirements.clients.lock")
        (folder / "binary").mkdir()
        pycolmap.Reconstruction(str(exported(capture, folder, "colmap") / "sparse/0")).write_binary(
            str(folder / "binary")
        )
        return ColmapConfig(), folder / "binary"
    if kind == "nerfstudio":
        return NerfstudioConfig(), exported(capture, folder, "nerfstudio")
    if kind == "opencv":
        return OpencvConfig(), calibration_files.write_opencv(cameras, folder / "opencv")
    if kind == "kalibr":
        path = calibration_files.write_kalibr(cameras, folder / "camchain.yaml")
        return KalibrConfig(names=tuple(camera.name for camera in cameras)), path
    if kind == "projections":
        return ProjectionsConfig(), calibration_files.write_projections(cameras, folder / "mv3dt")
    path = np.array([state.position for state in read_capture(capture.folder).truth.objects[0].frames])
    wide = path + np.stack(
        [3 * np.sin(np.arange(len(path))), 3 * np.cos(1.7 * np.arange(len(path))), 0 * path[:, 0]], 1
    )
    return DroneTrackingConfig(), calibration_files.write_drone_tracking(cameras, folder / "drone", wide)


@pytest.mark.parametrize(
    "kind", ["colmap text", "colmap binary", "nerfstudio", "opencv", "kalibr", "projections", "drone tracking"]
)
def test_a_calibration_brings_the_same_answer(capture, answers, tmp_path, kind):
    member, source = write(kind, capture, tmp_path)
    world = WorldConfig(world_from_source=calibration_files.kalibr_world(capture.cameras) if kind == "kalibr" else ())
    settings = CameraImport(fps=capture.fps, frames=FRAMES, place="link", world=world)
    back = import_cameras(member.read(source), capture.folder, tmp_path / "back", settings).capture
    (label, position), (expected, true) = answers(back), answers(capture)
    assert label == expected == "drone"
    np.testing.assert_allclose(position, true, atol=1e-3)


def test_a_bag_brings_the_same_answer(capture, answers, tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is missing; pip install 'aerojax[ros]'")
    pictures = [
        [cv2.imread(str(capture.folder / camera.name / f"rgb/{frame:06d}.png")) for frame in range(FRAMES)]
        for camera in capture.cameras
    ]
    bag = calibration_files.write_bag(capture.cameras, tmp_path / "bag", pictures, capture.fps)
    for camera in capture.cameras:
        (tmp_path / "masks" / camera.name).mkdir(parents=True)
        for frame in range(FRAMES):
            path = capture.folder / camera.name / f"mask/{frame:06d}.png"
            (tmp_path / "masks" / camera.name / path.name).symlink_to(path)
    assert extract_images(bag, tmp_path / "images", capture.fps) == FRAMES
    settings = CameraImport(fps=capture.fps)
    calibration = RosConfig().read(bag)
    back = import_cameras(
        calibration, tmp_path / "images", tmp_path / "back", settings, masks=tmp_path / "masks"
    ).capture
    (label, position), (expected, true) = answers(back), answers(capture)
    assert label == expected
    np.testing.assert_allclose(position, true, atol=1e-3)


def test_the_acts_bring_and_take(capture, tmp_path, monkeypatch, capsys):
    """From OpenCV's files to a classified clip with its exports, as a user types it."""
    source = calibration_files.write_opencv(capture.cameras, tmp_path / "calibration")
    where = (f"images={capture.folder}", f"out={tmp_path}/capture", "place=link", f"frames={FRAMES}", "fps=30")
    more = ("origin=[47.37,8.54,408]", f"hydra.run.dir={tmp_path}/import")
    run_command(import_act, monkeypatch, f"source={source}", *where, *more)
    assert "rays through the object meet in 3 of 3 frames" in capsys.readouterr().out
    figures = json.loads((tmp_path / "import/metrics.json").read_text())
    assert figures["check"]["agrees"] is True and figures["cameras"] == len(capture.cameras)
    ET.parse(tmp_path / "capture/rig.svg")
    run_command(
        classify,
        monkeypatch,
        f"capture={tmp_path}/capture",
        "export=[csv,ply,usd,coco,video]",
        f"hydra.run.dir={tmp_path}/classify",
    )
    result = json.loads((tmp_path / "classify/result.json").read_text())
    assert result["most_likely"] == "drone" and len(result["track"]) == FRAMES
    written = sorted(path.name for path in (tmp_path / "classify/export").iterdir())
    assert written == ["coco.json", "gaussians.usdc", "ply", "track.csv", "video"]


def test_a_board_calibrates_what_import_cameras_reads(tmp_path, monkeypatch, capsys):
    """Videos of a board, calibrated, then brought as a capture of the same cameras."""
    write_recording(tmp_path / "videos", CHARUCO, videos=True)
    board = "board={columns: 7, rows: 5, square: 0.08, marker: 0.06}"
    where = (f"videos={tmp_path}/videos", "step=1", "lens=none", "ground_frame=0", f"hydra.run.dir={tmp_path}/run")
    run_command(calibrate, monkeypatch, board, *where)
    figures = json.loads((tmp_path / "run/metrics.json").read_text())
    assert figures["network_px"] < 0.5 and set(figures["views"]) == {"cam_0", "cam_1", "cam_2"}
    assert "import_cameras source=" in capsys.readouterr().out
    ET.parse(tmp_path / "run/rig.svg")
    source = f"source={tmp_path}/run/calibration.json"
    more = (f"images={tmp_path}/videos", f"out={tmp_path}/capture", "check=false", f"hydra.run.dir={tmp_path}/import")
    run_command(import_act, monkeypatch, source, *more)
    capture = read_capture(tmp_path / "capture")
    assert (capture.fps, capture.frames) == (10.0, 12)
    true = board_cameras()[1]
    for camera, pose in zip(capture.cameras, true, strict=True):
        assert abs(camera.world_from_cam[2, 3] - (pose[2, 3] - 0.6)) < 0.04
