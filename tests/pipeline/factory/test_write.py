"""A folder of clips: the same bytes for any workers, gone on with, extended, refused; the stream holds the same."""

from __future__ import annotations

import numpy as np
import pytest
from support.factory_configs import small_factory

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.clips import load_clip, load_clips, save_clip
from aerojax.pipeline.clips import settings_of
from aerojax.pipeline.config import clip_settings
from aerojax.pipeline.factory.clips import clips_of
from aerojax.pipeline.factory.write import clip_path, clip_stream, individuals_of, make_factory_clips


def tree(folder) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*.npz"))}


def make(folder, workers: int = 1, **changes):
    return make_factory_clips(small_factory(**changes), folder, workers=workers, progress=lambda *_: None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One clip of one individual a class."""
    folder = tmp_path_factory.mktemp("clips")
    assert make(folder).counts == {"sphere/train": 4}
    return folder


def test_clips_load_with_their_settings(folder):
    clips = load_clips(folder / "sphere" / "train", frames=2)
    assert sorted(CLASSES[i] for i in clips.label) == sorted(CLASSES)
    assert clips.crops is not None and clips.crops.shape == (4, 2, 8, 32, 32, 4)
    assert {facts["rig"] for facts in clips.facts} == {"sphere"}
    assert dict(settings_of(folder / "sphere")) == clip_settings(small_factory().pipeline)


def test_a_killed_run_goes_on_and_more_clips_extend_it(folder, tmp_path):
    place = tmp_path / "clips"
    first = make(place)
    assert first.new == 4 and tree(place) == tree(folder)
    lost = next(place.rglob("*.npz"))
    lost.unlink()
    assert make(place).new == 1 and tree(place) == tree(folder)
    assert make(place).new == 0
    more = make(place, clips=2)
    assert (more.counts, more.new) == ({"sphere/train": 8}, 4)
    assert tree(folder).items() < tree(place).items()
    with pytest.raises(UserError, match="another frames, least_frames"):
        make(place, frames=3, least_frames=2)


@pytest.mark.slow
def test_workers_change_nothing(folder, tmp_path):
    assert make(tmp_path, workers=2).new == 4
    assert tree(tmp_path) == tree(folder)


def test_the_stream_holds_the_same_clips(folder):
    streamed = list(clip_stream(small_factory()))
    stored = {clip.identity: clip for clip in map(load_clip, folder.rglob("*.npz"))}
    assert [clip.label for clip in streamed] == list(CLASSES)
    for clip in streamed:
        np.testing.assert_array_equal(clip.columns, stored[clip.identity].columns)
        np.testing.assert_array_equal(clip.crops, stored[clip.identity].crops)
        assert clip.facts == stored[clip.identity].facts


def test_outliers_lie_apart_and_join_no_clips_of_the_classes(folder, tmp_path):
    config = small_factory(catalogue="outliers", split="test")
    one = next(job for job in individuals_of(config) if job.family == "box")
    name, clip = next(clips_of(one, [0], config))
    assert clip is not None and (clip.label, clip.classes, clip.facts["kind"]) == ("unknown", ("unknown",), "box")
    place = clip_path(tmp_path, one, 0, config)
    assert place == tmp_path / "sphere" / "outliers_test" / f"{name}.npz"
    images = {"crops": clip.crops, "crop_valid": clip.crop_valid, "classes": clip.classes}
    save_clip(place, clip.columns, clip.label, clip.identity, **images)
    assert load_clips(place.parent, frames=2).classes == ("unknown",)
    with pytest.raises(UserError, match="is of the classes unknown"):
        load_clips(folder / "sphere" / "train", place.parent, frames=2)
    with pytest.raises(UserError, match="never learnt from"):
        individuals_of(small_factory(catalogue="outliers"))


def test_individuals_keep_to_their_split():
    train = individuals_of(small_factory(individuals=14))
    assert [one.label for one in train[:4]] == list(CLASSES) and len({one.name for one in train}) == 4 * 14
    assert train[: 4 * 3] == individuals_of(small_factory(individuals=3))
    assert {one.split for one in train} == {"train"}
    assert any(one.family == "hybrid" for one in train)
    for split in ("val", "test"):
        others = individuals_of(small_factory(individuals=5, split=split))
        assert {one.split for one in others} == {split} and len(others) == 4 * 5
