"""How the classifier's training reads clips, and the recipe of the released model."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip

from aerojax.classify.base import untrained
from aerojax.classify.mambasplat.classifier import MambaSplatClassifier
from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.core.config import to_dataclass
from aerojax.core.types import pytree_dataclass
from aerojax.data.clips import ClipSet
from aerojax.training.loop import TrainingConfig
from aerojax.training.tasks.classification import ClipTask
from aerojax.training.variation import VariationConfig
from experiments._launch.classifier_training import ClassifierTraining
from experiments._launch.composition import composed

TINY = {
    "depth": 1,
    "mamba_layers": 1,
    "d_model": 16,
    "channels": 4,
    "dropout": 0.0,
    "drop_path": 0.0,
    "head_dropout": 0.0,
}


@pytree_dataclass
class AsIs(MambaSplatClassifier):
    """A classifier that takes frames as already prepared."""

    def prepare(self, columns):
        return columns


CLIPS = ClipSet(
    np.stack([np.asarray(random_clip(seed, time=3, tokens=8)) for seed in range(6)]),
    np.ones((6, 3), bool),
    np.arange(6) % 4,
    tuple("abcdef"),
)


@pytest.mark.long
@pytest.mark.parametrize("variant", ["exact", "published"])
def test_frames_are_prepared_whole_before_tokens_are_drawn(variant):
    config = MambaSplatConfig(**TINY) if variant == "exact" else published_config(**TINY)
    classifier = untrained(config, tokens=4, frames=2, key=jax.random.key(0))
    frame = CLIPS.columns[2, 1]
    prepared = classifier.prepare(jnp.asarray(frame))
    if variant == "exact":
        np.testing.assert_array_equal(prepared, frame)
    else:
        assert np.linalg.norm(prepared[:, :3], axis=-1).max() == pytest.approx(1.0, rel=1e-5)
    task = ClipTask(CLIPS, CLIPS, VariationConfig(frames=2, tokens=4), TrainingConfig(batch=4), 0)
    keys, (batch,) = jax.random.split(jax.random.key(1), 4), task.batches(0)
    batch = jax.tree.map(jnp.asarray, batch)
    ready = (jax.vmap(jax.vmap(classifier.prepare))(batch[0]), *batch[1:])
    loss = jax.jit(lambda classifier, batch: task.loss(classifier, batch, keys))
    as_is = AsIs(classifier.network, classifier.card)
    np.testing.assert_allclose(loss(classifier, batch), loss(as_is, ready), rtol=1e-5)
    if variant == "published":
        assert abs(loss(classifier, batch) - loss(as_is, batch)) > 1e-4


def test_the_published_preset_is_the_released_recipe():
    values = composed("train_classifier", ClassifierTraining, "preset=published", "classify=mambasplat")
    config = to_dataclass(values, ClassifierTraining)
    assert config.model == published_config("X")
    assert (config.variation.frames, config.variation.tokens, config.variation.stride) == (16, 512, 3)
    assert (config.variation.axis_scale, config.variation.jitter, config.variation.drop) == (0.1, 0.0, 0.0)
    assert (config.training.epochs, config.training.batch, config.training.average) == (50, 8, 0.0)
    optimiser = config.training.optimiser
    assert (optimiser.learning_rate, optimiser.weight_decay, optimiser.clip_norm) == (1e-3, 0.05, 1.0)
    assert (optimiser.beta1, optimiser.beta2, optimiser.plateaus) == (0.9, 0.95, 50)
    assert round(optimiser.warmup * optimiser.plateaus) == 3
    assert np.isclose(optimiser.learning_rate * optimiser.final, 1e-6)


def test_an_epoch_reads_whole_batches_in_the_epoch_s_order():
    task = ClipTask(CLIPS, CLIPS, VariationConfig(), TrainingConfig(batch=4), 0)
    assert task.steps_per_epoch == 1
    ((columns, present, label, crops),) = task.batches(3)
    assert crops is None
    assert columns.shape == (4, 3, 8, 14) and present.shape == (4, 3)
    for clip, number in zip(columns, label, strict=True):
        assert any(np.array_equal(clip, c) and number == n for c, n in zip(CLIPS.columns, CLIPS.label, strict=True))
