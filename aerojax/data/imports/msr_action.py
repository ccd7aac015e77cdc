"""MSR-Action3D (Li, Zhang & Liu 2010): depth recordings and skeletons of 20 actions, as clips of points.

Files are named `aAA_sSS_eEE_*` by action, subject (1 to 10) and repetition. A depth file `*_sdepth.bin` holds, in
little-endian 32-bit integers, the numbers of frames, columns and rows, and then the depths, 0 where there is nothing. A
skeleton file `*_skeleton3D.txt` holds 20 lines of x, y, z and a confidence a frame.

Points become Gaussians of which only the position means anything. They stand in the world's axes (x right, y away from
the camera, z up), so that a turn about z is one about the vertical, and about one centroid of all frames, which keeps
the motion from frame to frame.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32, UInt32

from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.core.seeds import seed_of
from aerojax.data.imports.each_clip import ImportedClips, import_each
from aerojax.data.splits import Split

ACTIONS = (
    *("high_arm_wave", "horizontal_arm_wave", "hammer", "hand_catch", "forward_punch", "high_throw", "draw_x"),
    *("draw_tick", "draw_circle", "hand_clap", "two_hand_wave", "side_boxing", "bend", "forward_kick", "side_kick"),
    *("jogging", "tennis_swing", "tennis_serve", "golf_swing", "pickup_and_throw"),
)
"""Actions in the order of their numbers, from 1."""
JOINTS = 20
FOCAL_PX = 280.0
"""Of the camera at 320×240 pixels, as the recipe for point sequences takes it (Liu, Yan & Bohg 2019)."""
_NAME = re.compile(r"a(\d{2})_s(\d{2})_e(\d{2})_.*")
_MOST_NUMBERS = 2**28  # of one depth file: 1 GiB


@dataclass(frozen=True)
class ActionReading:
    """How recordings become clips.

    kind: what is read.
    points: of each frame, drawn at random; all joints of skeletons, whatever this says.
    unit: what positions of depth files (millimetres) are divided by; those of skeletons stay metres.
    validation: subjects of the training half whose recordings choose the weights instead of being learnt from.
    """

    kind: Literal["depth", "skeleton"] = "depth"
    points: int = 2048
    unit: float = 300.0
    validation: tuple[int, ...] = (5,)

    def __post_init__(self) -> None:
        """Refuse what leaves no points."""
        require_at_least(self, "points")
        require_at_least(self, "unit", least=1e-6)


@dataclass(frozen=True)
class Recording:
    """One recording of an action by a subject."""

    file: Path
    name: str
    label: str
    identity: str
    split: Split


def find_recordings(root: Path, reading: ActionReading) -> tuple[Recording, ...]:
    """The recordings below a folder, sorted by name: subjects 1 to 5 train (or choose the weights), 6 to 10 test.

    Raises:
        UserError: there is none, or a file's name says an action or a subject that does not exist.
    """
    ending = "_sdepth.bin" if reading.kind == "depth" else "_skeleton3D.txt"
    found = []
    for file in sorted(root.rglob(f"*{ending}"), key=lambda path: path.name):
        parts = _NAME.fullmatch(file.name)
        action, subject = (int(parts[1]), int(parts[2])) if parts else (0, 0)
        if not (1 <= action <= len(ACTIONS) and 1 <= subject <= 10):
            problem = f"{file}: the name says no action of 1 to {len(ACTIONS)} and subject of 1 to 10"
            raise UserError("invalid", problem, f"name it as published, such as a01_s01_e01{ending}")
        split: Split = "test" if subject > 5 else "val" if subject in reading.validation else "train"
        name, label = file.name.removesuffix(ending), ACTIONS[action - 1]
        found.append(Recording(file, name, label, f"subject_{subject:02d}", split))
    if not found:
        raise UserError("missing", f"{root} holds no file *{ending}", "unpack the recordings there")
    return tuple(found)


def read_depth_file(file: Path) -> UInt32[np.ndarray, "time row column"]:
    """The depth maps of a recording, millimetres, 0 where there is nothing.

    Raises:
        UserError: the file contradicts its header; names it.
    """
    try:
        raw = np.fromfile(file, "<u4", count=_MOST_NUMBERS)
    except OSError as error:
        raise UserError("unreadable", f"{file} cannot be read ({error})", "restore it") from None
    frames, columns, rows = raw[:3].tolist() if len(raw) >= 3 else (0, 0, 0)
    if not frames * columns * rows or len(raw) != 3 + frames * columns * rows:
        problem = f"{file}: {frames} frames of {columns}×{rows} are announced and {max(len(raw) - 3, 0)} numbers follow"
        raise UserError("unreadable", problem, "restore the file")
    return raw[3:].reshape(frames, rows, columns)


def read_skeleton_file(file: Path) -> Float[np.ndarray, "time joint 3"]:
    """The joints of a recording, metres, camera's frame (x right, y up, z away from it); without the confidences.

    Raises:
        UserError: the file does not hold whole frames of 20 lines of four finite numbers; names it.
    """
    try:
        values = np.array(file.read_text(encoding="ascii").split(), np.float64)
    except (OSError, ValueError) as error:
        raise UserError("unreadable", f"{file} cannot be read as numbers ({error})", "restore it") from None
    if not len(values) or len(values) % (4 * JOINTS) or not np.all(np.isfinite(values)):
        problem = f"{file} does not hold whole frames of {JOINTS} lines of four finite numbers"
        raise UserError("unreadable", problem, "restore it")
    return values.reshape(-1, JOINTS, 4)[..., :3]


def depth_points(depth: UInt32[np.ndarray, "row column"]) -> Float[np.ndarray, "point 3"]:
    """The points of a depth map, millimetres, in the world's axes: x right, y away from the camera, z up.

    Pixels are projected back with `FOCAL_PX` about the middle of the image, which the published recipe counts from the
    pixels' top left corners.
    """
    rows, columns = np.nonzero(depth)
    far = depth[rows, columns].astype(np.float64)
    right = (columns - depth.shape[1] / 2) / FOCAL_PX * far
    down = (rows - depth.shape[0] / 2) / FOCAL_PX * far
    return np.stack([right, far, -down], axis=1)


def drawn_points(points: Float[np.ndarray, "point 3"], count: int, rng: np.random.Generator) -> np.ndarray:
    """So many of the points, each at most once; where there are fewer, each equally often and the rest at random."""
    if len(points) > count:
        return points[rng.choice(len(points), count, replace=False)]
    repeats, rest = divmod(count, len(points))
    index = np.concatenate([np.tile(np.arange(len(points)), repeats), rng.choice(len(points), rest, replace=False)])
    return points[rng.permutation(index)]


def recording_columns(
    recording: Recording, reading: ActionReading, *, seed: int
) -> Float32[np.ndarray, "time token 14"]:
    """The clip of a recording; frames without any point are left out.

    Raises:
        UserError: the file is broken, or no frame has a point; names it.
    """
    if reading.kind == "depth":
        rng = np.random.default_rng(seed_of(seed, recording.name))
        clouds = [depth_points(one) / reading.unit for one in read_depth_file(recording.file) if one.any()]
        frames = [drawn_points(cloud, reading.points, rng) for cloud in clouds]
    else:
        frames = list(read_skeleton_file(recording.file)[..., [0, 2, 1]])
    if not frames:
        raise UserError("invalid", f"{recording.file}: no frame shows anything", "leave it out")
    points = np.stack(frames)
    return point_columns(points - points.mean(axis=(0, 1)))


def point_columns(points: Float[np.ndarray, "time point 3"]) -> Float32[np.ndarray, "time point 14"]:
    """Points as small opaque grey balls: the columns of Gaussians for classifiers that read positions alone."""
    columns = np.zeros((*points.shape[:2], 14), np.float32)
    columns[..., :3], columns[..., 3], columns[..., 7:10], columns[..., 10] = points, 1.0, 0.01, 1.0
    return columns


def import_recordings(
    recordings: Sequence[Recording],
    reading: ActionReading,
    folder: Path,
    *,
    source: Path,
    seed: int,
    progress: Callable[[int, int, str], None],
) -> ImportedClips:
    """Write the clips that are missing, `<folder>/<split>/<recording>.npz`.

    Args:
        recordings: of `find_recordings(source, reading)`.
        reading: how files become clips.
        folder: of the clips.
        source: where the recordings are; noted with the clips.
        seed: of the points that are drawn.
        progress: called after each recording with (done, total, what).

    Raises:
        UserError: the folder holds clips of another source or configuration.
    """

    def columns(recording: Recording) -> np.ndarray:
        return recording_columns(recording, reading, seed=seed)

    return import_each(
        recordings, columns, reading, folder, source=source, seed=seed, progress=progress, classes=ACTIONS
    )
