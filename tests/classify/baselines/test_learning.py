"""The baselines learn through the loss and optimiser of every classifier, running statistics included."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from support.clip_examples import random_clip
from support.tiny_baselines import CLIP_WISE, FRAME_WISE, TIME, TOKENS, long, tiny_classifier

from aerojax.classify.base import untrained_card
from aerojax.classify.load import load_classifier, save_classifier
from aerojax.classify.members import MEMBERS
from aerojax.core.tensors import statistics
from aerojax.data.clips import ClipSet
from aerojax.training.loop import TrainingConfig
from aerojax.training.optimisers import OptimiserConfig, optimiser_of
from aerojax.training.tasks.classification import ClipTask, train_classifier
from aerojax.training.variation import VariationConfig

BATCH, STEPS = 8, 60


def clips() -> ClipSet:
    """Clouds of four classes, flat in different directions of their own."""
    columns = [np.array(random_clip(seed, time=TIME, tokens=2 * TOKENS)) for seed in range(BATCH)]
    for index, clip in enumerate(columns):
        clip[..., :3] *= [[1, 1, 1], [3, 1, 0.3], [3, 0.3, 0.3], [1, 1, 0.1]][index % 4]
    present = np.ones((BATCH, TIME), bool)
    present[1, 4:], present[2, 1:] = False, False
    return ClipSet(np.stack(columns), present, np.arange(BATCH) % 4, tuple("abcdefgh"))


VARIATION = VariationConfig(frames=TIME, tokens=TOKENS, colour=0.0)


@pytest.mark.long
@pytest.mark.parametrize("name", ["vn_pointnet", "p4transformer", *long("vn_dgcnn", "mamba4d")])
def test_the_loss_falls(name):
    task = ClipTask(clips(), clips(), VARIATION, TrainingConfig(batch=BATCH, label_smoothing=0.0), 0)
    classifier = tiny_classifier(name)
    optimiser = optimiser_of(OptimiserConfig(learning_rate=5e-3), steps=STEPS)
    state = optimiser.init(classifier)
    batch = jax.tree.map(jnp.asarray, next(iter(task.batches(0))))

    @jax.jit
    def update(classifier, state, key):
        value, gradient = jax.value_and_grad(task.loss)(classifier, batch, jax.random.split(key, BATCH))
        change, state = optimiser.update(gradient, state, classifier)
        return optax.apply_updates(classifier, change), state, value

    losses, before = [], classifier
    for key in jax.random.split(jax.random.key(1), STEPS):
        classifier, state, value = update(classifier, state, key)
        losses.append(float(value))
    assert np.mean(losses[-5:]) < 0.9 * np.mean(losses[:5]), losses
    moved = jax.tree.map(lambda a, b, own: own and not np.array_equal(a, b), before, classifier, statistics(before))
    assert any(jax.tree.leaves(moved)) == (name != "p4transformer")


@pytest.mark.long
@pytest.mark.parametrize("name", [*FRAME_WISE, *CLIP_WISE])
def test_small_members_are_trained_stored_and_read_again(name, tmp_path):
    training = TrainingConfig(epochs=3, batch=4, micro_batches=2, average=0.5)
    task = ClipTask(clips(), clips(), VARIATION, training, 0)
    heard: list[dict[str, float]] = []
    config = MEMBERS[name](size="small")
    quiet = {"report": heard.append, "watch": lambda step, figures: None}
    trained = train_classifier(config, task, settings=(), directory=tmp_path, **quiet)
    save_classifier(tmp_path / "weights.safetensors", trained)
    again = load_classifier(tmp_path / "weights.safetensors")
    assert again.card == trained.card and again.card.member == name
    np.testing.assert_array_equal(task.validate(again)["nll"], task.validate(trained)["nll"])
    assert len(heard) == training.epochs and all(np.isfinite(row["loss"]) for row in heard)


def test_cards_say_what_was_read():
    made = {name: untrained_card(MEMBERS[name](), tokens=64, frames=8) for name in (*FRAME_WISE, *CLIP_WISE)}
    assert {card.scale_normalisation for card in made.values()} == {"frame"}
    assert [card.rotation_invariant for card in made.values()] == [True, True, False, False]
