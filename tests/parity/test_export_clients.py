"""Exports as the tools read them that they are for; each test is skipped where its tool is not installed."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.export_examples import write_ball_dataset

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_mask
from aerojax.data.exports.export import export_dataset
from aerojax.data.exports.run_length import encode_mask
from aerojax.data.exports.sources import ExportOptions, find_sequences

# pycocotools 2.0.11 decodes through an array class of NumPy 1.
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
REMEDY = "install the tools of requirements.clients.lock with --no-deps"


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clients") / "dataset"
    write_ball_dataset(folder)
    return folder


@pytest.fixture(scope="module")
def exported(dataset):
    """Function that exports to a format once and gives the folder."""

    def export(name):
        target = dataset.parent / "out" / name
        return target if target.exists() else export_dataset(find_sequences(dataset), name, target.parent, OPTIONS)

    return export


OPTIONS = ExportOptions(images="hardlink")


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.98, 1.0])
def test_run_lengths_are_those_of_pycocotools(share):
    mask_tools = pytest.importorskip("pycocotools.mask", reason=f"pycocotools is missing; {REMEDY}")
    rng = np.random.default_rng(round(100 * share))
    noise = rng.random((61, 83)) < share
    disc = np.hypot(*np.meshgrid(np.arange(1280) - 700, np.arange(720) - 300)) < 400 * share
    for mask in (noise, disc, ~disc):
        ours = encode_mask(mask)
        theirs = mask_tools.encode(np.asfortranarray(mask.astype(np.uint8)))
        assert ours == {"size": list(theirs["size"]), "counts": theirs["counts"].decode()}
        np.testing.assert_array_equal(mask_tools.decode(ours), mask)


@pytest.mark.parametrize("kind", ["bbox", "segm"])
@pytest.mark.parametrize("split", ["train", "val"])
def test_coco_truth_scores_one(exported, kind, split):
    coco_tools = pytest.importorskip("pycocotools.coco", reason=f"pycocotools is missing; {REMEDY}")
    from pycocotools.cocoeval import COCOeval

    truth = coco_tools.COCO(str(exported("coco") / f"annotations/instances_{split}.json"))

    def score(shift):
        keys = ("image_id", "category_id", "bbox", "segmentation")
        found = [{key: a[key] for key in keys} | {"score": 0.9} for a in truth.dataset["annotations"]]
        for result in found:  # the label of the next class, where asked for
            result["category_id"] = (result["category_id"] + shift - 1) % 4 + 1
        evaluation = COCOeval(truth, truth.loadRes(found), kind)
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
        return evaluation.stats

    perfect = score(0)
    assert perfect[0] == perfect[1] == perfect[8] == 1.0  # AP, AP at 0.5, recall
    assert score(1)[0] < 0.1  # the check can fail


def test_supervision_reads_coco(exported, dataset):
    supervision = pytest.importorskip("supervision", reason=f"supervision is missing; {REMEDY}")
    coco = exported("coco")
    read = supervision.DetectionDataset.from_coco(
        str(coco / "images/train"), str(coco / "annotations/instances_train.json"), force_masks=True
    )
    capture = read_capture(dataset / "train/seq_b")
    found = detections(read, "seq_b__cam_03__000001")
    mask = read_mask(capture, 2, 1)
    assert len(read) == 18 and sorted(read.classes[i] for i in found.class_id) == ["bird", "drone"]
    for box, pixels, index in zip(found.xyxy, found.mask, found.class_id, strict=True):
        item = next(o for o in capture.truth.objects if o.class_name == read.classes[index])
        np.testing.assert_allclose(box, item.frames[1].bbox["cam_03"], atol=1e-4)
        np.testing.assert_array_equal(pixels, mask == item.object_id)


def test_supervision_reads_yolo(exported, dataset):
    supervision = pytest.importorskip("supervision", reason=f"supervision is missing; {REMEDY}")
    yolo = exported("yolo")
    read = supervision.DetectionDataset.from_yolo(
        str(yolo / "images/val"), str(yolo / "labels/val"), str(yolo / "data.yaml")
    )
    assert list(read.classes) == ["bird", "drone", "airplane", "helicopter"] and len(read) == 9
    capture = read_capture(dataset / "val/seq_c")
    for item in capture.truth.objects:
        found = detections(read, "seq_c__cam_02__000000")
        index = list(found.class_id).index(read.classes.index(item.class_name))
        np.testing.assert_allclose(found.xyxy[index], item.frames[0].bbox["cam_02"], atol=1e-3)


def detections(read, name):
    """Annotations of the image with this stem."""
    return next(found for path, _, found in read if name in path)


def test_ultralytics_finds_the_splits(exported):
    """Its rules, by hand: paths in data.yaml are relative to its folder, labels lie where /images/ is /labels/."""
    yaml = pytest.importorskip("yaml", reason="PyYAML is missing")
    yolo = exported("yolo")
    data = yaml.safe_load((yolo / "data.yaml").read_text())
    assert data["names"] == {0: "bird", 1: "drone", 2: "airplane", 3: "helicopter"} and data["nc"] == 4
    for split in ("train", "val"):
        images = sorted((yolo / data[split]).iterdir())
        assert images and all((yolo / "labels" / split / f"{image.stem}.txt").is_file() for image in images)


def test_trackeval_scores_one(exported, tmp_path):
    trackeval = pytest.importorskip("trackeval", reason=f"trackeval is missing; {REMEDY}")
    folder = exported("mot")
    for tracker, identity in (("perfect", lambda frame, number: number), ("swapping", lambda f, n: 10 * f + n)):
        results = tmp_path / "aerojax-train" / tracker / "data"
        results.mkdir(parents=True)
        for sequence in (folder / "aerojax-train").iterdir():
            rows = [line.split(",") for line in (sequence / "gt/gt.txt").read_text().splitlines()]
            lines = [[f, str(identity(int(f), int(n))), *box, "1", "-1", "-1", "-1"] for f, n, *box, _, _, _ in rows]
            (results / f"{sequence.name}.txt").write_text("".join(",".join(line) + "\n" for line in lines))
    settings = {"GT_FOLDER": str(folder), "TRACKERS_FOLDER": str(tmp_path), "BENCHMARK": "aerojax"}
    data = trackeval.datasets.MotChallenge2DBox(settings | {"DO_PREPROC": False, "PRINT_CONFIG": False})
    quiet = dict.fromkeys(("OUTPUT_SUMMARY", "OUTPUT_DETAILED", "PLOT_CURVES", "PRINT_CONFIG", "PRINT_RESULTS"), False)
    evaluator = trackeval.Evaluator(quiet | {"LOG_ON_ERROR": None, "TIME_PROGRESS": False})
    metrics = [trackeval.metrics.HOTA(), trackeval.metrics.CLEAR(), trackeval.metrics.Identity()]
    found = evaluator.evaluate([data], metrics)[0]["MotChallenge2DBox"]
    scores = {tracker: figures["COMBINED_SEQ"]["pedestrian"] for tracker, figures in found.items()}
    assert len(found["perfect"]) == 7  # six sequences and their total
    assert scores["perfect"]["HOTA"]["HOTA"].min() == 1.0
    assert scores["perfect"]["CLEAR"]["MOTA"] == scores["perfect"]["Identity"]["IDF1"] == 1.0
    assert scores["swapping"]["Identity"]["IDF1"] < 0.5  # the check can fail


def test_pycolmap_reads_rigs_frames_and_points(exported, dataset):
    pycolmap = pytest.importorskip("pycolmap", reason=f"pycolmap is missing; {REMEDY}")
    folder = exported("colmap") / "train/seq_a"
    model = pycolmap.Reconstruction(str(folder / "sparse/0"))
    assert (len(model.rigs), len(model.cameras), len(model.frames), len(model.images)) == (1, 3, 3, 9)
    capture = read_capture(dataset / "train/seq_a")
    by_name = {camera.name: camera for camera in capture.cameras}
    for image in model.images.values():
        camera_name, file_name = image.name.split("/")
        camera = by_name[camera_name]
        assert (folder / "images" / image.name).is_file() and (folder / "masks" / f"{image.name}.png").is_file()
        np.testing.assert_allclose(model.cameras[image.camera_id].calibration_matrix(), camera.K, atol=1e-12)
        np.testing.assert_allclose(image.projection_center(), camera.world_from_cam[:3, 3], atol=1e-9)
        state = capture.truth.objects[1].frames[int(file_name[:6])]
        mask = read_mask(capture, capture.cameras.index(camera), state.frame)
        rows, columns = np.nonzero(mask == 2)
        pixel = image.project_point(np.array(state.position))
        if state.visibility[camera_name] == 1:  # as in the unit test of nerfstudio's convention
            assert np.abs(pixel - [columns.mean() + 0.5, rows.mean() + 0.5]).max() < 0.6
        for point in image.points2D:
            assert np.abs(image.project_point(model.points3D[point.point3D_id].xyz) - point.xy).max() < 1e-9
    positions = {tuple(np.round(p.xyz, 9)) for p in model.points3D.values()}
    states = [o.frames[f].position for o in capture.truth.objects for f in range(3)]
    assert positions <= {tuple(np.round(p, 9)) for p in states} and len(positions) >= 5


def test_coco_keeps_the_network(exported, dataset):
    """Cameras come back from the export's extra keys, bit by bit."""
    images = json.loads((exported("coco") / "annotations/instances_val.json").read_text())["images"]
    cameras = {camera.name: camera for camera in read_capture(dataset / "val/seq_c").cameras}
    for image in images:
        camera = cameras[image["camera"]]
        np.testing.assert_array_equal(np.array(image["K"]), camera.K)
        np.testing.assert_array_equal(np.array(image["world_from_cam"]), camera.world_from_cam)
