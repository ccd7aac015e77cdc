"""The fused classifier: each path alone, invariance of the Gaussian path, streams that equal clips, path dropout."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip, rotate_columns
from support.crop_examples import crops_of, random_crops

from aerojax.classify.base import Classifier, Trainable, untrained
from aerojax.classify.fused.config import FusedConfig
from aerojax.classify.load import load_classifier, save_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.views.config import ViewsConfig
from aerojax.core.errors import UserError
from aerojax.core.types import Evidence, Gaussians
from aerojax.geometry.rotations import haar_rotation

GAUSSIANS = {"depth": 1, "mamba_layers": 2, "d_model": 16, "channels": 4, "token_features": 8, "token_invariants": 8}
VIEWS = {"width": 16, "hidden": 16, "view_width": 16, "d_model": 16}
TIME, TOKENS, CAMERAS = 6, 20, 4
PRESENT = np.array([1, 1, 0, 1, 0, 1], bool)


def config_of(**changes):
    return FusedConfig(gaussians=MambaSplatConfig(**GAUSSIANS), views=ViewsConfig(**VIEWS), hidden=16, **changes)


@pytest.fixture(scope="module")
def classifier():
    return untrained(config_of(), tokens=8, frames=TIME, key=jax.random.key(0), token_ensembles=3)


def evidence(seed, kind="both"):
    """Of both kinds, or with crops or Gaussians missing in the ways they can be."""
    columns, crops = random_clip(seed, time=TIME, tokens=TOKENS), random_crops(seed, time=TIME, views=CAMERAS)
    if kind == "transparent":
        columns = columns.at[..., 10].set(0.0)
    if kind == "no Gaussians":
        columns = columns[:, :0]
    if kind == "no view counts":
        crops = crops_of(crops.rgba, jnp.zeros_like(crops.valid))
    if kind == "partly":
        columns = columns.at[:3, :, 10].set(0.0)
        crops = crops_of(crops.rgba, crops.valid.at[2:4].set(False))
    return Evidence(Gaussians.from_columns(columns), None if kind == "no crops" else crops)


KINDS = ("both", "transparent", "no Gaussians", "no view counts", "no crops", "partly")


@jax.jit
def whole(classifier, seen, present):
    return classifier.clip(seen, present)


@jax.jit
def fold(classifier, seen, present):
    def step(state, frame):
        logits, state = classifier.step(*frame, state)
        return state, logits

    return jax.lax.scan(step, classifier.initial(), (seen, present))[1]


@pytest.mark.parametrize("kind", KINDS)
def test_the_fold_of_steps_is_the_clip(classifier, kind):
    assert isinstance(classifier, Classifier) and isinstance(classifier, Trainable)
    assert classifier.causal and classifier.reads_crops
    seen, present = evidence(1, kind), jnp.asarray(PRESENT)
    np.testing.assert_allclose(fold(classifier, seen, present), whole(classifier, seen, present), atol=1e-5)


def test_evidence_that_is_missing_is_missing_however_it_is(classifier):
    present = jnp.asarray(PRESENT)
    read = {kind: whole(classifier, evidence(2, kind), present) for kind in KINDS}
    np.testing.assert_allclose(read["no crops"], read["no view counts"], atol=1e-6)
    np.testing.assert_allclose(read["no Gaussians"], read["transparent"], atol=1e-6)
    for kind in ("no crops", "no Gaussians", "partly"):
        assert jnp.abs(read[kind] - read["both"]).max() > 1e-4


def test_the_gaussian_path_does_not_see_rotations(classifier):
    seen, present = evidence(3, "no crops"), jnp.asarray(PRESENT)
    logits = whole(classifier, seen, present)
    for key in jax.random.split(jax.random.key(4), 4):
        turned = Gaussians.from_columns(rotate_columns(seen.gaussians.columns(), haar_rotation(key=key)))
        np.testing.assert_allclose(whole(classifier, Evidence(turned), present), logits, atol=1e-5)
    stretched = Gaussians.from_columns(seen.gaussians.columns().at[..., 0].multiply(2.0))
    assert jnp.abs(whole(classifier, Evidence(stretched), present) - logits).max() > 1e-3


def test_world_and_cameras_together_do_not_change_the_answer(classifier):
    seen, present = evidence(5), jnp.asarray(PRESENT)
    turned = Gaussians.from_columns(rotate_columns(seen.gaussians.columns(), haar_rotation(key=jax.random.key(6))))
    again = whole(classifier, Evidence(turned, seen.crops), present)
    np.testing.assert_allclose(again, whole(classifier, seen, present), atol=1e-5)
    order = np.array([3, 1, 0, 2])
    shuffled = crops_of(seen.crops.rgba[:, order], seen.crops.valid[:, order])
    again = whole(classifier, Evidence(seen.gaussians, shuffled), present)
    np.testing.assert_allclose(again, whole(classifier, seen, present), atol=1e-5)


@pytest.fixture(scope="module")
def heads():
    @jax.jit
    def run(classifier, seen, mask, keys):
        columns = seen.gaussians.columns()
        return jax.vmap(lambda key: classifier.training_logits(columns, mask, seen.crops, key=key))(keys)

    return run


@pytest.mark.long
def test_dropped_paths_leave_the_answer_to_the_other_and_its_own_head_as_it_was(heads):
    plain = {"dropout": 0.0, "drop_path": 0.0, "head_dropout": 0.0}
    config = FusedConfig(
        gaussians=MambaSplatConfig(**GAUSSIANS, **plain),
        views=ViewsConfig(**VIEWS, **plain, view_dropout=0.0),
        hidden=16,
        path_dropout=1.0,
        head_dropout=0.0,
    )
    classifier = untrained(config, tokens=TOKENS, frames=TIME, key=jax.random.key(0), token_ensembles=1)
    seen, mask = evidence(7), jnp.ones((TIME, TOKENS), bool)
    found = heads(classifier, seen, mask, jax.random.split(jax.random.key(1), 16))
    assert found.shape == (16, 3, 4)
    np.testing.assert_allclose(found[:, 1:], jnp.broadcast_to(found[:1, 1:], (16, 2, 4)), atol=1e-6)
    every = jnp.ones(TIME, bool)
    alone = [whole(classifier, evidence(7, kind), every)[-1] for kind in ("no crops", "no Gaussians")]
    distance = jnp.stack([jnp.abs(jax.nn.log_softmax(found[:, 0]) - row[None]).max(axis=1) for row in alone])
    assert float(distance.min(axis=0).max()) < 1e-5
    assert set(np.asarray(distance.argmin(axis=0)).tolist()) == {0, 1}


@jax.jit
def slope_of(classifier, seen, mask):
    def loss(classifier):
        logits = classifier.training_logits(seen.gaussians.columns(), mask, seen.crops, key=jax.random.key(2))
        return logits[:, 0].sum()

    return jax.grad(loss)(classifier)


@pytest.mark.parametrize("kind", ["both", "no view counts", "no crops"])
@pytest.mark.parametrize("tokens", [True, False])
def test_gradients_are_finite_whatever_is_missing(classifier, kind, tokens):
    seen, mask = evidence(8, kind), jnp.full((TIME, TOKENS), tokens)

    slope = slope_of(classifier, seen, mask)
    assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves(slope))
    assert jnp.abs(slope.network.joint.out.bias[...]).max() > 0


def test_it_is_saved_and_opened(tmp_path, classifier):
    save_classifier(tmp_path / "fused.safetensors", classifier)
    again = load_classifier(tmp_path / "fused.safetensors")
    assert again.card == classifier.card
    seen, present = evidence(9), jnp.asarray(PRESENT)
    np.testing.assert_array_equal(whole(again, seen, present), whole(classifier, seen, present))


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"hidden": 0}, "hidden"),
        ({"path_dropout": 1.5}, "path_dropout"),
        ({"gaussians": published_config()}, "variant"),
        ({"views": ViewsConfig(classes=3)}, "classes"),
    ],
)
def test_what_cannot_be_built_is_refused(changes, field):
    with pytest.raises(UserError, match=field):
        FusedConfig(**changes)


def test_a_gaussian_path_that_looks_ahead_says_so():
    config = FusedConfig(
        gaussians=MambaSplatConfig(**GAUSSIANS, scale_normalisation="clip"), views=ViewsConfig(**VIEWS), hidden=16
    )
    classifier = untrained(config, tokens=8, frames=TIME, key=jax.random.key(0))
    assert not classifier.causal
    seen = jax.tree.map(lambda leaf: leaf[0], evidence(0))
    with pytest.raises(UserError, match="scale_normalisation is 'clip'"):
        classifier.step(seen, jnp.ones((), bool), classifier.initial())
