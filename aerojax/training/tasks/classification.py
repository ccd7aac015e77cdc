"""What it means to train a classifier on clips: how a batch is drawn, its loss, and what validation counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Key

from aerojax.classify.base import CLIP_AXIS, Classifier, ClassifierConfig, Settings, Trainable, untrained, with_card
from aerojax.data.clips import ClipSet
from aerojax.evaluate.answers import TEST_ENSEMBLES, crops_from_bytes, crops_read, log_probabilities
from aerojax.evaluate.calibration import fit_temperature
from aerojax.evaluate.labels import label_figures
from aerojax.training.distribution import own_share
from aerojax.training.loop import Fit, TrainingConfig, fit, smoothed_cross_entropy
from aerojax.training.variation import VariationConfig, epoch_order, vary_clip, vary_crops


@dataclass(frozen=True)
class ClipTask:
    """The clips of a run and how they are drawn; `crops` tells whether the classifier reads their crops."""

    train: ClipSet
    val: ClipSet
    variation: VariationConfig
    training: TrainingConfig
    seed: int
    crops: bool = False

    def loss(self, classifier: Trainable, batch: Any, keys: Key[Array, "clip"]) -> Float[Array, ""]:
        """Mean smoothed cross entropy of prepared and varied clips, over all heads that learn.

        Args:
            classifier: which learns.
            batch: (columns, present, label, crops as bytes and which views count, or None).
            keys: one a clip.
        """

        def logits(columns: Array, present: Array, crops: Any, key: Array) -> Array:
            vary, drop = jax.random.split(key)
            clip, mask = vary_clip(classifier.prepare(columns), present, self.variation, key=vary)
            seen = None if crops is None else vary_crops(crops_from_bytes(*crops), present, self.variation, key=vary)
            return classifier.training_logits(clip, mask, seen, key=drop)

        columns, present, label, crops = batch
        found = jax.vmap(logits, axis_name=CLIP_AXIS)(columns, present, crops, keys)
        return jnp.mean(smoothed_cross_entropy(found, label[:, None], self.training.label_smoothing))

    def batches(self, epoch: int) -> Iterator[Any]:
        """This process' share of each batch of an epoch."""
        clips, passes = self.train, self.training.passes
        for number in range(epoch * passes, (epoch + 1) * passes):
            for index in epoch_order(len(clips.label), self.training.batch, seed=self.seed, epoch=number):
                share = own_share(index)
                crops = None
                if self.crops and clips.crops is not None and clips.crop_valid is not None:
                    crops = clips.crops[share], clips.crop_valid[share]
                yield clips.columns[share], clips.present[share], clips.label[share], crops

    def validate(self, classifier: Classifier) -> dict[str, float]:
        """Figures of whole validation clips, each frame read by its first tokens alone."""
        answers = log_probabilities(with_card(classifier, token_ensembles=1), self.val)
        figures = label_figures(answers, self.val.label)
        # Accuracy of a few dozen clips is coarse; the likelihood breaks its ties.
        score = figures["accuracy"] - 0.1 * figures["nll"]
        return {"accuracy": figures["accuracy"], "nll": figures["nll"], "score": score}

    @property
    def steps_per_epoch(self) -> int:
        """Whole batches of the training clips, in all passes."""
        return self.training.passes * (len(self.train.label) // self.training.batch)


def train_classifier(
    model: ClassifierConfig,
    task: ClipTask,
    *,
    settings: Settings,
    directory: Path,
    report: Callable[[dict[str, float]], None],
    watch: Callable[[int, dict[str, float]], None],
) -> Trainable:
    """Train a classifier, or go on with the run that the directory holds.

    Args:
        model: what is trained; its weights are drawn by the task's seed.
        task: clips, variation and optimisation.
        settings: of the pipeline that made the clips, for the card.
        directory: of checkpoints and history.
        report: called with the figures of each epoch.
        watch: called with each step's number and figures.

    Returns:
        The classifier with the best validation score, its temperature fitted there too; its card has no record yet.

    Raises:
        UserError: as `fit`.
    """
    classifier = untrained(
        model,
        tokens=task.variation.tokens,
        frames=task.variation.frames,
        key=jax.random.key(task.seed),
        token_ensembles=TEST_ENSEMBLES,
        rotation=task.variation.rotation,
        settings=settings,
    )
    if classifier.reads_crops:
        crops_read(classifier, task.train)
        task = replace(task, crops=True)
    todo = Fit(task.loss, task.batches, task.steps_per_epoch, task.validate, report, watch)
    return calibrated(fit(classifier, todo, task.training, seed=task.seed, directory=directory), task.val)


def calibrated(classifier: Trainable, val: ClipSet) -> Trainable:
    """The same classifier with the temperature that its validation clips ask for."""
    plain = with_card(classifier, temperature=1.0)
    return with_card(plain, temperature=fit_temperature(log_probabilities(plain, val), val.label))
