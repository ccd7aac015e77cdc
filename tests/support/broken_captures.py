"""One good small capture and many ways to break it: `BROKEN[name](folder)` writes a capture with one fault.

`EXPECTED[name]` holds what the error message must contain: the file or field at fault and a word of the complaint.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import jax.numpy as jnp
import numpy as np

from aerojax.capture.format import Capture, CaptureCamera, ObjectState, TrackedObject, Truth, write_capture_json
from aerojax.capture.write import write_frame
from aerojax.geometry.cameras import look_at

WIDTH, HEIGHT, FRAMES = 32, 24, 2
CENTRES = ((4.0, 0.0, 1.0), (-3.0, 3.0, 2.0), (-1.0, -4.0, 0.5))
BOX = (8.0, 6.0, 24.0, 18.0)


def make_camera(index: int, **changes: Any) -> CaptureCamera:
    """Camera `index` of the good capture; it looks at the origin."""
    name = f"cam_{index + 1:02d}"
    values = {
        "name": name,
        "width": WIDTH,
        "height": HEIGHT,
        "K": np.array([[40.0, 0.0, 16.0], [0.0, 40.0, 12.0], [0.0, 0.0, 1.0]]),
        "distortion_model": "none",
        "distortion": (),
        "world_from_cam": np.asarray(look_at(jnp.array(CENTRES[index]), jnp.zeros(3)), np.float64),
        "rgb": f"{name}/rgb/{{frame:06d}}.png",
        "mask": f"{name}/mask/{{frame:06d}}.png",
        "depth": f"{name}/depth/{{frame:06d}}.tiff",
        "time_offset_s": 0.0,
    }
    return CaptureCamera(**(values | changes))


def frame_images(camera: int, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colour, mask and depth of the good capture: a bright block before a gradient; cameras and frames differ."""
    rgb = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    rgb[..., 0] = np.arange(WIDTH) * 7
    rgb[..., 1] = 40 * camera + 20 * frame
    mask = np.zeros((HEIGHT, WIDTH), np.uint16)
    mask[6:18, 8:24] = 1
    rgb[mask > 0] = 200 + frame
    return rgb, mask, np.where(mask > 0, np.float32(3.5 + camera), np.float32(0))


def make_good(folder: Path) -> Capture:
    """Write the good capture: 3 cameras, 2 frames, masks, depth and truth."""
    cameras = tuple(make_camera(i) for i in range(3))
    names = [camera.name for camera in cameras]
    states = tuple(
        ObjectState(f, (0.1 * f, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), dict.fromkeys(names, BOX), dict.fromkeys(names, True))
        for f in range(FRAMES)
    )
    truth = Truth((TrackedObject(1, "drone", "block", states, source="made here", licence="CC0"),))
    capture = Capture(folder, 30.0, FRAMES, cameras, truth)
    for index, camera in enumerate(cameras):
        for frame in range(FRAMES):
            write_frame(folder, camera, frame, *frame_images(index, frame))
    write_capture_json(capture)
    return capture


def _edit(name: str, change: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        make_good(folder)
        path = folder / name
        raw = json.loads(path.read_text())
        change(raw)
        path.write_text(json.dumps(raw))  # writes NaN and Infinity as Python does

    return make


def _capture(change: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    return _edit("capture.json", change)


def _camera(index: int, **values: Any) -> Callable[[Path], None]:
    return _capture(lambda raw: raw["cameras"][index].update(values))


def _truth(change: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    return _edit("truth.json", change)


def _state(**values: Any) -> Callable[[Path], None]:
    return _truth(lambda raw: raw["objects"][0]["frames"][1].update(values))


def _files(change: Callable[[Path], Any]) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        make_good(folder)
        change(folder)

    return make


def _text(name: str, text: str) -> Callable[[Path], None]:
    return _files(lambda folder: (folder / name).write_text(text))


def _cut(name: str, keep: float) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        data = (folder / name).read_bytes()
        (folder / name).write_bytes(data[: int(len(data) * keep)])

    return _files(change)


def _image(name: str, image: np.ndarray) -> Callable[[Path], None]:
    return _files(lambda folder: cv2.imwrite(str(folder / name), image))


def _link(name: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        outside = folder.parent / (folder.name + "_outside.png")
        (folder / name).replace(outside)
        (folder / name).symlink_to(outside)

    return _files(change)


def _circle(folder: Path) -> None:
    make_good(folder)
    (folder / "cam_03/mask").rename(folder / "cam_03/elsewhere")
    (folder / "cam_03/mask").symlink_to(folder / "cam_03/mask")


def _transform(rotation: list[list[float]]) -> list[list[float]]:
    return [[*row, 5.0] for row in rotation] + [[0.0, 0.0, 0.0, 1.0]]


def write_video(path: Path, frames: int, size: tuple[int, int] = (WIDTH, HEIGHT), codec: str = "mp4v") -> None:
    """A small video whose frame i is grey with value 40 + 30·i."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 30.0, size)
    for frame in range(frames):
        writer.write(np.full((size[1], size[0], 3), 40 + 30 * frame, np.uint8))
    writer.release()


def _video(frames: int, size: tuple[int, int] = (WIDTH, HEIGHT)) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        _camera(0, rgb="cam_01/film.mp4")(folder)
        write_video(folder / "cam_01/film.mp4", frames, size)

    return make


def _play_list(folder: Path) -> None:
    _camera(0, rgb="cam_01/film.mp4")(folder)
    (folder / "cam_01/film.mp4").write_text("#EXTM3U\n#EXTINF:1,\nfile:///etc/hostname\n")


def _refusing(make: Callable[[Path], None]) -> Callable[[Path], None]:
    """The same capture, which is to be refused for files that are missing or damaged."""

    def change(folder: Path) -> None:
        make(folder)
        path = folder / "capture.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"missing": "refuse"}))

    return change


def _same_centre(raw: dict[str, Any]) -> None:
    for row in range(3):
        raw["cameras"][2]["world_from_cam"][row][3] = raw["cameras"][0]["world_from_cam"][row][3]


_GREY = np.zeros((HEIGHT, WIDTH), np.uint8)
_COLOURS = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
_COLOURS[2:9, 2:9, 0] = _COLOURS[12:20, 12:20, 1] = 255
_SHEAR = _transform([[1, 0.01, 0], [0, 1, 0], [0, 0, 1]])
_MIRROR = _transform([[1, 0, 0], [0, 1, 0], [0, 0, -1]])

_FAULTS: dict[str, tuple[Callable[[Path], None], tuple[str, ...]]] = {
    "no_capture_json": (_files(lambda f: (f / "capture.json").unlink()), ("capture.json", "missing")),
    "not_json": (_text("capture.json", "{'format': 1}"), ("capture.json", "not valid JSON")),
    "json_bomb": (_text("capture.json", "[" * 100_000), ("capture.json", "not valid JSON")),
    "json_list": (_text("capture.json", "[]"), ("capture.json", "JSON object")),
    "json_not_text": (_files(lambda f: (f / "capture.json").write_bytes(b"\xff\xfe\x00")), ("not valid JSON",)),
    "twice_the_key": (
        _files(lambda f: (f / "capture.json").write_text((f / "capture.json").read_text()[:-2] + ', "fps": 30.0}')),
        ("fps", "twice"),
    ),
    "unknown_format": (_capture(lambda r: r.update(format="colmap")), ("format", "colmap")),
    "unknown_version": (_capture(lambda r: r.update(version=2)), ("version", "must be 1")),
    "unknown_key": (_capture(lambda r: r.update(framerate=30)), ("framerate", "unknown key")),
    "unknown_camera_key": (_camera(1, fov=60), ("cameras[1].fov", "unknown key")),
    "missing_key": (_capture(lambda r: r["cameras"][1].pop("K")), ("cameras[1].K", "missing")),
    "cameras_no_list": (_capture(lambda r: r.update(cameras={}, truth=None)), ("cameras", "list")),
    "camera_no_object": (_capture(lambda r: r["cameras"].append(7)), ("cameras[3]", "object")),
    "fps_zero": (_capture(lambda r: r.update(fps=0)), ("fps", "positive")),
    "fps_text": (_capture(lambda r: r.update(fps="30")), ("fps", "finite number")),
    "fps_boolean": (_capture(lambda r: r.update(fps=True)), ("fps", "finite number")),
    "frames_negative": (_capture(lambda r: r.update(frames=-1)), ("frames", "whole number")),
    "frames_absurd": (_capture(lambda r: r.update(frames=10**12)), ("frames", "whole number")),
    "width_text": (_camera(0, width="32"), ("cameras[0].width", "whole number")),
    "name_empty": (
        _capture(lambda r: (r["cameras"][1].update(name=""), r.pop("truth"))),
        ("cameras[1].name", "printable"),
    ),
    "two_cameras": (_capture(lambda r: r.update(cameras=r["cameras"][:2], truth=None)), ("cameras", "at least 3")),
    "same_name": (_capture(lambda r: (r["cameras"][2].update(name="cam_01"), r.pop("truth"))), ("cameras[2].name",)),
    "same_centre": (_capture(_same_centre), ("cameras[2].world_from_cam", "same centre")),
    "focal_negative": (_camera(0, K=[[-40, 0, 16], [0, 40, 12], [0, 0, 1]]), ("cameras[0].K", "focal")),
    "K_transposed": (_camera(0, K=[[40, 0, 0], [0, 40, 0], [16, 12, 1]]), ("cameras[0].K", "transposed")),
    "K_nan": (_camera(0, K=[[float("nan"), 0, 16], [0, 40, 12], [0, 0, 1]]), ("cameras[0].K", "NaN")),
    "K_short": (_camera(0, K=[[40, 0, 16], [0, 40, 12]]), ("cameras[0].K", "3 rows")),
    "K_huge_integer": (_camera(0, K=[[10**400, 0, 16], [0, 40, 12], [0, 0, 1]]), ("cameras[0].K", "no finite")),
    "pose_sheared": (_camera(1, world_from_cam=_SHEAR), ("cameras[1].world_from_cam", "orthonormal")),
    "pose_mirrored": (_camera(1, world_from_cam=_MIRROR), ("cameras[1].world_from_cam", "reflection")),
    "pose_infinite": (_camera(1, world_from_cam=_transform([[1e999, 0, 0]] * 3)), ("cameras[1].world_from_cam", "inf")),
    "pose_last_row": (
        _camera(1, world_from_cam=[[1, 0, 0, 5], [0, 1, 0, 5], [0, 0, 1, 5], [0, 0, 1, 1]]),
        ("cameras[1].world_from_cam", "last row"),
    ),
    "lens_unknown": (_camera(2, distortion={"model": "kb8", "coefficients": []}), ("cameras[2].distortion", "kb8")),
    "lens_too_few": (
        _camera(2, distortion={"model": "opencv", "coefficients": [0.1, 0, 0]}),
        ("cameras[2].distortion.coefficients", "4 or 5 or 8 or 12 or 14"),
    ),
    "lens_nan": (
        _camera(2, distortion={"model": "opencv_fisheye", "coefficients": [0, 0, 0, float("nan")]}),
        ("cameras[2].distortion.coefficients", "finite"),
    ),
    "offset_infinite": (_camera(0, time_offset_s=float("inf")), ("cameras[0].time_offset_s", "finite")),
    "offset_beyond": (_camera(0, time_offset_s=1.0), ("cameras[0].time_offset_s", "longer than the capture")),
    "path_absolute": (_camera(0, rgb="/etc/{frame:06d}.png"), ("cameras[0].rgb", "absolute")),
    "path_drive": (_camera(0, rgb="C:{frame:06d}.png"), ("cameras[0].rgb", "absolute")),
    "path_up": (_camera(0, mask="../cam/{frame:06d}.png"), ("cameras[0].mask", "..")),
    "path_link": (_link("cam_02/rgb/000001.png"), ("cam_02/rgb/000001.png", "links out")),
    "path_circle": (_circle, ("cam_03/mask/000000.png", "links out")),
    "path_long": (_camera(0, rgb="a" * 300 + "{frame:06d}.png"), ("cameras[0].rgb", "longer than 240 bytes")),
    "path_control": (_camera(0, rgb="cam\u001b[31m/{frame}.png"), ("cameras[0].rgb", "control character")),
    "pattern_attribute": (_camera(0, rgb="cam_01/rgb/{frame.__class__}.png"), ("cameras[0].rgb", "{frame}")),
    "pattern_index": (_camera(0, rgb="cam_01/rgb/{frame[0]}.png"), ("cameras[0].rgb", "{frame}")),
    "pattern_width": (_camera(0, rgb="cam_01/rgb/{frame:0999999999d}.png"), ("cameras[0].rgb", "{frame}")),
    "pattern_other": (_camera(0, rgb="cam_01/rgb/{frame:06d}{x}.png"), ("cameras[0].rgb", "{frame}")),
    "pattern_none": (_camera(0, rgb="cam_01/rgb/000000.png"), ("cameras[0].rgb", "{frame}")),
    "pattern_format": (_camera(0, depth="cam_01/depth/{frame:06d}.npy"), ("cameras[0].depth", ".tiff")),
    "frame_missing": (
        _refusing(_files(lambda f: (f / "cam_02/rgb/000001.png").unlink())),
        ("cam_02/rgb/000001.png", "missing"),
    ),
    "missing_word": (_capture(lambda r: r.update(missing="ignore")), ("missing", "'drop' or 'refuse'")),
    "mask_kind": (_camera(0, mask_kind="soft"), ("cameras[0].mask_kind", "'ids' or 'picture'")),
    "folder_missing": (
        _files(lambda f: (f / "cam_03/mask").rename(f / "cam_03/elsewhere")),
        ("cam_03/mask/000000.png", "missing"),
    ),
    "rgb_size": (_image("cam_01/rgb/000001.png", np.zeros((24, 30, 3), np.uint8)), ("000001.png", "30×24")),
    "mask_size": (_image("cam_01/mask/000000.png", _GREY[:20]), ("cam_01/mask/000000.png", "32×20")),
    "mask_coloured": (_image("cam_01/mask/000000.png", _COLOURS), ("cam_01/mask/000000.png", "several colours")),
    "depth_integer": (_image("cam_01/depth/000000.tiff", _GREY), ("cam_01/depth/000000.tiff", "float32")),
    "rgb_empty": (_refusing(_text("cam_01/rgb/000000.png", "")), ("cam_01/rgb/000000.png", "empty")),
    "rgb_text": (_refusing(_text("cam_01/rgb/000000.png", "import os" * 9)), ("cam_01/rgb/000000.png", "not a PNG")),
    "rgb_cut": (_refusing(_cut("cam_01/rgb/000000.png", 0.6)), ("cam_01/rgb/000000.png", "cut short")),
    "depth_cut": (_refusing(_cut("cam_01/depth/000001.tiff", 0.6)), ("cam_01/depth/000001.tiff", "cut short")),
    "video_missing": (_camera(0, rgb="cam_01/film.mp4"), ("cam_01/film.mp4", "missing")),
    "video_short": (_refusing(_video(1)), ("cam_01/film.mp4", "has 1 frames")),
    "video_size": (_video(2, (64, 48)), ("cam_01/film.mp4", "64×48")),
    "video_play_list": (_play_list, ("cam_01/film.mp4", "is not an MP4")),
    "truth_file_missing": (_files(lambda f: (f / "truth.json").unlink()), ("truth.json", "missing")),
    "truth_outside": (_capture(lambda r: r.update(truth="../truth.json")), ("truth", "..")),
    "truth_not_json": (_text("truth.json", "objects: []"), ("truth.json", "not valid JSON")),
    "truth_unknown_camera": (
        _truth(lambda r: r["objects"][0]["frames"][0]["visible"].update(cam_09=False)),
        ("objects[0].frames[0].visible", "cam_09"),
    ),
    "truth_class": (_truth(lambda r: r["objects"][0].update({"class": "ufo"})), ("objects[0].class", "ufo")),
    "truth_id_zero": (_truth(lambda r: r["objects"][0].update(id=0)), ("objects[0].id", "whole number")),
    "truth_id_twice": (_truth(lambda r: r["objects"].append(r["objects"][0])), ("objects[1].id", "twice")),
    "truth_frame_missing": (_truth(lambda r: r["objects"][0]["frames"].pop()), ("objects[0].frames", "1 of 2")),
    "truth_frame_twice": (_state(frame=0), ("objects[0].frames[1].frame", "twice")),
    "truth_frame_beyond": (_state(frame=2), ("objects[0].frames[1].frame", "from 0 to 1")),
    "truth_quaternion": (_state(orientation_wxyz=[2, 0, 0, 0]), ("frames[1].orientation_wxyz", "unit length")),
    "truth_position": (_state(position=[0, 0, None]), ("frames[1].position", "finite")),
    "truth_box": (_truth(lambda r: r["objects"][0]["frames"][0]["bbox"].update(cam_01=[9, 9, 9, 12])), ("empty",)),
    "truth_no_box": (_truth(lambda r: r["objects"][0]["frames"][0]["bbox"].pop("cam_01")), ("bbox", "without a box")),
    "truth_key": (_truth(lambda r: r["objects"][0].update(label=1)), ("objects[0].label", "unknown key")),
}

BROKEN: dict[str, Callable[[Path], None]] = {name: make for name, (make, _) in _FAULTS.items()}
EXPECTED: dict[str, tuple[str, ...]] = {name: words for name, (_, words) in _FAULTS.items()}
