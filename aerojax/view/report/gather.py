"""From a classified capture to what the report page shows."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float64

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.core.types import CLASSES, SH_C0, UNKNOWN, Gaussians, Observation
from aerojax.gaussians.rotate import transform
from aerojax.view.report.content import CameraAgreement, CameraCrop, ClassificationReport, FrameReport, Status
from aerojax.view.viewer.content import Lens, SceneCamera, Splats

_NONE: Mapping[str, Any] = {"label": None, "reasons": (), "warnings": (), "cameras": {}}


@dataclass(frozen=True, eq=False)
class Answer:
    """What a classifier said of one object of a capture.

    observations: what was seen in each frame that was used.
    gaussians: of these frames, frame of the rig (`Observation.world_from_rig`), metres, leading axis time.
    position: their centres, metres, world.
    so_far: probabilities after each frame.
    dropped: sentences by the number of each frame that could not be used.
    latency_ms: milliseconds a frame, per stage.
    truth: the true class where it is known.
    status: whether the likeliest class is the answer.
    result: see `pipeline.results.result_of`, of which reasons, warnings and agreement are shown.
    made_by: by name, the version of this package and what `weights_named` says.
    explanation: see `ClassificationReport`.
    """

    observations: Sequence[Observation]
    gaussians: Gaussians
    position: Float[np.ndarray, "time 3"]
    so_far: Float[np.ndarray, "time label"]
    dropped: Mapping[int, str]
    latency_ms: dict[str, float]
    truth: str | None
    status: Status = "ok"
    result: Mapping[str, Any] = field(default_factory=lambda: _NONE)
    made_by: Mapping[str, str] = field(default_factory=dict)
    explanation: Mapping[str, Any] | None = None


def classification_report(capture: Capture, answer: Answer) -> ClassificationReport:
    """Gather frames, Gaussians and figures of the page."""
    probabilities = dict(zip(CLASSES, answer.so_far[-1].tolist(), strict=True))
    likeliest = max(probabilities, key=lambda name: probabilities[name])
    frames = tuple(
        FrameReport(
            frame=seen.frame,
            crops=_crops(capture.cameras, seen, answer.position[i]),
            splats=_splats(jax.tree.map(lambda leaf, i=i: leaf[i], answer.gaussians), seen, answer.position[i]),
            centre=answer.position[i].astype(np.float64),
            probabilities=answer.so_far[i],
            position=answer.position[i],
        )
        for i, seen in enumerate(answer.observations)
    )
    notes = ["The Gaussians are drawn as they were reconstructed, in the capture's world: metres, z up."]
    if any(camera.mask is None for camera in capture.cameras):
        notes.append("The capture has no masks: the object was found by its motion.")
    agreement = tuple(_agreement(name, figures) for name, figures in answer.result["cameras"].items())
    suspects = {one.camera for one in agreement if one.suspect}
    return ClassificationReport(
        title=capture.folder.resolve().name,
        label=UNKNOWN if answer.result["label"] == UNKNOWN else likeliest,
        probabilities=probabilities,
        truth=answer.truth,
        frames=frames,
        dropped=dict(answer.dropped),
        latency_ms=answer.latency_ms,
        fps=capture.fps,
        rig=tuple(_scene_camera(camera, camera.name in suspects) for camera in capture.cameras),
        notes=tuple(notes),
        made_by=answer.made_by,
        status=answer.status,
        reasons=tuple(reason["text"] for reason in answer.result["reasons"]),
        warnings=tuple(answer.result["warnings"]),
        agreement=agreement,
        explanation=answer.explanation,
    )


def weights_named(name: str, member: str, record: str) -> dict[str, str]:
    """What the page says of a classifier: its card's name and member, and what its record (JSON) says of its making."""
    made = json.loads(record or "{}")
    test, words = made.get("test"), [f"member {member}"]
    if isinstance(test, dict) and isinstance(test.get("accuracy"), float):
        words.append(f"{100 * test['accuracy']:.1f} % right on {test.get('clips', '?')} held-out clips")
    if isinstance(made.get("commit"), str):
        words.append(f"trained at commit {made['commit'][:10]}")
    return {"weights": name, "card": ", ".join(words)}


def _agreement(name: str, figures: Mapping[str, Any]) -> CameraAgreement:
    names = ("shift_px", "shift_m", "ray_px", "ray_m", "uncovered")
    values = (figures[one] for one in names)
    return CameraAgreement(name, *values, suspect=figures["suspect"] is not None)


def _scene_camera(camera: CaptureCamera, suspect: bool) -> SceneCamera:
    return SceneCamera(camera.name, _lens(camera.K, camera.width, camera.height), camera.world_from_cam, suspect)


def _lens(K: Float[np.ndarray, "3 3"], width: int, height: int) -> Lens:
    fx, fy, cx, cy = (float(K[i, j]) for i, j in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return Lens(fx, fy, cx, cy, width, height)


def _splats(gaussians: Gaussians, seen: Observation, centre: Float64[np.ndarray, "3"]) -> Splats:
    """One frame's Gaussians in world axes about their centre."""
    # The centre is subtracted in the rig's frame, in double precision: the world's origin may be very far.
    rig_from_world = np.linalg.inv(seen.world_from_rig)
    turn = jnp.eye(4).at[:3, :3].set(seen.world_from_rig[:3, :3].astype(np.float32))
    near = np.asarray(gaussians.mean, np.float64) - (rig_from_world[:3, :3] @ centre + rig_from_world[:3, 3])
    turned = transform(dataclasses.replace(gaussians, mean=jnp.asarray(near, jnp.float32)), turn)
    rgb = np.clip(np.asarray(turned.sh)[:, 0] * SH_C0 + 0.5, 0, 1)
    columns = (turned.mean, turned.quaternion, turned.scale, turned.opacity, rgb)
    return Splats(*(np.asarray(column, np.float32) for column in columns))


def _crops(
    cameras: Sequence[CaptureCamera], seen: Observation, centre: Float64[np.ndarray, "3"]
) -> tuple[CameraCrop, ...]:
    rgb, mask = np.asarray(seen.views.rgb), np.asarray(seen.views.mask)
    K, crop_from_cam = np.asarray(seen.views.camera.K), np.asarray(seen.views.camera.world_from_cam, np.float64)
    centre_from_crop = seen.world_from_crop.copy()
    centre_from_crop[:3, 3] -= centre
    crops = []
    for index, camera in enumerate(cameras):
        if seen.valid[index]:
            corners = seen.windows[index]
            x0, y0, x1, y1 = *corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()
            pixels = np.round(255 * rgb[index]).astype(np.uint8)
            size = camera.width, camera.height
            lens = _lens(K[index], rgb.shape[2], rgb.shape[1])
            pose = centre_from_crop @ crop_from_cam[index]
            crops.append(CameraCrop(camera.name, pixels, mask[index] > 0.5, (x0, y0, x1, y1), size, lens, pose))
    return tuple(crops)
