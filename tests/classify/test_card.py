"""Cards: back and forth through the header, what is refused by name, and what contradicts a pipeline."""

from __future__ import annotations

import dataclasses
import json

import pytest

from aerojax.classify.base import untrained_card
from aerojax.classify.card import Card, flat_settings, nested_settings
from aerojax.classify.card_markdown import card_markdown
from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.core.errors import UserError

SETTINGS = flat_settings({"crop_size": 128, "reconstruct": {"name": "hull", "grid": 64, "extent": 1.1}})
CARD = untrained_card(MambaSplatConfig(mode="C_O"), tokens=64, frames=8, settings=SETTINGS)


def test_a_card_is_the_same_after_the_header_and_hashable():
    kept = dataclasses.replace(CARD, record=json.dumps({"seed": 3}))
    again = Card.from_json(kept.to_json(), source="a")
    assert again == kept and hash(again) == hash(kept) and again != CARD
    assert dict(again.settings)["reconstruct.grid"] == 64


def test_settings_are_flat_and_back():
    nested = {"b": {"y": 1.5, "x": None}, "a": True}
    assert flat_settings(nested) == (("a", True), ("b.x", None), ("b.y", 1.5))
    assert nested_settings(flat_settings(nested)) == nested
    assert flat_settings({"sizes": (3, 4)}) == (("sizes.0", 3), ("sizes.1", 4))


def test_the_members_say_what_they_are():
    assert CARD.name == "MambaSplat-4D E(C_O), exact variant" and CARD.member == "mambasplat"
    assert CARD.rotation_invariant and CARD.scale_normalisation == "running"
    assert not untrained_card(published_config(), tokens=1, frames=1).rotation_invariant


def test_a_pipeline_that_contradicts_the_card_is_refused():
    CARD.require(dict(SETTINGS) | {"something.else": 1})
    CARD.require({"reconstruct.extent": 1.1})
    with pytest.raises(UserError) as error:
        CARD.require({"crop_size": 96, "reconstruct.grid": 32, "reconstruct.extent": 1.1})
    assert error.value.code == "mismatch"
    for part in ("crop_size is 96, in training it was 128", "reconstruct.grid is 32, in training it was 64"):
        assert part in error.value.problem
    assert "set crop_size=128 reconstruct.grid=64" in error.value.remedy


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda card: "no json", "unreadable", "no JSON object"),
        (lambda card: "[]", "unreadable", "no JSON object"),
        (lambda card: "[" * 100_000, "unreadable", "no JSON object"),
        (lambda card: card | {"rotation": []}, "invalid", "rotation is []"),
        (lambda card: {k: v for k, v in card.items() if k not in ("tokens", "classes")}, "missing", "classes, tokens"),
        (lambda card: card | {"mood": 1}, "invalid", "unknown field mood"),
        (lambda card: card | {"tokens": 0, "rotation": "x"}, "invalid", "tokens is 0; rotation is 'x'"),
        (lambda card: card | {"settings": {"a": [1]}}, "invalid", "settings is"),
    ],
)
def test_broken_cards_are_refused_by_name(change, code, words):
    changed = change(json.loads(CARD.to_json()))
    with pytest.raises(UserError) as error:
        Card.from_json(changed if isinstance(changed, str) else json.dumps(changed), source="file.safetensors")
    assert error.value.code == code and words in error.value.problem and "file.safetensors" in error.value.problem


def test_numbers_that_no_clip_can_be_read_with_are_refused():
    with pytest.raises(UserError, match="token_ensembles is 0"):
        dataclasses.replace(CARD, token_ensembles=0)


def test_the_page_says_what_the_record_knows():
    bare = card_markdown(CARD, 12345)
    assert "12,345 parameters" in bare and "never turned" in bare and "`reconstruct.grid=64`" in bare
    assert "Test on" not in bare
    test = {"clips": 3, "accuracy": 2 / 3, "macro_f1": 0.5, "recall": [1.0, None, 0.5, 0.0]}
    test["confusion"] = [[1, 0, 0, 0], [0] * 4, [0, 0, 1, 1], [1, 0, 0, 0]]
    record = {"command": "python -m experiments.train_classifier", "seed": 0, "commit": "abc", "minutes": 9.2}
    record |= {"machine": {"cpus": 2}, "clips": ["data/a"], "test": test, "test_identities": 3}
    page = card_markdown(dataclasses.replace(CARD, record=json.dumps(record)), 12345)
    for part in ("Made by `python -m", "in 9 minutes on 2 CPU", "data/a", "accuracy 66.7 %", "| drone | - |"):
        assert part in page
