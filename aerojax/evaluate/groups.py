"""Figures of clips in groups: by rig, size and distance; clips that were asked for and do not exist count as wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from aerojax.classify.base import Classifier, with_card
from aerojax.core.errors import UserError
from aerojax.core.seeds import seed_of
from aerojax.core.types import CLASSES
from aerojax.data.clips import ClipSet, Fact, clip_files, load_clip, one_camera_path, pack_clips
from aerojax.data.manifest import SequenceEntry
from aerojax.evaluate.answers import TEST_ENSEMBLES, log_probabilities
from aerojax.evaluate.bootstrap import accuracy, bootstrap_interval, confusion_by_identity
from aerojax.evaluate.calibration import calibration_error

WIDTH_EDGES = (0.0, 8.0, 12.0, 16.0, 24.0, 40.0, 80.0, 160.0, np.inf)
"""Pixels that an object spans, the ends of groups."""
DISTANCE_EDGES = (0.0, 12.0, 24.0, 45.0, 80.0, 120.0, 170.0, 240.0, 330.0, np.inf)
"""Metres from the cameras, the ends of groups: between the radii of the published Sim-1 (16, 32, 64, 100, 140 … m)."""
FAR = (60.0, 300.0)
"""Metres: the radii from 64 to 280 m, all in one group."""


@dataclass(frozen=True, eq=False)
class AnsweredClips:
    """What a classifier answered to the clips that it was asked about.

    label: index into `CLASSES`. identity: name of the individual. facts: of each clip, see `data.clips.save_clip`.
    log_probabilities: of the classes; zeros for clips that do not exist.
    exists: False for sequences of which no frame was usable, so that there is no clip.
    """

    label: Int[np.ndarray, "clip"]
    identity: tuple[str, ...]
    facts: tuple[Mapping[str, Fact], ...]
    log_probabilities: Float[np.ndarray, "clip label"]
    exists: Bool[np.ndarray, "clip"]

    @property
    def predicted(self) -> Int[np.ndarray, "clip"]:
        """The most probable class, the number of classes where there is no clip and so no answer."""
        return np.where(self.exists, np.argmax(self.log_probabilities, axis=1), self.log_probabilities.shape[1])

    def take(self, index: np.ndarray) -> AnsweredClips:
        """Some of the clips, by index or by mask."""
        chosen = np.arange(len(self.label))[index]
        return AnsweredClips(
            self.label[chosen],
            tuple(self.identity[i] for i in chosen),
            tuple(self.facts[i] for i in chosen),
            self.log_probabilities[chosen],
            self.exists[chosen],
        )


@dataclass(frozen=True)
class AskedClip:
    """A clip that there should be: its class, its individual and what is known of it."""

    label: str
    identity: str
    facts: Mapping[str, Fact] = field(default_factory=dict)


def asked_sequences(sequences: Sequence[SequenceEntry], rig: str, split: str) -> dict[str, AskedClip] | None:
    """The clips that there should be of a rig's sequences, by name; None where the rig has none."""
    chosen = [one for one in sequences if (one.rig, one.split) == (rig, split)]
    return {
        one.name: AskedClip(
            one.label, one.identity, {"rig": one.rig, "cameras": one.cameras, "distance_m": one.distance}
        )
        for one in chosen
    } or None


def answer_folder(
    classifier: Classifier,
    folder: Path,
    *,
    frames: int,
    asked: Mapping[str, AskedClip] | None = None,
    cameras: int | None = None,
) -> AnsweredClips:
    """Ask a classifier about the clips of a folder, with `TEST_ENSEMBLES` subsets of tokens.

    Args:
        classifier: any member.
        folder: `<rig>/<split>`; clips that do not say of which rig they are take its name.
        frames: clips are cut or padded to so many.
        asked: by name; the answers are to these alone and those without a file count as missing, unless there are crops
            of one camera (`one_camera_path`), which a classifier of crops answers from. None for every clip of the
            folder.
        cameras: of each clip so many are kept, drawn by its name; None for all of them.

    Raises:
        UserError: nothing is asked, a clip is broken, crops are wanted and there are none, or cameras are left out for
            a classifier that reads Gaussians alone, which are of all of them.
    """
    if cameras is not None and not classifier.reads_crops:
        problem = f"the classifier {classifier.card.name!r} reads Gaussians, which are those of all cameras"
        raise UserError("mismatch", problem, "leave cameras out, or give one that reads crops")
    known: Mapping[str, AskedClip | None]
    known = dict.fromkeys(path.stem for path in clip_files(folder)) if asked is None else asked
    if not known:
        raise UserError("missing", f"{folder} holds no clips (*.npz)", "make them with experiments.generate_clips")
    placed = [name for name in known if (folder / f"{name}.npz").is_file()]
    others = [name for name in known if name not in set(placed)]
    alone = [name for name in others if classifier.reads_crops and one_camera_path(folder / f"{name}.npz").is_file()]
    parts, rig = [], {"rig": folder.parent.name}
    if placed:
        parts.append(
            _answered(classifier, [folder / f"{name}.npz" for name in placed], [rig] * len(placed), frames, cameras)
        )
    if alone:  # without Gaussians, so not in one set with the others; the sequence alone knows the distance
        facts = [rig if (one := known[name]) is None else {**rig, **one.facts} for name in alone]
        paths = [one_camera_path(folder / f"{name}.npz") for name in alone]
        parts.append(_answered(classifier, paths, facts, frames, cameras))
    missing = [one for name in others if name not in set(alone) and (one := known[name]) is not None]
    return join_answers([*parts, answered_clips(None, np.zeros((0, len(CLASSES))), missing)])


def _answered(
    classifier: Classifier,
    paths: Sequence[Path],
    facts: Sequence[Mapping[str, Fact]],
    frames: int,
    cameras: int | None,
) -> AnsweredClips:
    """Answers to files; where a clip does not say itself what is given of it, that is taken."""
    stored = [load_clip(path) for path in paths]
    if cameras is not None:
        stored = [one.seen_by(cameras, seed=seed_of(path.stem)) for one, path in zip(stored, paths, strict=True)]
    clips = pack_clips(stored, frames=frames)
    both = zip(facts, clips.facts, strict=True)
    clips = replace(clips, facts=tuple({**given, **own} for given, own in both))
    return answered_clips(clips, log_probabilities(with_card(classifier, token_ensembles=TEST_ENSEMBLES), clips))


def answered_clips(
    clips: ClipSet | None, log_probabilities: Float[np.ndarray, "clip label"], missing: Sequence[AskedClip] = ()
) -> AnsweredClips:
    """Put clips, the answers to them, and those that do not exist side by side.

    Args:
        clips: those that exist; None if none do.
        log_probabilities: of those, a row a clip.
        missing: the others.
    """
    found = 0 if clips is None else len(clips.label)
    label = [] if clips is None else clips.label.tolist()
    identity = () if clips is None else clips.identity
    facts = () if clips is None else clips.facts or ({},) * found
    return AnsweredClips(
        np.array([*label, *(CLASSES.index(one.label) for one in missing)], np.int64),
        (*identity, *(one.identity for one in missing)),
        (*facts, *(one.facts for one in missing)),
        np.concatenate([log_probabilities, np.zeros((len(missing), len(CLASSES)))]),
        np.arange(found + len(missing)) < found,
    )


def join_answers(parts: Sequence[AnsweredClips]) -> AnsweredClips:
    """Several sets as one, in order."""
    return AnsweredClips(
        np.concatenate([part.label for part in parts]),
        tuple(name for part in parts for name in part.identity),
        tuple(facts for part in parts for facts in part.facts),
        np.concatenate([part.log_probabilities for part in parts]),
        np.concatenate([part.exists for part in parts]),
    )


def confusions(answers: AnsweredClips) -> Int[np.ndarray, "identity truth prediction"]:
    """One confusion matrix an individual, in the order of names; the last row and column are those of no answer."""
    return confusion_by_identity(answers.predicted, answers.label, answers.identity, len(CLASSES) + 1)


def answer_figures(answers: AnsweredClips, *, seed: int, draws: int) -> dict[str, Any]:
    """Accuracy, its 95 % interval over individuals, recall of each class, and calibration of the clips that exist.

    Args:
        answers: at least one.
        seed, draws: of the bootstrap.

    Returns:
        JSON-ready: `accuracy`, `interval_95` and `recall` count clips that do not exist as wrong; `accuracy_of_clips`
        and `ece`, None if no clip exists, leave them out. `one_camera` of the clips are answered from one camera, as
        they have no place, and `one_camera_right` of those are right. A class without clips has a recall of None. The
        confusion matrix has the truth in rows and "no answer" in its last column.
    """
    by_identity = confusions(answers)
    confusion = by_identity.sum(axis=0)[: len(CLASSES)]
    truths, there = confusion.sum(axis=1), answers.exists
    rows, label = answers.log_probabilities[there], answers.label[there]
    some, alone = bool(there.any()), np.array([bool(facts.get("one_camera")) for facts in answers.facts], bool)
    return {
        "clips": len(answers.label),
        "missing": int(np.sum(~there)),
        "one_camera": int(alone.sum()),
        "one_camera_right": int(np.sum(alone & (answers.predicted == answers.label))),
        "identities": len(by_identity),
        "accuracy": float(np.trace(confusion) / confusion.sum()),
        "interval_95": list(bootstrap_interval(by_identity, accuracy, seed=seed, draws=draws)),
        "accuracy_of_clips": float(np.mean(np.argmax(rows, axis=1) == label)) if some else None,
        "recall": [float(h / t) if t else None for h, t in zip(np.diag(confusion), truths, strict=True)],
        "ece": calibration_error(rows, label) if some else None,
        "confusion": confusion.tolist(),
    }


def figures_by_text(answers: AnsweredClips, fact: str, *, seed: int, draws: int) -> dict[str, dict[str, Any]]:
    """`answer_figures` of the clips of each value of a fact, such as the rig; clips without the fact are left out."""
    values = np.array([str(facts.get(fact, "")) for facts in answers.facts])
    groups = sorted(set(values.tolist()) - {""})
    return {value: answer_figures(answers.take(values == value), seed=seed, draws=draws) for value in groups}


def figures_by_number(
    answers: AnsweredClips, fact: str, edges: Sequence[float], *, seed: int, draws: int
) -> list[dict[str, Any]]:
    """`answer_figures` of the clips whose fact lies in [low, high) of two neighbouring edges; empty groups left out.

    Returns:
        A row a group, with `low` and `high`; the latter is None for a group without an upper end.
    """
    values = np.array([float(facts.get(fact, np.nan)) for facts in answers.facts])
    rows = []
    for low, high in pairwise(edges):
        inside = (values >= low) & (values < high)
        if inside.any():
            ends = {"low": float(low), "high": float(high) if np.isfinite(high) else None}
            rows.append(ends | answer_figures(answers.take(inside), seed=seed, draws=draws))
    return rows


def grouped_figures(answers: AnsweredClips, *, seed: int, draws: int) -> dict[str, Any]:
    """Figures by rig, by width and by distance, JSON-ready.

    A clip that does not exist has no width, so the groups of widths leave it out; its distance is the sequence's.
    """
    ask = {"seed": seed, "draws": draws}
    return {
        "rigs": figures_by_text(answers, "rig", **ask),
        "width_px": figures_by_number(answers, "width_px", WIDTH_EDGES, **ask),
        "distance_m": figures_by_number(answers, "distance_m", DISTANCE_EDGES, **ask),
        "distance_64_to_280_m": figures_by_number(answers, "distance_m", FAR, **ask),
    }
