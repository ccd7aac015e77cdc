"""Calibrations as other tools write them, of the cameras of a capture; each by the tool itself where it is there."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from aerojax.capture.format import CaptureCamera
from aerojax.capture.lenses import distort_points
from aerojax.geometry.cameras import invert_rigid, project_points


def opencv_matrix(camera: CaptureCamera) -> np.ndarray:
    """K with the centre of the top-left pixel at (0, 0)."""
    K = camera.K.copy()
    K[:2, 2] -= 0.5
    return K


def write_opencv(cameras: Sequence[CaptureCamera], folder: Path, suffix: str = ".yml") -> Path:
    """One file a camera, by OpenCV's FileStorage."""
    folder.mkdir(parents=True)
    for camera in cameras:
        cam_from_world = invert_rigid(camera.world_from_cam)
        storage = cv2.FileStorage(str(folder / f"{camera.name}{suffix}"), cv2.FILE_STORAGE_WRITE)
        storage.write("image_width", camera.width)
        storage.write("image_height", camera.height)
        storage.write("camera_matrix", opencv_matrix(camera))
        storage.write("distortion_coefficients", np.array([[*camera.distortion, 0.0, 0.0, 0.0, 0.0, 0.0][:5]]))
        storage.write("rvec", cv2.Rodrigues(cam_from_world[:3, :3])[0])
        storage.write("tvec", cam_from_world[:3, 3:])
        storage.release()
    return folder


def write_kalibr(cameras: Sequence[CaptureCamera], path: Path) -> Path:
    """A camchain; the world is lost but for `kalibr_world`."""
    chain: dict[str, Any] = {}
    for index, camera in enumerate(cameras):
        K = opencv_matrix(camera)
        entry: dict[str, Any] = {
            "camera_model": "pinhole",
            "intrinsics": [float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])],
            "distortion_model": "radtan",
            "distortion_coeffs": [*camera.distortion, 0.0, 0.0, 0.0, 0.0][:4],
            "resolution": [camera.width, camera.height],
            "rostopic": f"/{camera.name}/image_raw",
        }
        if index:
            before = cameras[index - 1].world_from_cam
            entry["T_cn_cnm1"] = (invert_rigid(camera.world_from_cam) @ before).tolist()
        chain[f"cam{index}"] = entry
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(chain))
    return path


def write_projections(cameras: Sequence[CaptureCamera], folder: Path, *, centred: bool = False) -> Path:
    """DeepStream's camInfo files, at some other scale and sign."""
    (folder / "camInfo").mkdir(parents=True)
    for index, camera in enumerate(cameras):
        K = camera.K.copy()
        if centred:
            K[:2, 2] -= camera.width / 2, camera.height / 2
        projection = (-2.0 if index % 2 else 0.3) * K @ invert_rigid(camera.world_from_cam)[:3]
        key = "projectionMatrix_3x4" if centred else "projectionMatrix_3x4_w2p"
        text = yaml.safe_dump({key: projection.ravel().tolist(), "modelInfo": [{"classID": 0, "height": 1.7}]})
        (folder / "camInfo" / f"{camera.name}.yml").write_text(text)
    return folder


def write_drone_tracking(
    cameras: Sequence[CaptureCamera],
    folder: Path,
    path_m: np.ndarray,
    *,
    rate: float = 30.0,
    starts: Sequence[float] | None = None,
) -> Path:
    """The layout of drone-tracking-datasets of a drone that flew along `path_m`, one place a frame."""
    starts = starts or [0.0] * len(cameras)
    for name in ("detections", "calibration", "trajectory"):
        (folder / name).mkdir(parents=True)
    for camera, start in zip(cameras, starts, strict=True):
        pixels = distort_points(project_points(path_m, camera), camera.K, camera.distortion_model, camera.distortion)
        rows = [f"{u - 0.5:.9f} {v - 0.5:.9f} {frame + start:g}" for frame, (u, v) in enumerate(pixels)]
        (folder / "detections" / f"{camera.name}.txt").write_text("\n".join(["0 0 -1", *rows]) + "\n")
        lens = {
            "comment": ["distCoeff should be a vector of [k1,k2,p1,p2[,k3]]"],
            "K-matrix": opencv_matrix(camera).tolist(),
            "distCoeff": [*camera.distortion, 0.0, 0.0, 0.0, 0.0, 0.0][:5],
            "fps": rate,
            "resolution": [camera.width, camera.height],
        }
        (folder / "calibration" / f"{camera.name}.json").write_text(json.dumps(lens))
    np.savetxt(folder / "trajectory/rtk.txt", path_m, header="FixPosition F2 GT_ENU")
    config = {
        "necessary inputs": {
            "path_detections": [f"detections/{camera.name}.txt" for camera in cameras],
            "path_cameras": [f"calibration/{camera.name}.json" for camera in cameras],
            "corresponding_frames": list(starts),
        },
        "optional inputs": {"ground_truth": {"filepath": "trajectory/rtk.txt", "frequency": rate}},
    }
    (folder / "config_dataset.json").write_text(json.dumps(config))
    return folder


def write_bag(cameras: Sequence[CaptureCamera], path: Path, images: Sequence[Sequence[np.ndarray]], fps: float) -> Path:
    """A bag of ROS 2 with camera_info, tf_static and raw images (BGR), written by `rosbags`."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    time, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]

    def stamped(seconds: float, frame: str) -> Any:
        whole = int(seconds)
        return header(time(whole, round((seconds - whole) * 1e9)), frame)

    def transform(camera: CaptureCamera) -> Any:
        from scipy.spatial.transform import Rotation

        x, y, z, w = Rotation.from_matrix(camera.world_from_cam[:3, :3]).as_quat()
        pose = types["geometry_msgs/msg/Transform"](
            types["geometry_msgs/msg/Vector3"](*camera.world_from_cam[:3, 3].tolist()),
            types["geometry_msgs/msg/Quaternion"](x, y, z, w),
        )
        return types["geometry_msgs/msg/TransformStamped"](stamped(0, "map"), f"{camera.name}_optical", pose)

    with Writer(path, version=9) as bag:

        def write(topic: str, kind: str, messages: Sequence[tuple[float, Any]]) -> None:
            connection = bag.add_connection(topic, kind, typestore=store)
            for seconds, message in messages:
                bag.write(connection, round(seconds * 1e9), store.serialize_cdr(message, kind))

        tree = types["tf2_msgs/msg/TFMessage"]([transform(camera) for camera in cameras])
        write("/tf_static", "tf2_msgs/msg/TFMessage", [(100.0, tree)])
        region = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        for camera, pictures in zip(cameras, images, strict=True):
            frame, K = f"{camera.name}_optical", opencv_matrix(camera)
            info = types["sensor_msgs/msg/CameraInfo"](
                stamped(100.0, frame),
                camera.height,
                camera.width,
                "plumb_bob",
                np.array([*camera.distortion, 0.0, 0.0, 0.0, 0.0, 0.0][:5]),
                K.ravel(),
                np.eye(3).ravel(),
                np.zeros(12),
                0,
                0,
                region,
            )
            write(f"/{camera.name}/camera_info", "sensor_msgs/msg/CameraInfo", [(100.0, info)])
            messages = []
            for index, bgr in enumerate(pictures):
                seconds = 100.0 + index / fps + 0.001
                head = stamped(seconds, frame)
                height, width = bgr.shape[:2]
                picture = types["sensor_msgs/msg/Image"](head, height, width, "bgr8", 0, 3 * width, bgr.ravel())
                messages.append((seconds, picture))
            write(f"/{camera.name}/image_raw", "sensor_msgs/msg/Image", messages)
    return path


def kalibr_world(cameras: Sequence[CaptureCamera]) -> tuple[float, ...]:
    """`world_from_source` for `write_kalibr`, whose world is the first camera's frame."""
    return tuple(cameras[0].world_from_cam.ravel().tolist())
