"""A classified clip taken along: what is written says what was seen, and the tools that it is for read it."""

from __future__ import annotations

import csv
import dataclasses
import json

import cv2
import jax
import numpy as np
import pytest
from pxr import Usd, UsdValidation
from support.networks import AXES, mask_of, position_at
from support.written_networks import write_network

from aerojax.capture.format import read_capture
from aerojax.capture.lenses import distort_points
from aerojax.classify.answer_sets import AnswerSet
from aerojax.classify.base import untrained
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.gaussians.io.ply import read_ply
from aerojax.gaussians.io.usd_reading import read_usd
from aerojax.geometry.geodesy import GeographicOrigin
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.exports.export import export_clip
from aerojax.pipeline.exports.images import sightings
from aerojax.pipeline.exports.sapient import ulid
from aerojax.pipeline.offline import reconstruct_capture
from aerojax.pipeline.results import headline, result_of, result_schema
from aerojax.pipeline.track_points import size_of, track_points, velocity_at
from aerojax.pipeline.trust import Reason, Verdict
from aerojax.reconstruct.hull import HullConfig

SMALL = PipelineConfig(
    reconstruct=HullConfig(grid=32, capacity=512), crop_size=64, decimation=DecimationConfig(512, 96, 64)
)
NETWORK = MambaSplatConfig(d_model=32, depth=1, mamba_layers=2, scale_normalisation="running")
FRAMES, BLIND = 6, 2
ORIGIN = GeographicOrigin(47.37, 8.54, 408.0)


@pytest.fixture(scope="module")
def classified(tmp_path_factory):
    """A capture with a dropped frame, and its clip."""
    written = write_network(tmp_path_factory.mktemp("network") / "capture", FRAMES, blind=(BLIND,))
    capture = dataclasses.replace(read_capture(written.folder), origin=ORIGIN)
    classifier = untrained(NETWORK, tokens=32, frames=8, key=jax.random.key(1))
    clip = reconstruct_capture(capture, SMALL, classifier, key=jax.random.key(0), keep_observations=True)
    assert clip.frames == (0, 1, 3, 4, 5)
    return capture, clip


@pytest.fixture(scope="module")
def exported(classified, tmp_path_factory):
    """Everything but what needs another package."""
    names = ("ply", "usd", "csv", "jsonl", "coco", "video")
    said = []
    folder = tmp_path_factory.mktemp("exports")
    written = export_clip(*classified, names, folder, progress=lambda done, total, what: said.append(what))
    assert tuple(written) == names and set(said) == {*names, "videos"}
    return written


def test_the_track_is_that_of_the_object(classified):
    points = track_points(*classified)
    for point in points:
        assert point.time_s == pytest.approx(point.frame / 30)
        np.testing.assert_allclose(point.position, position_at(point.frame), atol=0.03)
        # The ellipsoid's own speed: 0.9 m · 0.1 a frame · 30 frames a second, with the noise of hulls of 32 cells.
        assert point.velocity is not None and 2.0 < np.linalg.norm(point.velocity) < 3.4
        assert point.size is not None
        np.testing.assert_allclose(point.size, 2 * AXES, atol=0.2)
        assert sum(point.probabilities.values()) == pytest.approx(1, abs=1e-5)
    east, north = np.subtract(points[-1].position, points[0].position)[:2]
    assert points[0].place is not None and points[-1].place is not None
    moved = np.subtract(points[-1].place, points[0].place)
    assert moved[0] * 111_200 == pytest.approx(north, abs=2e-3)
    assert moved[1] * 111_320 * np.cos(np.radians(47.37)) == pytest.approx(east, rel=0.01)


def test_velocity_and_size_of_known_motion():
    times = np.array([0.0, 0.1, 0.2, 0.5, 2.0])
    places = np.stack([3 * times, -times, 0 * times], axis=1)
    np.testing.assert_allclose(velocity_at(times, places, 1), (3, -1, 0), atol=1e-12)
    assert velocity_at(times, places, 4) is None and velocity_at(times[:1], places[:1], 0) is None
    box = np.random.default_rng(0).uniform(-1, 1, (4000, 3)) * [0.5, 2.0, 1.0]
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    np.testing.assert_allclose(size_of(box @ turn.T + 7), (4, 2, 1), rtol=0.05)
    assert size_of(box[:3]) is None


def test_the_result_fits_its_schema(classified):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is missing; see requirements.clients.lock")
    schema, result = result_schema(), json.loads(json.dumps(result_of(*classified)))
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(result, schema, cls=jsonschema.Draft202012Validator)
    assert set(result) == set(schema["properties"]), "every key is described"
    assert (result["format"], result["version"]) == ("aerojax-result", 2)
    assert result["dropped"] == {str(BLIND): result["dropped"][str(BLIND)]} and "place" in result["track"][0]
    for key in schema["required"]:
        with pytest.raises(jsonschema.ValidationError, match=f"'{key}' is a required property"):
            jsonschema.validate({k: v for k, v in result.items() if k != key}, schema)
    alone = {"answer_set": {"classes": [], "coverage": 0.9}}
    for wrong in (alone, {"status": "fine"}, {"version": 1}, {"label": "jet"}, {"track": []}, {"familiarity": 2}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**result, **wrong}, schema)


def test_what_is_unknown_is_the_label_and_says_why(classified):
    capture, clip = classified
    strange = Verdict("ok", (Reason("unfamiliar", "like nothing known"),), 1.0, unknown=True, familiarity=0.004)
    result = result_of(capture, dataclasses.replace(clip, verdict=strange))
    assert (result["status"], result["label"], result["familiarity"]) == ("ok", "unknown", 0.004)
    assert result["most_likely"] in CLASSES and headline(result) == "unknown: like nothing known"
    doubtful = result_of(capture, dataclasses.replace(clip, verdict=dataclasses.replace(strange, status="unsure")))
    assert doubtful["label"] is None and headline(doubtful).startswith("not sure (most likely ")
    held = AnswerSet(("drone", "bird"), 0.9)
    known = result_of(capture, dataclasses.replace(clip, verdict=Verdict("ok", (), 1.0), answer_set=held))
    assert known["label"] == known["most_likely"] == headline(known) and known["familiarity"] is None
    assert known["answer_set"] == {"classes": ("drone", "bird"), "coverage": 0.9} and result["answer_set"] is None


def test_gaussians_as_files_of_points(classified, exported):
    _, clip = classified
    files = sorted(path.name for path in exported["ply"].iterdir())
    assert files == [f"frame_{frame:06d}.ply" for frame in clip.frames]
    world = clip.in_world()
    for index, frame in enumerate(clip.frames):
        again = read_ply(exported["ply"] / f"frame_{frame:06d}.ply")
        np.testing.assert_allclose(again.mean, world.mean[index], atol=1e-5)
        np.testing.assert_allclose(again.scale, world.scale[index], rtol=1e-4, atol=1e-9)
        np.testing.assert_allclose(np.mean(again.mean, axis=0), position_at(frame), atol=0.1)
    trimesh = pytest.importorskip("trimesh")
    cloud = trimesh.load(exported["ply"] / "frame_000003.ply")
    np.testing.assert_allclose(cloud.vertices, np.asarray(read_ply(exported["ply"] / "frame_000003.ply").mean))


def test_gaussians_as_one_stage(classified, exported):
    capture, clip = classified
    stage = Usd.Stage.Open(str(exported["usd"]))
    positions = stage.GetDefaultPrim().GetAttribute("positions")
    assert positions.GetTimeSamples() == list(clip.frames) and stage.GetTimeCodesPerSecond() == capture.fps
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 5)
    np.testing.assert_allclose(positions.Get(3), np.asarray(clip.in_world().mean[2]), atol=1e-5)
    assert len(read_usd(exported["usd"])) == len(clip.frames)
    registry = UsdValidation.ValidationRegistry()
    validators = [registry.GetOrLoadValidatorByName(m.name) for m in registry.GetAllValidatorMetadata()]
    assert [e.GetMessage() for e in UsdValidation.ValidationContext(validators).Validate(stage)] == []


def test_the_track_as_tables(classified, exported):
    points = track_points(*classified)
    with exported["csv"].open(newline="") as file:
        rows = list(csv.DictReader(file))
    lines = [json.loads(line) for line in exported["jsonl"].read_text().splitlines()]
    for point, row, line in zip(points, rows, lines, strict=True):
        assert (int(row["frame"]), float(row["time_s"]), row["label"]) == (point.frame, point.time_s, point.label)
        assert tuple(float(row[key]) for key in ("x_m", "y_m", "z_m")) == point.position
        assert tuple(float(row[key]) for key in ("vx_m_s", "vy_m_s", "vz_m_s")) == point.velocity
        assert tuple(float(row[key]) for key in ("length_m", "width_m", "height_m")) == point.size
        assert {name: float(row[f"p_{name}"]) for name in CLASSES} == point.probabilities == line["probabilities"]
        assert float(row["latitude_deg"]) == line["place"][0] and tuple(line["velocity"]) == point.velocity


@pytest.mark.parametrize(("status", "unknown"), [("ok", False), ("ok", True), ("unsure", False), ("unsure", True)])
def test_exports_carry_the_answer_and_none_where_there_is_none(classified, tmp_path, status, unknown):
    capture, clip = classified
    changed = dataclasses.replace(clip, verdict=dataclasses.replace(clip.verdict, status=status, unknown=unknown))
    answer = None if status != "ok" else "unknown" if unknown else track_points(capture, clip)[-1].label
    written = export_clip(capture, changed, ["csv", "jsonl", "coco"], tmp_path)
    assert {json.loads(line)["answer"] for line in written["jsonl"].read_text().splitlines()} == {answer}
    assert {row["answer"] for row in csv.DictReader(written["csv"].read_text().splitlines())} == {answer or ""}
    assert {one["answer"] for one in json.loads(written["coco"].read_text())["annotations"]} == {answer}


def overlap(one, other):
    return (one & other).sum() / (one | other).sum()


def test_masks_lie_in_the_images_where_the_object_is(classified):
    capture, clip = classified
    seen = list(sightings(capture, clip))
    assert len(seen) == len(clip.frames) * len(capture.cameras)
    for one in seen:
        true = mask_of(capture.cameras[one.camera], position_at(one.frame))
        assert overlap(one.mask, true) > 0.9


def test_masks_lie_in_images_of_a_lens(classified):
    capture, clip = classified
    lens = {"distortion_model": "opencv", "distortion": (-0.3, 0.05, 0.002, -0.001)}
    bent = dataclasses.replace(capture, cameras=tuple(dataclasses.replace(c, **lens) for c in capture.cameras))
    straight = list(sightings(capture, clip))
    assert any((one.mask != other.mask).any() for one, other in zip(sightings(bent, clip), straight, strict=True))
    for one, other in zip(sightings(bent, clip), straight, strict=True):
        camera = bent.cameras[one.camera]
        rows, columns = np.nonzero(other.mask)
        pixels = np.stack([columns, rows], axis=1) + 0.5
        moved = distort_points(pixels, camera.K, camera.distortion_model, camera.distortion).mean(axis=0)
        rows, columns = np.nonzero(one.mask)
        assert np.abs(moved - [columns.mean() + 0.5, rows.mean() + 0.5]).max() < 0.4


# pycocotools 2.0.11 decodes through an array class of NumPy 1.
@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
def test_pycocotools_reads_masks_and_scores_them(classified, exported):
    coco_tools = pytest.importorskip("pycocotools.coco", reason="pycocotools is missing; see requirements.clients.lock")
    capture, clip = classified
    read = coco_tools.COCO(str(exported["coco"]))
    assert len(read.imgs) == len(read.anns) == len(clip.frames) * len(capture.cameras)
    cameras = {camera.name: camera for camera in capture.cameras}
    for annotation in read.anns.values():
        image = read.imgs[annotation["image_id"]]
        assert (capture.folder / image["file_name"]).is_file()
        true = mask_of(cameras[image["camera"]], position_at(image["frame"]))
        assert overlap(read.annToMask(annotation).astype(bool), true) > 0.9
        x, y, w, h = annotation["bbox"]
        rows, columns = np.nonzero(true)
        assert np.abs(np.array([x, y, x + w, y + h]) - [columns.min(), rows.min(), columns.max(), rows.max()]).max() < 4
        assert read.cats[annotation["category_id"]]["name"] == track_points(capture, clip)[-1].label
        assert 0 < annotation["score"] <= 1


def test_videos_show_every_frame(classified, exported):
    capture, _ = classified
    names = sorted(path.name for path in exported["video"].iterdir())
    assert names == [*(f"{camera.name}.mp4" for camera in capture.cameras), "mosaic.mp4"]
    sizes = {}
    for name in names:
        video = cv2.VideoCapture(str(exported["video"] / name))
        assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(capture.fps)
        pictures = []
        while (read := video.read())[0]:
            pictures.append(read[1])
        assert len(pictures) == FRAMES
        sizes[name] = pictures[3].shape[:2]
        plain, drawn = pictures[BLIND].astype(int), pictures[3].astype(int)
        assert np.abs(drawn - plain).max() > 60
    assert sizes["cam_01.mp4"] == (120, 160) and sizes["mosaic.mp4"] == (240, 320)


def test_detections_are_messages_of_the_standard(classified, tmp_path):
    pytest.importorskip("sapient_msg", reason="sapient-msg is missing; pip install 'aerojax[sapient]'")
    from google.protobuf import json_format
    from sapient_msg.bsi_flex_335_v2_0 import location_pb2, sapient_message_pb2

    capture, clip = classified
    path = export_clip(capture, clip, ("sapient",), tmp_path, began="2026-05-01T12:00:00+02:00")["sapient"]
    messages = [json_format.Parse(line, sapient_message_pb2.SapientMessage()) for line in path.read_text().splitlines()]
    points = track_points(capture, clip)
    for message, point in zip(messages, points, strict=True):
        report = message.detection_report
        assert message.timestamp.ToMicroseconds() == round(1777629600_000_000 + 1e6 * point.time_s) and message.node_id
        assert (report.location.y, report.location.x, report.location.z) == point.place
        assert report.location.coordinate_system == location_pb2.LOCATION_COORDINATE_SYSTEM_LAT_LNG_DEG_M
        rate = report.enu_velocity
        assert (rate.east_rate, rate.north_rate, rate.up_rate) == point.velocity
        kinds = {kind.type: kind for kind in report.classification}
        assert sum(kind.confidence for kind in kinds.values()) == pytest.approx(1, abs=1e-5)
        subs = {sub.type: sub.confidence for sub in kinds["Air vehicle"].sub_class}
        assert subs["UAV rotary wing"] == pytest.approx(point.probabilities["drone"])
        assert len(report.report_id) == len(report.object_id) == 26
    assert len({m.detection_report.report_id for m in messages}) == len(messages)
    assert len({m.detection_report.object_id for m in messages}) == 1
    with pytest.raises(UserError, match="is no time") as refused:
        export_clip(capture, clip, ("sapient",), tmp_path, began="noon")
    assert refused.value.code == "invalid"
    with pytest.raises(UserError, match="has no origin") as refused:
        export_clip(dataclasses.replace(capture, origin=None), clip, ("sapient",), tmp_path)
    assert refused.value.code == "missing"


def test_ulids_sort_by_time():
    from datetime import UTC, datetime

    moment = datetime.fromtimestamp(1469918176.385, UTC)
    assert ulid(moment, 0)[:10] == "01ARYZ6S41"  # the example of ulid/javascript
    assert ulid(moment, 2**80 - 1)[10:] == "Z" * 16
