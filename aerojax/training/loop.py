"""The training loop: nothing model-specific, deterministic by seed, and resumable at every checkpoint with equal bits.

What a step does depends on the weights, the seed and the step's number alone, so a run that was killed and goes on from
a checkpoint repeats the steps in between with the same numbers.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float32, Key

from aerojax.core.errors import UserError
from aerojax.core.files import write_text
from aerojax.core.types import pytree_dataclass
from aerojax.training.checkpoint import latest_step, restore_state, save_state
from aerojax.training.distribution import Devices, devices_for, from_first_process, is_first_process
from aerojax.training.optimisers import OptimiserConfig, optimiser_of, without_statistics

_Model = TypeVar("_Model")
Loss = Callable[[Any, Any, Key[Array, "batch"]], jax.Array]
"""loss(model, batch, keys) -> scalar mean over examples; example i may use keys[i] alone, however batches are cut."""


@dataclass(frozen=True)
class TrainingConfig:
    """Length and rhythm of a run.

    epochs: after each of them the model is validated.
    passes: over the examples in one epoch.
    batch: examples of one update.
    micro_batches: parts that a batch is computed in, one after the other; more of them need less memory.
    label_smoothing: probability that is spread over the other classes in what is learnt.
    optimiser: learning rate and its course.
    average: decay a step of the moving average of the weights, which is what is validated and kept; 0 keeps the
        weights themselves (Polyak & Juditsky 1992).
    checkpoint_steps: steps between two checkpoints, besides one after every epoch; 0 for none in between.
    report_steps: steps between two looks at the loss; it is not waited for in between.
    """

    epochs: int = 40
    passes: int = 1
    batch: int = 16
    micro_batches: int = 1
    label_smoothing: float = 0.1
    average: float = 0.98
    checkpoint_steps: int = 200
    report_steps: int = 20
    optimiser: OptimiserConfig = field(default_factory=OptimiserConfig)


def _ignore(step: int, figures: dict[str, float]) -> None:
    """The default of `Fit.watch`."""


@dataclass(frozen=True)
class Fit:
    """What a run needs besides a model.

    loss: as `Loss`.
    batches: epoch -> this process' share of the epoch's batches in order; equal for equal epochs.
    steps_per_epoch: how many batches that is.
    validate: model -> figures; `score` among them decides which model is best.
    report: called with the history's newest row after every epoch, in the first process.
    watch: called there with each step's number, from 1, and its figures, in order and some steps late.
    """

    loss: Loss
    batches: Callable[[int], Any]
    steps_per_epoch: int
    validate: Callable[[Any], dict[str, float]]
    report: Callable[[dict[str, float]], None]
    watch: Callable[[int, dict[str, float]], None] = _ignore


@pytree_dataclass
class _State:
    """What a checkpoint holds.

    weights: model, optimiser's moments, moving average.
    best: the average with the highest validation score so far, which is `score`.
    step: updates done in all.
    figures: loss and gradient norm of the steps of an epoch that is not over; 0 for those to come.
    """

    weights: tuple[Any, Any, Any]
    best: Any
    score: np.ndarray
    step: np.ndarray
    figures: Float32[np.ndarray, "step figure"]


def fit(model: _Model, task: Fit, config: TrainingConfig, *, seed: int, directory: Path) -> _Model:
    """Train on every device there is and return the model with the best validation score.

    Checkpoints and `history.jsonl` in `directory` let a killed run go on with the same numbers as an uninterrupted one.
    Where several processes train together, the first one alone reads and writes them.

    Raises:
        UserError: an epoch has no batch, a batch cannot be cut as asked, or the loss is not finite; the last good
            checkpoint stays.
    """
    if task.steps_per_epoch < 1:
        raise UserError(
            "out-of-range",
            f"training.batch={config.batch} is larger than the training set",
            "lower it or make more clips",
        )
    if config.batch % config.micro_batches:
        raise UserError(
            "mismatch",
            f"training.micro_batches={config.micro_batches} does not divide training.batch={config.batch} evenly",
            "choose a divisor of it",
        )
    devices = devices_for(config.batch // config.micro_batches)
    optimiser = optimiser_of(config.optimiser, config.epochs * task.steps_per_epoch)
    update = devices.compile(_update_step(task.loss, optimiser, config))
    start = (model, optimiser.init(model), model)  # pyrefly: ignore
    nothing = np.zeros((task.steps_per_epoch, 2), np.float32)
    state = _resumed(_State(start, model, np.array(-np.inf, np.float32), np.array(0, np.int32), nothing), directory)
    state = replace(state, weights=devices.copy(state.weights))
    for epoch in range(int(state.step) // task.steps_per_epoch, config.epochs):
        state = _run_epoch(state, epoch, partial(update, np.uint32(seed % 2**32)), devices, task, config, directory)
        average = devices.own_copy(state.weights[2])
        row = {
            "epoch": epoch + 1,
            "loss": float(np.mean(state.figures[:, 0], dtype=np.float64)),
            **task.validate(average),
        }
        if np.float32(row["score"]) > state.score:
            state = replace(state, best=average, score=np.array(row["score"], np.float32))
        state = replace(state, figures=nothing)
        if is_first_process():
            # The row first: the checkpoint says how many rows hold, so one that is written twice is dropped.
            with (directory / "history.jsonl").open("a") as file:
                file.write(json.dumps(row) + "\n")
            _save(state, devices, directory)
            task.report(row)
    return state.best


def _run_epoch(
    state: _State, epoch: int, update: Any, devices: Devices, task: Fit, config: TrainingConfig, directory: Path
) -> _State:
    """The steps of an epoch that are still to be done."""
    weights, first = state.weights, epoch * task.steps_per_epoch
    figures = _Figures(state.figures, int(state.step), first, task.watch, directory)
    for step, batch in enumerate(_from(task.batches(epoch), int(state.step) - first), start=int(state.step)):
        weights, figure = update(weights, devices.divide(batch), np.int32(step))
        figures.add(devices.own_copy(figure))
        done = step + 1
        if config.checkpoint_steps and done % config.checkpoint_steps == 0 and done < first + task.steps_per_epoch:
            figures.fetch()
            if is_first_process():
                now = replace(state, weights=weights, step=np.array(done, np.int32), figures=figures.known)
                _save(now, devices, directory)
        elif done - int(state.step) in (1, 10) or done % config.report_steps == 0:
            figures.fetch(late=done - int(state.step) > 10)
    figures.fetch()
    return replace(state, weights=weights, step=np.array(first + task.steps_per_epoch, np.int32), figures=figures.known)


def _from(batches: Any, first: int) -> Iterator[Any]:
    return islice(iter(batches), first, None)


class _Figures:
    """Losses and gradient norms of an epoch, fetched from the device some steps late so that it never waits."""

    def __init__(self, known: np.ndarray, step: int, first: int, watch: Callable[..., None], directory: Path):
        self.known, self._step, self._first = known.copy(), step, first
        self._watch, self._directory = watch, directory
        self._pending: list[jax.Array] = []

    def add(self, figure: jax.Array) -> None:
        self._pending.append(figure)

    def fetch(self, *, late: bool = False) -> None:
        """Wait for the steps so far; `late` leaves out the newest, with which the device is still busy.

        Raises:
            UserError: one of them is not finite.
        """
        ready = self._pending[: len(self._pending) - late]
        self._pending = self._pending[len(ready) :]
        for figure in ready:
            row = np.asarray(figure)
            self.known[self._step - self._first] = row
            self._step += 1
            if not np.isfinite(row).all():
                self._refuse()
            if is_first_process():
                self._watch(self._step, {"loss": float(row[0]), "gradient_norm": float(row[1])})

    def _refuse(self) -> None:
        kept = latest_step(self._directory / "checkpoints")
        where = "no checkpoint was kept" if kept is None else f"the checkpoint of step {kept} stays"
        epoch = self._first // len(self.known) + 1
        raise UserError(
            "unreadable",
            f"the loss or its gradient is not finite at step {self._step} (epoch {epoch})",
            "lower training.optimiser.learning_rate or training.optimiser.clip_norm and start in a "
            f"new directory ({where})",
        )


def _update_step(loss: Loss, optimiser: optax.GradientTransformation, config: TrainingConfig) -> Callable[..., Any]:
    """One step of any run; its seed is an argument, so that runs with other seeds need not compile it again."""

    def update(seed: Any, weights: Any, batch: Any, step: Any) -> tuple[Any, Float32[Array, "figure"]]:
        model, moments, average = weights
        keys = jax.random.split(jax.random.fold_in(jax.random.key(seed), step), config.batch)
        value, gradient = _mean_gradient(loss, model, batch, keys, config.micro_batches)
        change, moments = optimiser.update(gradient, moments, model)
        model = optax.apply_updates(model, change)
        # Short memory at first, so that the initial weights do not linger.
        share = 1 - jnp.minimum(config.average, step / (step + 10))
        average = jax.tree.map(lambda old, new: old + share * (new - old), average, model)
        return (model, moments, average), jnp.stack([value, optax.tree.norm(without_statistics(gradient))])

    return update


def _mean_gradient(loss: Loss, model: Any, batch: Any, keys: Any, parts: int) -> tuple[Any, Any]:
    """Loss and gradient of a batch, computed in `parts` equal parts one after the other."""
    if parts == 1:
        return jax.value_and_grad(loss)(model, batch, keys)
    # Part p takes the examples p, p + parts, …: each device then finds its own examples in every part.
    cut = jax.tree.map(lambda leaf: leaf.reshape(-1, parts, *leaf.shape[1:]).swapaxes(0, 1), (batch, keys))

    def add(total: Any, part: Any) -> tuple[Any, None]:
        return jax.tree.map(jnp.add, total, jax.value_and_grad(loss)(model, *part)), None

    shapes = jax.eval_shape(jax.value_and_grad(loss), model, *jax.tree.map(lambda leaf: leaf[0], cut))
    zero = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
    total, _ = jax.lax.scan(add, zero, cut)
    return jax.tree.map(lambda leaf: leaf / parts, total)


def _save(state: _State, devices: Devices, directory: Path) -> None:
    whole = replace(state, weights=devices.own_copy(state.weights))
    save_state(directory / "checkpoints", int(state.step), whole)


def _resumed(start: _State, directory: Path) -> _State:
    """The newest checkpoint of the first process' directory, or `start`; later rows of the history are dropped."""
    done = latest_step(directory / "checkpoints") if is_first_process() else None
    found = int(from_first_process(np.array(-1 if done is None else done, np.int32)))
    if found < 0:
        if is_first_process():
            directory.mkdir(parents=True, exist_ok=True)
            _trim(directory / "history.jsonl", 0)
        return start
    if is_first_process():
        start = restore_state(directory / "checkpoints", found, start)
        _trim(directory / "history.jsonl", found // len(start.figures))
    return from_first_process(start)


def _trim(history: Path, epochs: int) -> None:
    """Drop rows written after the checkpoint that the run goes on from."""
    if history.exists():
        rows = history.read_text().splitlines()[:epochs]
        write_text(history, "".join(row + "\n" for row in rows))


def smoothed_cross_entropy(logits: jax.Array, labels: jax.Array, smoothing: float) -> jax.Array:
    """Cross entropy with 1-ε of the mass on the true class and ε/(K-1) on each other one (ε = `smoothing`)."""
    classes = logits.shape[-1]
    target = jax.nn.one_hot(labels, classes)
    target = target * (1 - smoothing) + (1 - target) * smoothing / (classes - 1)
    return -jnp.sum(target * jax.nn.log_softmax(logits), axis=-1)
