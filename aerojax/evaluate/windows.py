"""Windows of the clips on disk, turned, and read by a classifier as it is read in use."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int

from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.voting import video_vote, window_starts
from aerojax.classify.weights import load_metadata, load_weights
from aerojax.evaluate.rotations import TrainRotation, rotate_clip
from aerojax.pipeline.offline import probabilities_so_far
from aerojax.training.variation import load_clips


@dataclass(frozen=True)
class Classifier:
    """A trained model and how its weights say that it is to be read.

    tokens, frames: of a frame and of a window in training.
    rotation: how the training clips were turned.
    """

    model: MambaSplat
    tokens: int
    frames: int
    rotation: TrainRotation


def read_classifier(path: Path) -> Classifier:
    """Weights of `train_classifier`, or any that carry the same notes.

    Raises:
        UserError: the file is absent or broken.
    """
    model, notes = load_weights(path), load_metadata(path)
    reading = json.loads(notes.get("reading", '{"tokens": 1024, "frames": 24}'))
    return Classifier(model, reading["tokens"], reading["frames"], reading.get("rotation", "none"))


@dataclass(frozen=True)
class Windows:
    """Equally long windows of videos.

    name: of the window, `rig/split/sequence@start`.
    video: index of the window's video; videos are numbered by their order.
    identity: of the window's object.
    """

    columns: Float32[np.ndarray, "window time token 14"]
    present: Bool[np.ndarray, "window time"]
    label: Int[np.ndarray, "window"]
    video: Int[np.ndarray, "window"]
    name: tuple[str, ...]
    identity: tuple[str, ...]

    def one_a_video(self) -> np.ndarray:
        """Index of the first window of every video."""
        return np.unique(self.video, return_index=True)[1]


def read_windows(folders: Sequence[Path], split: str, *, frames: int, length: int, stride: int, tokens: int) -> Windows:
    """Windows of every clip of a split, from each start that the stride reaches and the last one.

    Args:
        folders: of `reconstruct_dataset`, one a rig.
        split: train, val or test.
        frames: clips are cut to so many.
        length: frames of a window; a shorter clip gives one window with absent frames at its end.
        stride: between starts.
        tokens: of a frame that are kept, the first ones (they lie in random order).
    """
    columns, present, label, video, name, identity = [], [], [], [], [], []
    videos = 0
    for folder in folders:
        clips = load_clips(folder / split, frames=max(frames, length))
        stems = [path.stem for path in sorted((folder / split).glob("*.npz"))]
        for index, stem in enumerate(stems):
            for start in window_starts(max(int(clips.present[index].sum()), 1), length, stride):
                columns.append(clips.columns[index, start : start + length, :tokens])
                present.append(clips.present[index, start : start + length])
                label.append(clips.label[index])
                video.append(videos)
                name.append(f"{folder.name}/{split}/{stem}@{start}")
                identity.append(clips.identity[index])
            videos += 1
    stacked = np.stack(columns), np.stack(present), np.array(label), np.array(video)
    return Windows(*stacked, tuple(name), tuple(identity))


@partial(jax.jit, static_argnames=("tokens", "readings"))
def _read(
    model: MambaSplat, columns: Array, present: Array, quaternion: Array, order: Array, tokens: int, readings: int
) -> Float[Array, "window time label"]:
    def one(clip: tuple[Array, ...]) -> Array:
        columns, present, quaternion, order = clip
        columns = rotate_clip(columns, quaternion)[order]
        return probabilities_so_far(model, columns, present[order], tokens=tokens, readings=readings)

    return jax.lax.map(one, (columns, present, quaternion, order), batch_size=16)


def read_prefixes(
    classifier: Classifier,
    windows: Windows,
    quaternion: Float[np.ndarray, "window time 4"],
    *,
    readings: int,
    order: Int[np.ndarray, "window time"] | None = None,
) -> Float[np.ndarray, "window time label"]:
    """Log-probabilities after each frame of every window, its frames turned and then put into `order`."""
    if order is None:
        order = np.tile(np.arange(windows.present.shape[1]), (len(windows.label), 1))
    turned = jnp.asarray(quaternion, jnp.float32)
    found = _read(classifier.model, windows.columns, windows.present, turned, order, classifier.tokens, readings)
    return np.log(np.maximum(np.asarray(found), 1e-12))


def vote(log_probabilities: Float[np.ndarray, "window label"], windows: Windows) -> Float[np.ndarray, "video label"]:
    """Log-probabilities of each video: the sum of its windows' probabilities (thesis Eq. 5.19)."""
    votes = video_vote(jnp.asarray(log_probabilities), jnp.asarray(windows.video), int(windows.video.max()) + 1)
    return np.log(np.maximum(np.asarray(votes), 1e-12))


def shuffled_orders(windows: Windows, *, seed: int) -> Int[np.ndarray, "window time"]:
    """A random order of each window's present frames, the absent ones staying last."""
    rng = np.random.default_rng(seed)
    key = rng.random(windows.present.shape) + ~windows.present
    return np.argsort(key, axis=1)
