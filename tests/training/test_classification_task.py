"""How the classifier's training reads clips, and the recipe of the released model."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf
from support.clip_examples import random_clip

from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.mambasplat.lifting import normalise_published
from aerojax.core.config import to_dataclass
from aerojax.training.loop import TrainingConfig
from aerojax.training.tasks.classification import ClipTask, as_trained_on
from aerojax.training.variation import ClipSet, VariationConfig
from experiments._launch.command import CONF_DIR
from experiments.train_classifier import Config

CLIPS = ClipSet(
    np.stack([np.asarray(random_clip(seed, time=3, tokens=8)) for seed in range(6)]),
    np.ones((6, 3), bool),
    np.arange(6) % 4,
    tuple("abcdef"),
)


def test_the_published_variant_is_trained_on_whole_normalised_frames():
    assert as_trained_on(MambaSplatConfig(), CLIPS) is CLIPS
    ours = as_trained_on(published_config(), CLIPS)
    np.testing.assert_allclose(ours.columns[2, 1], normalise_published(jnp.asarray(CLIPS.columns[2, 1])), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(ours.columns[..., :3], axis=-1).max(axis=-1), 1.0, rtol=1e-5)
    assert ours.identity == CLIPS.identity


def test_the_published_preset_is_the_released_recipe():
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(CONF_DIR), version_base="1.3"):
        values = OmegaConf.to_container(compose("train_classifier", ["preset=published"]), resolve=True)
    config = to_dataclass(values, Config)  # type: ignore[arg-type]
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
    ((columns, present, label),) = task.batches(3, CLIPS)
    assert columns.shape == (4, 3, 8, 14) and present.shape == (4, 3)
    for clip, number in zip(columns, label, strict=True):
        assert any(np.array_equal(clip, c) and number == n for c, n in zip(CLIPS.columns, CLIPS.label, strict=True))
