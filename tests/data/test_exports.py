"""Exports of captures against numbers worked out by hand and by independent maths; every refusal is named."""

from __future__ import annotations

import dataclasses
import json
import struct
import zlib

import cv2
import numpy as np
import pytest
from support.export_examples import FRAMES, HEIGHT, WIDTH, write_ball_dataset, write_balls

from aerojax.capture.codecs.orientation import has_orientation
from aerojax.capture.format import Truth, read_capture, write_capture_json
from aerojax.capture.frames import read_mask, read_rgb
from aerojax.capture.paths import safe_name
from aerojax.core.errors import UserError
from aerojax.data.exports.export import FORMATS, chosen_formats, export_dataset, find_notices
from aerojax.data.exports.replicator import camera_parameters
from aerojax.data.exports.run_length import encode_mask
from aerojax.data.exports.sources import ExportOptions, find_sequences, stable_id

BY_CAMERA = (
    *("bbox", "visible", "truncated", "visibility", "visible_box", "projected_box", "surface_centroid"),
    "projected_corners",
)
SEEN = 16  # of 2 balls in 3 frames by 3 cameras, one ball is out of two views in the last frame


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A data set of three sequences and its exports to every format."""
    folder = tmp_path_factory.mktemp("exports")
    write_ball_dataset(folder / "dataset")
    sequences = find_sequences(folder / "dataset")
    for name in FORMATS:
        export_dataset(sequences, name, folder / "out", ExportOptions(), workers=2)
    return folder


def files_of(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_run_lengths_by_hand():
    # Columns: 0 0 1 | 1 1 1 | 0 0 0 gives runs 2, 4, 3, which are single characters from "0" on.
    mask = np.array([[0, 1, 0], [0, 1, 0], [1, 1, 0]], bool)
    assert encode_mask(mask) == {"size": [3, 3], "counts": "243"}
    assert encode_mask(np.ones((2, 2), bool))["counts"] == "04"
    # A run of 100 = 3·32 + 4: low group 4 with the mark that more follows, then 3.
    assert encode_mask(np.zeros((10, 10), bool))["counts"] == chr(48 + 4 + 32) + chr(48 + 3)


def test_sequences_of_a_data_set_a_folder_and_a_capture(made):
    dataset = made / "dataset"
    assert [(s.split, s.name) for s in find_sequences(dataset)] == [
        ("train", "seq_a"),
        ("train", "seq_b"),
        ("val", "seq_c"),
    ]
    assert [(s.split, s.name) for s in find_sequences(dataset / "train")] == [("all", "seq_a"), ("all", "seq_b")]
    assert [(s.split, s.name) for s in find_sequences(dataset / "val/seq_c")] == [("all", "seq_c")]


def test_names_and_ids_are_safe_and_stable():
    assert safe_name("Kamera 1/../ä__b") == "Kamera_1_.._b"
    assert safe_name("..") == "unnamed"
    assert stable_id("train", "seq_a", "cam_01", 0) == 4277578070928217  # as in every run before
    ids = {stable_id("x", i) for i in range(2000)}
    assert len(ids) == 2000 and min(ids) > 0 and max(ids) < 2**52


def test_coco_content(made):
    coco = json.loads((made / "out/coco/annotations/instances_train.json").read_text())
    assert [c["name"] for c in coco["categories"]] == ["bird", "drone", "airplane", "helicopter"]
    assert all(c["isthing"] == 1 for c in coco["categories"])
    assert len(coco["images"]) == 2 * 3 * FRAMES and len(coco["annotations"]) == 2 * SEEN
    capture = read_capture(made / "dataset/train/seq_a")
    image = next(i for i in coco["images"] if (i["sequence"], i["camera"], i["frame"]) == ("seq_a", "cam_01", 1))
    assert (made / "out/coco/images/train" / image["file_name"]).is_file()
    found = {a["instance_id"]: a for a in coco["annotations"] if a["image_id"] == image["id"]}
    mask = read_mask(capture, 0, 1)
    for number, state in ((o.object_id, o.frames[1]) for o in capture.truth.objects):
        x0, y0, x1, y1 = state.bbox["cam_01"]
        assert found[number]["bbox"] == [x0, y0, x1 - x0, y1 - y0]
        assert found[number]["area"] == np.sum(mask == number)
        assert found[number]["truncated"] == (number == 1)
        assert found[number]["visibility"] == state.visibility["cam_01"]
        x0, y0, x1, y1 = state.projected_box["cam_01"]
        assert found[number]["amodal_bbox"] == [x0, y0, x1 - x0, y1 - y0]
    tracks = {(a["track_id"], a["identity"]) for a in coco["annotations"]}
    assert len(tracks) == 4  # two balls in each of two sequences


def test_yolo_content(made):
    yolo = made / "out/yolo"
    labels = {p.stem: p.read_text() for p in (yolo / "labels/train").iterdir()}
    assert set(labels) == {p.stem for p in (yolo / "images/train").iterdir()}
    capture = read_capture(made / "dataset/train/seq_b")
    rows = [line.split() for line in labels["seq_b__cam_02__000001"].splitlines()]
    for row, item in zip(rows, capture.truth.objects, strict=True):
        x0, y0, x1, y1 = item.frames[1].bbox["cam_02"]
        assert int(row[0]) == {"drone": 1, "bird": 0}[item.class_name]
        wanted = [(x0 + x1) / 2 / WIDTH, (y0 + y1) / 2 / HEIGHT, (x1 - x0) / WIDTH, (y1 - y0) / HEIGHT]
        np.testing.assert_allclose([float(v) for v in row[1:]], wanted, atol=1e-7)
    assert len(labels["seq_b__cam_01__000002"].splitlines()) == 1  # the other ball has left


def test_mot_content(made):
    folder = made / "out/mot/aerojax-val/seq_c__cam_01"
    rows = [line.split(",") for line in (folder / "gt/gt.txt").read_text().splitlines()]
    assert [(row[0], row[1]) for row in rows] == [("1", "1"), ("1", "2"), ("2", "1"), ("2", "2"), ("3", "2")]
    assert "seqLength=3\nimWidth=320\nimHeight=240\nimExt=.png" in (folder / "seqinfo.ini").read_text()
    assert json.loads((folder / "gt/objects.json").read_text())["1"] == {"class": "drone", "identity": "ball_red"}
    assert sorted(p.name for p in (folder / "img1").iterdir()) == ["000001.png", "000002.png", "000003.png"]


def opengl_pixel(frame, point):
    """Pixel by camera-to-world with OpenGL axes: behind the camera z > 0, y up; nothing shared with the package."""
    inverse = np.linalg.inv(np.array(frame["transform_matrix"]))
    x, y, z, _ = inverse @ [*point, 1.0]
    assert z < 0
    return np.array([frame["cx"] + frame["fl_x"] * x / -z, frame["cy"] - frame["fl_y"] * y / -z])


def test_nerfstudio_projects_onto_the_mask(made):
    folder = made / "out/nerfstudio/train/seq_a"
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    capture = read_capture(made / "dataset/train/seq_a")
    assert len(frames) == 3 * FRAMES
    for frame in frames:
        state = capture.truth.objects[1].frames[frame["frame_index"]]
        if state.visibility[frame["camera"]] < 1:
            continue
        index = [c.name for c in capture.cameras].index(frame["camera"])
        rows, columns = np.nonzero(read_mask(capture, index, frame["frame_index"]) == 2)
        centroid = np.array([columns.mean() + 0.5, rows.mean() + 0.5])
        # A ball's outline is an ellipse whose centre lies up to r²·tan(angle)·f/d² = 0.4 px off the centre's pixel.
        assert np.abs(opengl_pixel(frame, state.position) - centroid).max() < 0.6
        kept = cv2.imread(str(folder / frame["mask_path"]), cv2.IMREAD_UNCHANGED)
        depth = np.load(folder / frame["depth_file_path"])
        np.testing.assert_array_equal(kept > 0, depth > 0)
        middle = depth[int(centroid[1]), int(centroid[0])] / 1000
        distance = np.linalg.norm(np.array(state.position) - np.array(frame["transform_matrix"])[:3, 3])
        assert abs(middle - (distance - 0.6)) < 0.1
    instant = json.loads((folder / "transforms_000001.json").read_text())["frames"]
    assert instant == [frame for frame in frames if frame["frame_index"] == 1]


def test_replicator_content(made):
    folder = made / "out/replicator/train/seq_a/cam_01"
    boxes = np.load(folder / "bounding_box_2d_tight/bounding_box_2d_tight_0000.npy")
    labels = json.loads((folder / "bounding_box_2d_tight/bounding_box_2d_tight_labels_0000.json").read_text())
    paths = json.loads((folder / "bounding_box_2d_tight/bounding_box_2d_tight_prim_paths_0000.json").read_text())
    ids = cv2.imread(str(folder / "instance_segmentation/instance_segmentation_0000.png"), cv2.IMREAD_UNCHANGED)
    mapping = json.loads((folder / "instance_segmentation/instance_segmentation_mapping_0000.json").read_text())
    depth = np.load(folder / "distance_to_image_plane/distance_to_image_plane_0000.npy")
    assert boxes.dtype.names == ("semanticId", "x_min", "y_min", "x_max", "y_max", "occlusionRatio")
    assert len(boxes) == 2 and ids.dtype == np.uint16 and mapping["0"] == "BACKGROUND" and depth.dtype == np.float32
    for box, path in zip(boxes, paths, strict=True):
        number = next(int(key) for key, value in mapping.items() if value == path)
        rows, columns = np.nonzero(ids == number)
        corners = (columns.min(), rows.min(), columns.max(), rows.max())
        assert (box["x_min"], box["y_min"], box["x_max"], box["y_max"]) == corners
        assert path.endswith(labels[str(box["semanticId"])]["class"])
    assert boxes[0]["occlusionRatio"] == 0 and boxes[1]["occlusionRatio"] > 0.3
    np.testing.assert_array_equal(np.isinf(depth), ids == 0)
    normals = cv2.imread(str(folder / "normals/normals_0000.png"))[..., ::-1] / 127.5 - 1
    assert np.abs(np.linalg.norm(normals[ids > 0], axis=-1) - 1).max() < 0.01 and normals[ids == 0].max() == -1
    to_camera = read_capture(made / "dataset/train/seq_a").cameras[0].world_from_cam[:3, 2]
    assert (normals[ids > 0] @ to_camera).max() < 0.1  # against the camera's axis: what is seen faces it


def test_camera_parameters_are_those_of_usd(made):
    """USD's own camera and frustum make the same projection and view from aperture, offsets and focal length."""
    from pxr import Gf

    camera = read_capture(made / "dataset/train/seq_a").cameras[1]
    given = camera_parameters(camera)
    usd = Gf.Camera()
    usd.horizontalAperture, usd.verticalAperture = given["cameraAperture"]
    usd.horizontalApertureOffset, usd.verticalApertureOffset = given["cameraApertureOffset"]
    usd.focalLength, usd.clippingRange = given["cameraFocalLength"], Gf.Range1f(0.01, 1e6)
    view = np.array(given["cameraViewTransform"]).reshape(4, 4)
    usd.transform = Gf.Matrix4d(np.linalg.inv(view))
    projection = np.array(usd.frustum.ComputeProjectionMatrix())
    ours = np.array(given["cameraProjection"]).reshape(4, 4)
    np.testing.assert_allclose(ours[:3, [0, 1, 3]], projection[:3, [0, 1, 3]], atol=1e-6)
    np.testing.assert_allclose(view, np.array(usd.frustum.ComputeViewMatrix()), atol=1e-9)
    point = np.array([-0.8, 0.2, 8.2, 1.0])
    clip = point @ view @ ours
    pixel = (clip[:2] / clip[3] * [1, -1] + 1) / 2 * [WIDTH, HEIGHT]
    in_camera = np.linalg.inv(camera.world_from_cam) @ point
    wanted = camera.K @ in_camera[:3] / in_camera[2]
    np.testing.assert_allclose(pixel, wanted[:2], atol=1e-9)


def test_flat_layout(made, tmp_path):
    options = ExportOptions(depth=False, replicator_layout="flat")
    export_dataset(find_sequences(made / "dataset/val"), "replicator", tmp_path, options)
    names = {p.name for p in (tmp_path / "replicator/all/seq_c/cam_03").iterdir()}
    assert {"rgb_0000.png", "instance_segmentation_0002.png", "camera_params_0001.json"} <= names
    assert not any("distance" in name for name in names)


@pytest.mark.parametrize("name", FORMATS)
def test_runs_and_workers_change_nothing(made, tmp_path, name):
    again = export_dataset(find_sequences(made / "dataset"), name, tmp_path, ExportOptions(), workers=1)
    assert files_of(again) == files_of(made / "out" / name)
    assert sorted(p.name for p in tmp_path.iterdir()) == [f".{name}.json", name]


def test_notices_go_along(made, tmp_path):
    (tmp_path / "LICENSE").write_text("CC0")
    assert find_notices(made) == ()
    sequences, notices = find_sequences(made / "dataset/val"), find_notices(tmp_path)
    out = export_dataset(sequences, "yolo", tmp_path, ExportOptions(), notices=notices)
    assert (out / "LICENSE").read_text() == "CC0"


@pytest.mark.parametrize("how", ["hardlink", "symlink"])
def test_images_are_linked(made, tmp_path, how):
    out = export_dataset(find_sequences(made / "dataset"), "yolo", tmp_path / "out", ExportOptions(images=how))
    image = out / "images/train/seq_a__cam_01__000000.png"
    source = made / "dataset/train/seq_a/cam_01/rgb/000000.png"
    assert image.samefile(source) and image.is_symlink() == (how == "symlink")


def test_lenses_are_undistorted(tmp_path):
    capture = write_balls(tmp_path / "bent")
    lens = [
        dataclasses.replace(c, distortion_model="opencv", distortion=(-0.3, 0.1, 0.0, 0.0)) for c in capture.cameras
    ]
    write_capture_json(dataclasses.replace(capture, cameras=tuple(lens)), overwrite=True)
    out = export_dataset(find_sequences(tmp_path / "bent"), "coco", tmp_path, ExportOptions(images="hardlink"))
    image = cv2.imread(str(out / "images/all/bent__cam_01__000000.png"))[..., ::-1] / 255.0
    straight = read_rgb(read_capture(tmp_path / "bent"), 0, 0)
    raw = cv2.imread(str(tmp_path / "bent/cam_01/rgb/000000.png"))[..., ::-1] / 255.0
    assert np.abs(image - straight).max() < 1 / 255 < np.abs(image - raw).max()


def test_late_cameras_lack_frames(tmp_path):
    capture = write_balls(tmp_path / "late")
    late = dataclasses.replace(capture.cameras[0], time_offset_s=1 / 30)
    write_capture_json(dataclasses.replace(capture, cameras=(late, *capture.cameras[1:])), overwrite=True)
    sequences = find_sequences(tmp_path / "late")
    out = export_dataset(sequences, "mot", tmp_path / "out", ExportOptions())
    assert "seqLength=2" in (out / "aerojax-all/late__cam_01/seqinfo.ini").read_text()
    first = (out / "aerojax-all/late__cam_01/img1/000001.png").read_bytes()
    assert first == (tmp_path / "late/cam_01/rgb/000000.png").read_bytes()  # shows the capture's frame 1
    frames = export_dataset(sequences, "colmap", tmp_path / "out", ExportOptions()) / "all/late/sparse/0/frames.txt"
    assert [line.split()[9] for line in frames.read_text().splitlines()] == ["2", "3", "3"]


@pytest.mark.parametrize(
    ("value", "named"),
    [("kitti", "unknown format 'kitti'"), (["coco", "coco"], "twice"), ([], "names no format"), (3, "names no format")],
)
def test_unknown_formats_are_named(value, named):
    with pytest.raises(UserError, match=named):
        chosen_formats(value)
    assert chosen_formats(["yolo", "coco"]) == ("yolo", "coco") and chosen_formats("mot") == ("mot",)


def test_existing_export_is_kept(made, tmp_path):
    sequences = find_sequences(made / "dataset/val")
    (tmp_path / "yolo").mkdir()
    (tmp_path / "yolo/mine.txt").write_text("keep")
    with pytest.raises(UserError, match="there is an export already"):
        export_dataset(sequences, "yolo", tmp_path, ExportOptions())
    assert (tmp_path / "yolo/mine.txt").read_text() == "keep"
    export_dataset(sequences, "yolo", tmp_path, ExportOptions(), overwrite=True)
    assert not (tmp_path / "yolo/mine.txt").exists() and (tmp_path / "yolo/data.yaml").is_file()


def test_the_same_export_is_left_as_it_is(made, tmp_path):
    """So an export to several formats that was killed goes on."""
    sequences = find_sequences(made / "dataset/val")
    for images in ("hardlink", "copy"):
        target = export_dataset(sequences, "yolo", tmp_path, ExportOptions(images), overwrite=True)
        (target / "mark").write_text("made once")
        assert export_dataset(sequences, "yolo", tmp_path, ExportOptions(images)) == target
        assert (target / "mark").exists()
    train = find_sequences(made / "dataset/train")
    for other, options in ((train, ExportOptions()), (sequences, ExportOptions(depth=False))):
        with pytest.raises(UserError, match="there is an export already"):
            export_dataset(other, "yolo", tmp_path, options)


def test_a_broken_sequence_leaves_nothing(tmp_path):
    write_ball_dataset(tmp_path / "dataset")
    folder = tmp_path / "dataset/train/seq_b"
    write_capture_json(dataclasses.replace(read_capture(folder), missing="refuse"), overwrite=True)
    (folder / "cam_02/mask/000001.png").unlink()
    with pytest.raises(UserError, match=r"000001\.png"):
        export_dataset(find_sequences(tmp_path / "dataset"), "coco", tmp_path / "out", ExportOptions(), workers=2)
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("name", ["coco", "yolo", "mot", "replicator"])
def test_truth_is_required(tmp_path, name):
    capture = write_balls(tmp_path / "seq")
    write_capture_json(dataclasses.replace(capture, truth=None), overwrite=True)
    with pytest.raises(UserError, match=r"has no truth\.json"):
        export_dataset(find_sequences(tmp_path / "seq"), name, tmp_path / "out", ExportOptions())


@pytest.mark.parametrize("name", ["colmap", "nerfstudio", "replicator"])
def test_skew_is_refused(tmp_path, name):
    capture = write_balls(tmp_path / "seq")
    K = capture.cameras[0].K.copy()
    K[0, 1] = 0.5
    cameras = (dataclasses.replace(capture.cameras[0], K=K), *capture.cameras[1:])
    write_capture_json(dataclasses.replace(capture, cameras=cameras), overwrite=True)
    with pytest.raises(UserError, match="cam_01 has skew"):
        export_dataset(find_sequences(tmp_path / "seq"), name, tmp_path / "out", ExportOptions())


def test_the_largest_id_does_not_fit_replicator(tmp_path):
    capture = write_balls(tmp_path / "seq")
    for path in (tmp_path / "seq").glob("*/mask/*.png"):
        mask = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(path), np.where(mask == 2, np.uint16(65535), mask))
    objects = (capture.truth.objects[0], dataclasses.replace(capture.truth.objects[1], object_id=65535))
    write_capture_json(dataclasses.replace(capture, truth=Truth(objects)), overwrite=True)
    sequences = find_sequences(tmp_path / "seq")
    with pytest.raises(UserError, match="object id 65535 does not fit"):
        export_dataset(sequences, "replicator", tmp_path / "out", ExportOptions())
    coco = export_dataset(sequences, "coco", tmp_path / "out", ExportOptions()) / "annotations/instances_all.json"
    assert {a["instance_id"] for a in json.loads(coco.read_text())["annotations"]} == {1, 65535}


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("kind", ["rgb", "mask"])
def test_a_missing_view_is_left_out(tmp_path, name, kind):
    write_balls(tmp_path / "seq")
    (tmp_path / f"seq/cam_02/{kind}/000001.png").unlink()
    out = export_dataset(find_sequences(tmp_path / "seq"), name, tmp_path / "out", ExportOptions())
    written = [p for p in out.rglob("*.png") if "cam_02" in str(p) and ("1." in p.name) and "rgb" in str(p)]
    assert written == [] and len(list(out.rglob("*.png"))) > 0


def test_colliding_names_are_told_apart(tmp_path):
    for name in ("a b", "a_b", "第一", "第二", "左1", "右1"):
        write_balls(tmp_path / name)
    names = {s.folder.name: s.name for s in find_sequences(tmp_path)}
    assert names["a_b"] == "a_b" and names["第一"] == "u7b2cu4e00" and names["第二"] == "u7b2cu4e8c"
    assert names["a b"].startswith("a_b-") and len(set(names.values())) == 6
    assert {s.folder.name: s.name for s in find_sequences(tmp_path)} == names
    with pytest.raises(UserError, match=r"holds no capture\.json"):
        find_sequences(tmp_path / "a b/cam_01")


@pytest.mark.parametrize("name", FORMATS)
def test_cameras_of_any_script_are_exported_apart(tmp_path, name):
    capture = write_balls(tmp_path / "第一")
    renamed = dict(zip(("cam_01", "cam_02", "cam_03"), ("左", "右", "cam ä"), strict=True))
    cameras = tuple(dataclasses.replace(c, name=renamed[c.name]) for c in capture.cameras)
    states = [
        dataclasses.replace(
            o,
            frames=tuple(
                dataclasses.replace(s, **{k: {renamed[c]: v for c, v in getattr(s, k).items()} for k in BY_CAMERA})
                for s in o.frames
            ),
        )
        for o in capture.truth.objects
    ]
    write_capture_json(dataclasses.replace(capture, cameras=cameras, truth=Truth(tuple(states))), overwrite=True)
    out = export_dataset(find_sequences(tmp_path / "第一"), name, tmp_path / "out", ExportOptions())
    paths = [str(p.relative_to(out)) for p in out.rglob("*.png")]
    assert all(path.isascii() for path in paths)
    for camera in ("u5de6", "u53f3", "cam"):
        assert sum(camera in path and "mask" not in path for path in paths) >= FRAMES


def oriented_jpeg(image: np.ndarray, orientation: int) -> bytes:
    """A JPEG whose EXIF says how to turn it."""
    tiff = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0)
    segment = b"\xff\xe1" + struct.pack(">H", 8 + len(tiff)) + b"Exif\0\0" + tiff
    data = cv2.imencode(".jpg", image[..., ::-1])[1].tobytes()
    return data[:2] + segment + data[2:]


def oriented_png(image: np.ndarray, orientation: int) -> bytes:
    """A PNG with the same tag in an eXIf chunk."""
    tiff = b"MM\0*" + struct.pack(">IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0)
    chunk = struct.pack(">I", len(tiff)) + b"eXIf" + tiff + struct.pack(">I", zlib.crc32(b"eXIf" + tiff))
    data = cv2.imencode(".png", image[..., ::-1])[1].tobytes()
    return data[:33] + chunk + data[33:]


@pytest.mark.parametrize("orientation", [1, 3, 6])
@pytest.mark.parametrize("how", ["copy", "hardlink"])
@pytest.mark.parametrize(("suffix", "encode"), [(".jpg", oriented_jpeg), (".png", oriented_png)])
def test_exports_carry_no_orientation(tmp_path, suffix, encode, how, orientation):
    capture = write_balls(tmp_path / "seq")
    for path in (tmp_path / "seq").glob("*/rgb/*.png"):
        image = cv2.imread(str(path))[..., ::-1]
        path.unlink()
        path.with_suffix(suffix).write_bytes(encode(image, orientation))
    cameras = tuple(dataclasses.replace(c, rgb=c.rgb.replace(".png", suffix)) for c in capture.cameras)
    write_capture_json(dataclasses.replace(capture, cameras=cameras), overwrite=True)
    stored = read_rgb(read_capture(tmp_path / "seq"), 0, 0)
    out = export_dataset(find_sequences(tmp_path / "seq"), "coco", tmp_path / "out", ExportOptions(images=how))
    written = sorted(out.rglob(f"*{suffix}"))
    assert len(written) == 3 * FRAMES
    for path in written:
        assert not has_orientation(path)
    # As a client reads it, that applies what tags say: the stored pixels, beside which the boxes are right.
    client = cv2.imread(str(next(p for p in written if "cam_01" in str(p))))[..., ::-1]
    np.testing.assert_array_equal(client.astype(np.float32) / np.float32(255), stored)
