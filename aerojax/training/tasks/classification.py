"""What it means to train MambaSplat-4D on clips: how a batch is drawn, its loss, and what validation counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key

from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.released.normalisation import normalise_published
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.evaluate.clip_reading import predict
from aerojax.evaluate.labels import label_figures
from aerojax.training.distribution import own_share
from aerojax.training.loop import Fit, TrainingConfig, smoothed_cross_entropy
from aerojax.training.variation import ClipSet, VariationConfig, epoch_order, vary_clip


@dataclass(frozen=True)
class ClipTask:
    """The clips of a run and how they are drawn."""

    train: ClipSet
    val: ClipSet
    variation: VariationConfig
    training: TrainingConfig
    seed: int

    def loss(self, model: MambaSplat, batch: Any, keys: Key[Array, "clip"]) -> Float[Array, ""]:
        """Mean smoothed cross entropy of varied clips; batch = (columns, present, label)."""

        def logits(columns: Array, present: Array, key: Array) -> Array:
            vary, drop = jax.random.split(key)
            clip, mask = vary_clip(columns, present, self.variation, key=vary)
            return model(clip, mask, key=drop)

        columns, present, label = batch
        found = jax.vmap(logits)(columns, present, keys)
        return jnp.mean(smoothed_cross_entropy(found, label, self.training.label_smoothing))

    def batches(self, epoch: int, train: ClipSet) -> Iterator[Any]:
        """This process' share of each batch of an epoch."""
        for index in epoch_order(len(train.label), self.training.batch, seed=self.seed, epoch=epoch):
            share = own_share(index)
            yield train.columns[share], train.present[share], train.label[share]

    def validate(self, model: MambaSplat) -> dict[str, float]:
        """Figures of whole validation clips, read as the pipeline reads them."""
        figures = label_figures(predict(model, self.val, self.variation.tokens), self.val.label)
        # Accuracy of a few dozen clips is coarse; the likelihood breaks its ties.
        score = figures["accuracy"] - 0.1 * figures["nll"]
        return {"accuracy": figures["accuracy"], "nll": figures["nll"], "score": score}

    @property
    def steps_per_epoch(self) -> int:
        """Whole batches of the training clips."""
        return len(self.train.label) // self.training.batch

    def fit_task(self, model: MambaSplat, watch: Callable[..., None], report: Callable[..., None]) -> Fit:
        """The task for `fit`, for models of this one's kind."""
        batches = partial(self.batches, train=as_trained_on(model.config, self.train))
        return Fit(self.loss, batches, self.steps_per_epoch, self.validate, report, watch)


def as_trained_on(config: MambaSplatConfig, clips: ClipSet) -> ClipSet:
    """Metric clips for the exact variant; for the published one each whole frame normalised before it is varied."""
    if config.variant == "exact":
        return clips
    normalise = jax.jit(jax.vmap(normalise_published))
    return replace(clips, columns=np.stack([np.asarray(normalise(clip)) for clip in clips.columns]))
