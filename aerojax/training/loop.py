"""The training loop: nothing model-specific, deterministic by seed, resumable at every epoch."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import optax

from aerojax.errors import UserError
from aerojax.training.checkpoint import latest_step, restore_state, save_state
from aerojax.training.optimisers import OptimiserConfig, adamw

_Model = TypeVar("_Model")
Loss = Callable[[Any, Any, Any], jax.Array]
"""loss(model, batch, key) -> scalar mean."""


@dataclass(frozen=True)
class TrainingConfig:
    """Length and rhythm of a run.

    average: decay a step of the moving average of the weights, which is what is validated and kept; 0 keeps the
        weights themselves (Polyak & Juditsky 1992).
    """

    epochs: int = 40
    batch: int = 16
    label_smoothing: float = 0.1
    average: float = 0.98
    optimiser: OptimiserConfig = field(default_factory=OptimiserConfig)


@dataclass(frozen=True)
class Fit:
    """What a run needs besides a model.

    loss: as `Loss`.
    batches: epoch -> the epoch's batches in order; equal for equal epochs.
    steps_per_epoch: how many batches that is.
    validate: model -> figures; `score` among them decides which model is best.
    report: called with the history's newest row after every epoch.
    """

    loss: Loss
    batches: Callable[[int], Any]
    steps_per_epoch: int
    validate: Callable[[Any], dict[str, float]]
    report: Callable[[dict[str, float]], None]


def fit(model: _Model, task: Fit, config: TrainingConfig, *, seed: int, directory: Path) -> _Model:
    """Train and return the model with the best validation score.

    Checkpoints and `history.jsonl` in `directory` let a killed run go on from its last whole epoch with the same
    numbers as an uninterrupted one.

    Raises:
        UserError: an epoch has no batch, or the loss is not finite; the last good checkpoint stays.
    """
    if task.steps_per_epoch < 1:
        raise UserError(f"training.batch={config.batch} is larger than the training set; lower it or make more clips")
    optimiser = adamw(config.optimiser, config.epochs * task.steps_per_epoch)
    update = _update_step(task.loss, optimiser, config.average)
    state = (model, optimiser.init(model), model, model, np.array(-np.inf))  # pyrefly: ignore
    checkpoints, history = directory / "checkpoints", directory / "history.jsonl"
    done = latest_step(checkpoints)
    if done is not None:
        state = restore_state(checkpoints, done, state)
        _trim(history, done)
    for epoch in range(done or 0, config.epochs):
        current, moments, average, best, score = state
        losses = []
        for index, batch in enumerate(task.batches(epoch)):
            step = epoch * task.steps_per_epoch + index
            key = jax.random.fold_in(jax.random.key(seed), step)
            current, moments, average, loss = update(current, moments, average, batch, key, np.int32(step))
            losses.append(loss)
        mean = float(jnp.mean(jnp.stack(losses)))
        if not np.isfinite(mean):
            raise UserError(f"the loss is not finite in epoch {epoch + 1}; lower training.optimiser.learning_rate")
        row = {"epoch": epoch + 1, "loss": mean, **task.validate(average)}
        if row["score"] > float(score):
            best, score = average, np.array(row["score"])
        state = (current, moments, average, best, score)
        save_state(checkpoints, epoch + 1, state)
        with history.open("a") as file:
            file.write(json.dumps(row) + "\n")
        task.report(row)
    return state[3]


def _update_step(loss: Loss, optimiser: optax.GradientTransformation, decay: float) -> Callable[..., Any]:
    @jax.jit
    def update(model: Any, moments: Any, average: Any, batch: Any, key: Any, step: Any) -> tuple[Any, ...]:
        value, gradient = jax.value_and_grad(loss)(model, batch, key)
        change, moments = optimiser.update(gradient, moments, model)
        model = optax.apply_updates(model, change)
        # Short memory at first, so that the initial weights do not linger.
        share = 1 - jnp.minimum(decay, step / (step + 10))
        average = jax.tree.map(lambda old, new: old + share * (new - old), average, model)
        return model, moments, average, value

    return update


def _trim(history: Path, epochs: int) -> None:
    """Drop rows written after the checkpoint that the run goes on from."""
    if history.exists():
        rows = history.read_text().splitlines()[:epochs]
        history.write_text("".join(row + "\n" for row in rows))


def smoothed_cross_entropy(logits: jax.Array, labels: jax.Array, smoothing: float) -> jax.Array:
    """Cross entropy with 1-ε of the mass on the true class and ε/(K-1) on each other one (ε = `smoothing`)."""
    classes = logits.shape[-1]
    target = jax.nn.one_hot(labels, classes)
    target = target * (1 - smoothing) + (1 - target) * smoothing / (classes - 1)
    return -jnp.sum(target * jax.nn.log_softmax(logits), axis=-1)
