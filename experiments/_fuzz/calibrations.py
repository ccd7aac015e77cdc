"""Calibrations of every format, by hand: three cameras that look at one place."""

from __future__ import annotations

import json
import struct

import numpy as np
import yaml

from aerojax.geometry.cameras import invert_rigid, look_at, project_points
from experiments._fuzz.inputs import Files

_SIZE = 640, 480
_K = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
_PLACES = ((8.0, 1.0, 2.0), (-4.0, 7.0, 3.0), (-3.0, -8.0, 1.5))
_POSES = tuple(np.asarray(look_at(np.array(place), np.array([0.0, 0.0, 4.0])), np.float64) for place in _PLACES)
_PARAMETERS = 500.0, 500.0, 320.0, 240.0


class _Camera:
    """What `project_points` needs."""

    def __init__(self, pose: np.ndarray) -> None:
        self.K, self.world_from_cam = _K, pose


def colmap_text() -> Files:
    """Cameras and one image of each."""
    numbers = " ".join(map(repr, _PARAMETERS))
    cameras = f"# list\n1 PINHOLE {_SIZE[0]} {_SIZE[1]} {numbers}\n2 OPENCV {_SIZE[0]} {_SIZE[1]} {numbers} .1 0 0 0\n"
    images = "".join(f"{i + 1} 0.5 0.5 0.5 0.5 {i} 0 4 {1 + i % 2} cam_{i}/0.png\n1 2 -1\n" for i in range(3))
    return {"cameras.txt": cameras.encode(), "images.txt": images.encode()}


def colmap_binary() -> Files:
    """The same as numbers."""
    cameras = struct.pack("<QiiQQ4d", 1, 1, 1, *_SIZE, *_PARAMETERS)
    images = struct.pack("<Q", 3)
    for index in range(3):
        images += struct.pack("<I7dI", index + 1, 0.5, 0.5, 0.5, 0.5, index, 0.0, 4.0, 1)
        images += f"cam_{index}/0.png".encode() + b"\0" + struct.pack("<QddQ", 1, 3.0, 4.0, 7)
    return {"cameras.bin": cameras, "images.bin": images}


def nerfstudio() -> Files:
    """One image a camera, a lens at the top."""
    frames = [
        {"file_path": f"images/cam_{i}/0.png", "transform_matrix": pose.tolist(), "mask_path": f"masks/{i}.png"}
        for i, pose in enumerate(_POSES)
    ]
    top = {"camera_model": "OPENCV", "w": 640, "h": 480, "fl_x": 500.0, "fl_y": 500.0, "cx": 320.0, "cy": 240.0}
    return {"transforms.json": json.dumps({**top, "k1": 0.01, "frames": frames}).encode()}


def opencv() -> Files:
    """A file of each kind that OpenCV and ROS write."""
    files = {}
    for index, pose in enumerate(_POSES):
        cam_from_world = invert_rigid(pose)
        data = ", ".join(map(repr, _K.ravel().tolist()))
        files[f"cam_{index}.yml"] = (
            f"%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n"
            f"   rows: 3\n   cols: 3\n   dt: d\n   data: [ {data} ]\n"
            f"distortion_coefficients: [0.1, 0., 0., 1e-05, 0.]\nR: {cam_from_world[:3, :3].tolist()}\n"
            f"t: {cam_from_world[:3, 3].tolist()}\n"
        ).encode()
    return files


def kalibr() -> Files:
    """A chain."""
    chain = {}
    for index, pose in enumerate(_POSES):
        entry = {
            "camera_model": "pinhole",
            "intrinsics": list(_PARAMETERS),
            "distortion_model": "radtan",
            "distortion_coeffs": [0.1, 0.0, 0.0, 0.0],
            "resolution": list(_SIZE),
        }
        if index:
            entry["T_cn_cnm1"] = (invert_rigid(pose) @ _POSES[index - 1]).tolist()
        chain[f"cam{index}"] = entry
    return {"camchain.yaml": yaml.safe_dump(chain).encode()}


def projections() -> Files:
    """One matrix a camera."""
    return {
        f"cam_{index}.yml": yaml.safe_dump(
            {"projectionMatrix_3x4_w2p": (_K @ invert_rigid(pose)[:3]).ravel().tolist()}
        ).encode()
        for index, pose in enumerate(_POSES)
    }


def drone_tracking() -> Files:
    """Three cameras and a short track; all files in one folder."""
    t = np.linspace(0, 1, 16)
    path = np.stack([np.sin(5 * t), np.cos(4 * t), 4 + t], axis=1)
    files: Files = {"rtk.txt": "\n".join(" ".join(map(repr, row)) for row in path.tolist()).encode()}
    for index, pose in enumerate(_POSES):
        pixels = project_points(path, _Camera(pose))
        lines = (f"{u:.3f} {v:.3f} {frame}" for frame, (u, v) in enumerate(pixels.tolist()))
        files[f"det_{index}.txt"] = "\n".join(lines).encode()
        lens = {"K-matrix": _K.tolist(), "distCoeff": [0, 0, 0, 0, 0], "fps": 10.0, "resolution": list(_SIZE)}
        files[f"lens_{index}.json"] = json.dumps(lens).encode()
    inputs = {
        "path_detections": [f"det_{i}.txt" for i in range(3)],
        "path_cameras": [f"lens_{i}.json" for i in range(3)],
        "corresponding_frames": [0, 0, 0],
    }
    truth = {"ground_truth": {"filepath": "rtk.txt", "frequency": 10}}
    files["config.json"] = json.dumps({"necessary inputs": inputs, "optional inputs": truth}).encode()
    return files
