"""The one loader: weights come back with their card, and whatever is broken is named."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import jax
import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from aerojax.classify.base import Trainable, untrained
from aerojax.classify.load import CARD_KEY, SHIPPED, load_classifier, save_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.core.errors import UserError
from aerojax.core.tensors import parameter_names

SMALL = {"depth": 1, "mamba_layers": 1, "d_model": 16, "channels": 4}
CLASSIFIER = untrained(MambaSplatConfig(**SMALL), tokens=8, frames=4, key=jax.random.key(0))


@pytest.mark.parametrize("variant", ["exact", "published"])
def test_a_classifier_comes_back_with_its_card(tmp_path, variant):
    config = MambaSplatConfig(**SMALL) if variant == "exact" else published_config(**SMALL)
    classifier = untrained(config, tokens=8, frames=4, key=jax.random.key(1), rotation="z")
    path = tmp_path / "model.safetensors"
    save_classifier(path, classifier)
    again = load_classifier(path)
    assert isinstance(again, Trainable) and again.card == classifier.card and again.network.config == config
    assert jax.tree.structure(again) == jax.tree.structure(classifier)
    for a, b in zip(jax.tree.leaves(classifier), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(a, b)
    assert [p.name for p in tmp_path.iterdir()] == ["model.safetensors"]


def test_the_shipped_weights_open_without_a_path():
    shipped = {name: load_classifier(Path(name)) for name in SHIPPED}
    for name, one in shipped.items():
        assert one.card.member in (name, "ensemble") and dict(one.card.settings)["crop_size"] == 128
        assert json.loads(one.card.record)["test"]["accuracy"] > 0.7
    assert load_classifier().card == shipped["views"].card and shipped["views"].reads_crops
    assert not shipped["mambasplat"].reads_crops and shipped["mambasplat"].card.rotation_invariant


def broken(tmp_path, *, card=None, **tensors):
    """A file with other tensors (None leaves one out) or another card."""
    path = tmp_path / "model.safetensors"
    save_classifier(path, CLASSIFIER)
    kept = {name: value for name, value in (load_file(path) | tensors).items() if value is not None}
    save_file(kept, path, metadata={CARD_KEY: CLASSIFIER.card.to_json() if card is None else card})
    return path


def test_every_tensor_that_does_not_fit_is_named_at_once(tmp_path):
    name, size = "head.hidden.weight", dict(parameter_names(CLASSIFIER.network))["head.hidden.weight"].shape
    poisoned = np.zeros(size, np.float32)
    poisoned[0, 0] = np.nan
    changes = {"head.out.bias": None, "extra": np.zeros(1, np.float32), name: poisoned}
    changes |= {"head.hidden.bias": np.zeros(3, np.float32), "pool.weight": np.full((4, 4), 0.0)}
    with pytest.raises(UserError) as error:
        load_classifier(broken(tmp_path, **changes))
    assert error.value.code == "invalid"
    for part in (
        "missing tensor head.out.bias",
        "unknown tensor extra",
        "head.hidden.bias is float32 (3,), expected float32 (8,)",
        "pool.weight is float64 (4, 4), expected float32",
        f"tensor {name} holds numbers that are not finite",
    ):
        assert part in error.value.problem


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_numbers_that_are_not_finite_are_refused(tmp_path, value):
    with pytest.raises(UserError, match=r"head\.out\.bias holds numbers that are not finite"):
        load_classifier(broken(tmp_path, **{"head.out.bias": np.full(4, value, np.float32)}))


def test_files_and_headers_that_are_no_classifier_are_refused(tmp_path):
    path = tmp_path / "model.safetensors"
    with pytest.raises(UserError, match="does not exist"):
        load_classifier(path)
    path.write_bytes(b"not a tensor")
    with pytest.raises(UserError, match="not a complete safetensors file"):
        load_classifier(path)
    save_file({"a": np.zeros(1, np.float32)}, path)
    with pytest.raises(UserError, match="no entry 'card'"):
        load_classifier(path)
    without = {k: v for k, v in json.loads(CLASSIFIER.card.to_json()).items() if k != "tokens"}
    with pytest.raises(UserError, match="lacks tokens"):
        load_classifier(broken(tmp_path, card=json.dumps(without)))
    foreign = dataclasses.replace(CLASSIFIER.card, member="pointnext").to_json()
    with pytest.raises(UserError, match=r"of the kind 'pointnext', known are .*mambasplat"):
        load_classifier(broken(tmp_path, card=foreign))
    odd = dataclasses.replace(CLASSIFIER.card, config=(*CLASSIFIER.card.config, ("wings", 2))).to_json()
    with pytest.raises(UserError, match=r"(?s)the card of .*unknown key\(s\) wings"):
        load_classifier(broken(tmp_path, card=odd))
    for field, size in (("d_model", 2**62), ("depth", 2**40), ("channels", 10**30)):
        config = tuple({**dict(CLASSIFIER.card.config), field: size}.items())
        huge = dataclasses.replace(CLASSIFIER.card, config=config).to_json()
        with pytest.raises(UserError, match=r"can be made as its card says|does not fit its own card"):
            load_classifier(broken(tmp_path, card=huge))
