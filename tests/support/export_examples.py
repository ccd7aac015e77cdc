"""A data set of coloured balls seen by three cameras, rendered analytically: every truth is known in closed form.

Two balls a sequence: one leaves the view of the first camera (whole, cut off, gone), the other is partly hidden behind
it at times. Principal points are off centre and pixels are not square, so that swapped axes and signs show.
"""

from __future__ import annotations

from pathlib import Path

import jax.numpy as jnp
import numpy as np

from aerojax.capture.format import Capture, CaptureCamera, ObjectState, TrackedObject, Truth, write_capture_json
from aerojax.capture.write import FrameExtras, write_frame
from aerojax.geometry.boxes import tight_box, touches_border
from aerojax.geometry.cameras import look_at

WIDTH, HEIGHT, FRAMES, FPS = 320, 240, 3, 30.0
CENTRES = ((9.0, 1.0, 8.0), (-4.0, 8.0, 7.0), (-3.0, -9.0, 9.5))
TARGET = (0.0, 0.0, 8.0)
# id: class, identity, radius, path (frame by frame), colour
BALLS = {
    1: ("drone", "ball_red", 0.5, ((0.2, 0.6, 8.0), (0.2, 3.4, 8.1), (0.2, 5.5, 8.2)), (200, 40, 30)),
    2: ("bird", "ball_blue", 0.6, ((-0.8, 0.4, 8.3), (-0.8, 0.2, 8.2), (-0.8, 0.0, 8.1)), (30, 60, 210)),
}


def ball_camera(index: int) -> CaptureCamera:
    """Camera `index`, in double precision and exactly orthonormal."""
    rough = np.asarray(look_at(jnp.array(CENTRES[index]), jnp.array(TARGET)), np.float64)
    left, _, right = np.linalg.svd(rough[:3, :3])
    rough[:3, :3], rough[:3, 3] = left @ right, CENTRES[index]
    name = f"cam_{index + 1:02d}"
    return CaptureCamera(
        name=name,
        width=WIDTH,
        height=HEIGHT,
        K=np.array([[420.0, 0.0, 150.0 + 6 * index], [0.0, 400.0, 128.0], [0.0, 0.0, 1.0]]),
        distortion_model="none",
        distortion=(),
        world_from_cam=rough,
        rgb=f"{name}/rgb/{{frame:06d}}.png",
        mask=f"{name}/mask/{{frame:06d}}.png",
        depth=f"{name}/depth/{{frame:06d}}.tiff",
        time_offset_s=0.0,
        normal=f"{name}/normal/{{frame:06d}}.png",
    )


def ball_depth(camera: CaptureCamera, centre: tuple[float, float, float], radius: float) -> np.ndarray:
    """Depth along the axis of a ball's near side at each pixel's centre; infinite beside it."""
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.K).T
    in_camera = camera.world_from_cam[:3, :3].T @ (np.array(centre) - camera.world_from_cam[:3, 3])
    a, b = np.sum(rays**2, axis=-1), rays @ in_camera
    under_root = b**2 - a * (in_camera @ in_camera - radius**2)
    near = (b - np.sqrt(np.maximum(under_root, 0.0))) / a  # rays have z = 1, so their parameter is the depth
    return np.where((under_root > 0) & (near > 0), near, np.inf)


def ball_normals(camera: CaptureCamera, plane: np.ndarray, mask: np.ndarray, frame: int, shift: float) -> np.ndarray:
    """Unit world normals of the balls' seen surfaces, 0 beside them."""
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.K).T
    points = (rays * plane[..., None]) @ camera.world_from_cam[:3, :3].T + camera.world_from_cam[:3, 3]
    normals = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    for number in BALLS:
        out = points[mask == number] - moved(number, frame, shift)
        normals[mask == number] = out / np.linalg.norm(out, axis=-1, keepdims=True)
    return normals


def write_balls(folder: Path, *, shift: float = 0.0) -> Capture:
    """Write one sequence; `shift` moves the balls up, so that sequences differ."""
    cameras = tuple(ball_camera(index) for index in range(3))
    seen: dict[int, list[dict]] = {number: [{} for _ in range(FRAMES)] for number in BALLS}
    for frame in range(FRAMES):
        for camera in cameras:
            alone = {n: ball_depth(camera, moved(n, frame, shift), BALLS[n][2]) for n in BALLS}
            depth = np.min(list(alone.values()), axis=0)
            mask = np.zeros((HEIGHT, WIDTH), np.uint16)
            rgb = np.full((HEIGHT, WIDTH, 3), 230, np.uint8)
            for number, own in alone.items():
                mask[np.isfinite(own) & (own == depth)] = number
                rgb[mask == number] = BALLS[number][4]
            plane = np.where(mask > 0, depth, 0.0).astype(np.float32)
            extras = FrameExtras(normal=ball_normals(camera, plane, mask, frame, shift))
            write_frame(folder, camera, frame, rgb, mask, plane, extra=extras)
            for number, own in alone.items():
                seen[number][frame][camera.name] = _sight(mask == number, np.isfinite(own))
    objects = tuple(
        TrackedObject(number, BALLS[number][0], BALLS[number][1], tuple(_states(number, seen[number], shift)))
        for number in BALLS
    )
    capture = Capture(folder, FPS, FRAMES, cameras, Truth(objects))
    write_capture_json(capture)
    return capture


def moved(number: int, frame: int, shift: float) -> tuple[float, float, float]:
    """Centre of a ball."""
    x, y, z = BALLS[number][3][frame]
    return x, y, z + shift


def _sight(visible: np.ndarray, alone: np.ndarray) -> dict:
    box = tight_box(visible)
    cut = box is not None and touches_border(box, WIDTH, HEIGHT)
    # Of the pixels that the ball would have alone; beyond the image a ball shows none.
    return {
        "whole": tight_box(alone),
        "box": box,
        "truncated": cut,
        "visibility": float(visible.sum() / alone.sum()) if alone.any() else 0.0,
    }


def _states(number: int, seen: list[dict], shift: float) -> list[ObjectState]:
    return [
        ObjectState(
            frame=frame,
            position=moved(number, frame, shift),
            orientation_wxyz=(1.0, 0.0, 0.0, 0.0),
            bbox={name: sight["box"] for name, sight in cameras.items() if sight["box"] is not None},
            visible={name: sight["box"] is not None for name, sight in cameras.items()},
            truncated={name: sight["truncated"] for name, sight in cameras.items()},
            visibility={name: sight["visibility"] for name, sight in cameras.items()},
            projected_box={name: sight["whole"] for name, sight in cameras.items() if sight["whole"] is not None},
        )
        for frame, cameras in enumerate(seen)
    ]


def write_ball_dataset(folder: Path) -> dict[str, Capture]:
    """Two splits, two sequences in the first: by `split/sequence`."""
    names = {"train/seq_a": 0.0, "train/seq_b": 0.25, "val/seq_c": -0.2}
    return {name: write_balls(folder / name, shift=shift) for name, shift in names.items()}
