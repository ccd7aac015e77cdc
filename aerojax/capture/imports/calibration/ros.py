"""ROS 1 and ROS 2 bags: CameraInfo and transforms for the cameras, Image and CompressedImage for what they saw.

The pure-Python package `rosbags` reads them (extra `ros`). Frames of reference are those of /tf_static and /tf; the
frame that CameraInfo names is the optical one (+z forward, REP 103), whose axes are OpenCV's. CameraInfo comes from
OpenCV, which puts the centre of the top-left pixel at (0, 0).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from aerojax.capture.imports.calibration.base import CalibratedCamera, Calibration, CalibrationConfig, transform_of
from aerojax.capture.imports.calibration.documents import rigid
from aerojax.capture.imports.calibration.opencv import lens_of
from aerojax.capture.paths import safe_name
from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes

_INFO, _TREE = "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"
_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_TO_BGR = {
    "rgb8": cv2.COLOR_RGB2BGR,
    "rgba8": cv2.COLOR_RGBA2BGR,
    "bgra8": cv2.COLOR_BGRA2BGR,
    "mono8": cv2.COLOR_GRAY2BGR,
}


@dataclass(frozen=True)
class RosConfig(CalibrationConfig):
    """A bag: a folder with metadata.yaml, or a .bag, .db3 or .mcap file.

    world_frame: the frame that becomes the world; the root of the transforms if None.
    pixel_centre: where the messages have the centre of the top-left pixel.
    """

    name: Literal["ros"] = "ros"
    world_frame: str | None = None
    pixel_centre: float = 0.0

    def read(self, source: Path) -> Calibration:
        """Cameras by the names of their topics, in alphabetic order."""
        infos: dict[str, Any] = {}
        parents: dict[str, tuple[str, Float64[np.ndarray, "4 4"]]] = {}
        with opened(source) as bag:
            for topic, message in _messages(bag, (_INFO, _TREE)):
                if message.__msgtype__ == _INFO:
                    infos.setdefault(topic, message)
                    continue
                for stamped in message.transforms:
                    child, where = stamped.child_frame_id, f"{source}: {topic}: {stamped.child_frame_id}"
                    parents.setdefault(child, (stamped.header.frame_id, _transform(stamped.transform, where)))
        if not infos:
            raise UserError("missing", f"{source}: holds no CameraInfo", "record the camera_info topics too")
        cameras = []
        for topic, info in sorted(infos.items()):
            pose = _pose(info.header.frame_id, parents, self.world_frame, f"{source}: {topic}")
            cameras.append(_camera(topic, info, pose, self.pixel_centre, f"{source}: {topic}"))
        return Calibration(tuple(cameras))


@contextmanager
def opened(source: Path) -> Iterator[Any]:
    """The bag's reader.

    Raises:
        UserError: `rosbags` is not there, or it cannot read the bag.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise UserError("unavailable", "bags need the package rosbags", "pip install 'aerojax[ros]'") from None
    folder = (
        source.parent if source.suffix in (".db3", ".mcap") and (source.parent / "metadata.yaml").is_file() else source
    )
    try:
        reader = AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except (AnyReaderError, OSError, ValueError) as error:
        raise UserError(
            "unreadable", f"{source}: is no bag that can be read: {str(error)[:160]}", "record it again"
        ) from None
    try:
        yield reader
    finally:
        reader.close()


def is_bag(source: Path) -> bool:
    """Whether a path looks like a bag of ROS."""
    if source.is_dir():
        return (source / "metadata.yaml").is_file() or any(source.glob("*.mcap")) or any(source.glob("*.db3"))
    return source.suffix in (".bag", ".db3", ".mcap")


def _messages(bag: Any, kinds: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    chosen = [connection for connection in bag.connections if connection.msgtype in kinds]
    for connection, _, raw in bag.messages(connections=chosen):
        yield connection.topic, bag.deserialize(raw, connection.msgtype)


def _transform(transform: Any, where: str) -> Float64[np.ndarray, "4 4"]:
    """parent_from_child."""
    turn, moved = transform.rotation, transform.translation
    x, y, z, w = np.array([turn.x, turn.y, turn.z, turn.w]) / np.linalg.norm([turn.x, turn.y, turn.z, turn.w])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    return rigid(transform_of(rotation, np.array([moved.x, moved.y, moved.z])), where)


def _pose(
    frame: str, parents: dict[str, tuple[str, Float64[np.ndarray, "4 4"]]], world: str | None, where: str
) -> Float64[np.ndarray, "4 4"]:
    """world_from_cam: the product of the transforms up to the world or the root."""
    pose, seen = np.eye(4), [frame]
    while frame in parents and frame != world:
        frame, parent_from_child = parents[frame]
        pose = parent_from_child @ pose
        if frame in seen:
            raise UserError("invalid", f"{where}: the transforms run in a circle", "correct the tree of frames")
        seen.append(frame)
    if world is not None and frame != world:
        raise UserError("missing", f"{where}: {world} is not above {seen[0]}", f"its frames are {', '.join(seen)}")
    if len(seen) == 1 and world is None:
        raise UserError("missing", f"{where}: no transform leads to {frame}", "record /tf_static too")
    return pose


def camera_name(topic: str) -> str:
    """The camera of a topic: its namespace, such as `front_left` of /front_left/camera_info."""
    parts = [part for part in topic.split("/")[:-1] if part]
    if parts and topic.endswith("/compressed"):
        parts = parts[:-1]
    return safe_name("_".join(parts) or topic.strip("/"))


def _camera(topic: str, info: Any, pose: Float64[np.ndarray, "4 4"], centre: float, where: str) -> CalibratedCamera:
    document = {
        "K": info.k if hasattr(info, "k") else info.K,
        "D": info.d if hasattr(info, "d") else info.D,
        "distortion_model": info.distortion_model,
        "width": info.width,
        "height": info.height,
    }
    return CalibratedCamera(name=camera_name(topic), world_from_cam=pose, **lens_of(document, where, centre))


def extract_images(source: Path, folder: Path, fps: float) -> int:
    """Write the images of a bag as `folder/<camera>/rgb/<frame>.png` (or .jpg), and give the number of frames.

    Frame j is the image nearest to j/fps after the first image of the camera that began last; where none is within
    half a frame, the file is left out.

    Raises:
        UserError: the bag holds no images, or one cannot be decoded.
    """
    stamps: dict[str, list[float]] = {}
    with opened(source) as bag:
        for topic, message in _messages(bag, _IMAGES):
            stamps.setdefault(topic, []).append(_seconds(message))
        if not stamps:
            raise UserError("missing", f"{source}: holds no images", "record the image topics too, or set images=")
        begin = max(times[0] for times in stamps.values())
        frames = int((max(times[-1] for times in stamps.values()) - begin) * fps + 0.5) + 1
        wanted = {topic: _nearest(np.array(times), begin, fps, frames) for topic, times in stamps.items()}
        counts = dict.fromkeys(stamps, -1)
        for topic, message in _messages(bag, _IMAGES):
            counts[topic] += 1
            for frame in wanted[topic].get(counts[topic], ()):
                suffix, content = _encoded(message, f"{source}: {topic}")
                write_bytes(folder / camera_name(topic) / "rgb" / f"{frame:06d}{suffix}", content)
    return frames


def _nearest(times: Float64[np.ndarray, "image"], begin: float, fps: float, frames: int) -> dict[int, list[int]]:
    """Frames by the number of the image that shows them."""
    found: dict[int, list[int]] = {}
    for frame in range(frames):
        image = int(np.argmin(np.abs(times - begin - frame / fps)))
        if abs(times[image] - begin - frame / fps) <= 0.5 / fps:
            found.setdefault(image, []).append(frame)
    return found


def _seconds(message: Any) -> float:
    stamp = message.header.stamp
    return stamp.sec + 1e-9 * stamp.nanosec


def _encoded(message: Any, where: str) -> tuple[str, bytes]:
    """Suffix and bytes of an image file; what is compressed already stays as it is."""
    if message.__msgtype__ == _IMAGES[1]:
        content = bytes(message.data)
        if content.startswith(b"\xff\xd8"):
            return ".jpg", content
        if content.startswith(b"\x89PNG"):
            return ".png", content
        raise UserError("invalid", f"{where}: compressed as {message.format!r}", "record JPEG or PNG")
    return ".png", cv2.imencode(".png", _pixels(message, where))[1].tobytes()


def _pixels(message: Any, where: str) -> UInt8[np.ndarray, "height width 3"]:
    encoding = message.encoding
    if encoding != "bgr8" and encoding not in _TO_BGR:
        known = ", ".join(["bgr8", *_TO_BGR])
        raise UserError("invalid", f"{where}: images are encoded as {encoding!r}", f"record one of {known}")
    channels = {"mono8": 1, "rgba8": 4, "bgra8": 4}.get(encoding, 3)
    rows = np.asarray(message.data, np.uint8)[: message.height * message.step].reshape(message.height, message.step)
    pixels = rows[:, : message.width * channels].reshape(message.height, message.width, channels)
    return pixels if encoding == "bgr8" else cv2.cvtColor(np.ascontiguousarray(pixels), _TO_BGR[encoding])
