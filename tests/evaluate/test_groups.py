"""Groups of answers: missing clips are wrong, groups hold what they say, intervals are those of individuals."""

from __future__ import annotations

import json

import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip
from support.known_answers import Heights

from aerojax.classify.base import untrained_card
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES, pytree_dataclass
from aerojax.data.clips import StoredClip, one_camera_path, save_clip
from aerojax.evaluate.groups import (
    AnsweredClips,
    AskedClip,
    answer_figures,
    answer_folder,
    answered_clips,
    figures_by_number,
    grouped_figures,
    join_answers,
)
from aerojax.evaluate.robustness import LevelAnswers, robustness_markdown, robustness_rows

HEIGHTS = Heights(untrained_card(MambaSplatConfig(), tokens=8, frames=2))


def answers(right: list[bool], *, missing: int = 0, **facts) -> AnsweredClips:
    """Birds of as many individuals, recognised or taken for drones; then missing ones of further individuals."""
    rows = np.log(np.where(np.array(right)[:, None], [0.97, 0.01, 0.01, 0.01], [0.01, 0.97, 0.01, 0.01]))
    bird, drone = CLASSES.index("bird"), CLASSES.index("drone")
    place = [bird, drone, *sorted({0, 1, 2, 3} - {bird, drone})]
    count = len(right)
    found = AnsweredClips(
        np.full(count, bird),
        tuple(f"bird_{i}" for i in range(count)),
        tuple({name: values[i] for name, values in facts.items()} for i in range(count)),
        rows[:, np.argsort(place)],
        np.ones(count, bool),
    )
    lost = [AskedClip("bird", f"lost_{i}", {"rig": "line", "distance_m": 300.0}) for i in range(missing)]
    return join_answers([found, answered_clips(None, np.zeros((0, 4)), lost)])


def test_missing_clips_are_wrong():
    found = answer_figures(answers([True, True, False], missing=1), seed=0, draws=500)
    assert (found["clips"], found["missing"], found["identities"]) == (4, 1, 4)
    assert found["accuracy"] == 0.5 and found["accuracy_of_clips"] == pytest.approx(2 / 3)
    assert found["recall"][CLASSES.index("bird")] == 0.5
    assert found["recall"][CLASSES.index("airplane")] is None
    assert np.sum(found["confusion"]) == 4 and np.array(found["confusion"])[:, -1].sum() == 1
    low, high = found["interval_95"]
    assert 0.0 <= low < 0.5 < high <= 1.0
    assert found["ece"] == pytest.approx(0.97 - 2 / 3)
    none = answer_figures(answers([], missing=2), seed=0, draws=50)
    assert none["accuracy"] == 0.0 and none["ece"] is None and none["accuracy_of_clips"] is None


def test_groups_hold_their_clips():
    some = answers([True, False, True], missing=1, rig=["a", "a", "b"], width_px=[9.0, 12.0, 500.0])
    found = grouped_figures(some, seed=0, draws=50)
    assert {rig: (row["clips"], row["accuracy"]) for rig, row in found["rigs"].items()} == {
        "a": (2, 0.5),
        "b": (1, 1.0),
        "line": (1, 0.0),
    }
    assert [(row["low"], row["high"], row["clips"]) for row in found["width_px"]] == [
        (8.0, 12.0, 1),
        (12.0, 16.0, 1),
        (160.0, None, 1),
    ]
    assert [(row["low"], row["high"], row["clips"]) for row in found["distance_m"]] == [(240.0, 330.0, 1)]
    assert figures_by_number(some, "distance_m", (0.0, 300.0), seed=0, draws=50) == []
    json.dumps(found)


def test_a_folder_is_asked(tmp_path):
    folder = tmp_path / "rig" / "test"
    for index, name in enumerate(("one", "two")):
        clip = np.array(random_clip(index, time=2, tokens=8))
        clip[..., :3] = [0.0, 5.0, 0.0]  # the second class is certain
        save_clip(folder / f"{name}.npz", clip, CLASSES[1], name)
    everything = answer_folder(HEIGHTS, folder, frames=2)
    assert everything.predicted.tolist() == [1, 1] and everything.facts == ({"rig": "rig"},) * 2
    asked = {"one": AskedClip(CLASSES[1], "one"), "gone": AskedClip("bird", "gone")}
    some = answer_folder(HEIGHTS, folder, frames=2, asked=asked)
    assert some.identity == ("one", "gone") and some.predicted.tolist() == [1, len(CLASSES)]
    with pytest.raises(UserError, match="holds no clips"):
        answer_folder(HEIGHTS, tmp_path / "none", frames=2)


def test_rows_are_paired_with_the_ideal():
    ideal = answers([True, True, True, False])
    worse = answers([True, False, True], missing=1)
    worse = AnsweredClips(worse.label, ideal.identity, worse.facts, worse.log_probabilities, worse.exists)
    levels = [LevelAnswers("clock_ms", 0.0, ideal), LevelAnswers("clock_ms", 33.0, worse, "33 ms")]
    same, later = robustness_rows(ideal, levels, seed=0, draws=200)
    assert same["difference"] == 0.0 and same["difference_95"] == [0.0, 0.0] and same["undrawn"] == 0.0
    assert later["difference"] == -0.25 and later["undrawn"] == 0.25 and later["accuracy"] == 0.5
    text = robustness_markdown([same, later], about="Two levels.")
    assert "| clock error (ms, largest) | 33 ms | 50.0 |" in text and "| -25.0 |" in text
    assert "| clock error (ms, largest) | 0 | 75.0 |" in text and "| +0.0 | +0.0 … +0.0 |" in text


@pytree_dataclass
class Bright(Heights):
    """Reads crops alone: the second class is certain where any counts."""

    @property
    def reads_crops(self):
        return True

    def clip(self, seen, valid):
        sure = jnp.where(seen.crops.valid.any(), 9.0, 0.0)
        return jnp.tile(jnp.array([[0.0, 1.0, 0.0, 0.0]]) * sure, (len(valid), 1))


def test_sequences_of_one_camera_count_by_their_answer(tmp_path):
    folder, crops = tmp_path / "rig" / "test", np.full((2, 3, 4, 4, 4), 255, np.uint8)
    for name, label in (("right", CLASSES[1]), ("wrong", "bird")):
        facts = {"rig": "rig", "one_camera": True, "width_px": 9.0}
        given = {"crops": crops, "crop_valid": np.ones((2, 3), bool), "facts": facts}
        save_clip(one_camera_path(folder / f"{name}.npz"), np.zeros((2, 0, 14)), label, name, **given)
    clip = np.array(random_clip(0, time=2, tokens=8))
    save_clip(folder / "placed.npz", clip, CLASSES[1], "placed", crops=crops, crop_valid=np.ones((2, 3), bool))
    labels = {"placed": CLASSES[1], "right": CLASSES[1], "wrong": "bird", "gone": "bird"}
    asked = {name: AskedClip(label, name, {"distance_m": 300.0}) for name, label in labels.items()}
    found = answer_folder(Bright(HEIGHTS.card), folder, frames=2, asked=asked)
    assert found.identity == ("placed", "right", "wrong", "gone")
    assert found.predicted.tolist() == [1, 1, 1, len(CLASSES)]
    assert found.facts[0] == {"rig": "rig"} and found.facts[1]["distance_m"] == 300.0
    figures = answer_figures(found, seed=0, draws=20)
    assert (figures["missing"], figures["one_camera"], figures["one_camera_right"]) == (1, 2, 1)
    assert figures["accuracy"] == 0.5
    blind = answer_folder(HEIGHTS, folder, frames=2, asked=asked)  # reads Gaussians: these have none
    assert blind.exists.tolist() == [True, False, False, False]
    assert answer_folder(Bright(HEIGHTS.card), folder, frames=2).identity == ("placed",)


def test_cameras_are_left_out_for_those_who_read_crops(tmp_path):
    folder, valid = tmp_path / "rig" / "test", np.array([[True, False, True], [True, False, False]])
    clip = StoredClip(np.zeros((2, 8, 14), np.float32), "bird", "one", np.zeros((2, 3, 4, 4, 4), np.uint8), valid)
    kept = [clip.seen_by(1, seed=seed).crop_valid for seed in range(9)]
    columns = {tuple(one.any(axis=0).tolist()) for one in kept if one is not None}
    assert columns == {(True, False, False), (False, False, True)}  # never the one that shows nothing
    np.testing.assert_array_equal(clip.seen_by(3, seed=0).crop_valid, valid)
    save_clip(folder / "one.npz", clip.columns, "bird", "one", crops=clip.crops, crop_valid=valid)
    assert answer_folder(Bright(HEIGHTS.card), folder, frames=2, cameras=1).predicted.tolist() == [1]
    with pytest.raises(UserError, match="reads Gaussians, which are those of all cameras"):
        answer_folder(HEIGHTS, folder, frames=2, cameras=1)
    with pytest.raises(UserError, match="no crops to choose among"):
        StoredClip(clip.columns, "bird", "one").seen_by(1, seed=0)
