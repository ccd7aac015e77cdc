"""The training loop: the same numbers after a kill, honest ends, parts of batches."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.training.checkpoint import latest_step
from aerojax.training.loop import Fit, TrainingConfig, fit, smoothed_cross_entropy
from aerojax.training.optimisers import OptimiserConfig
from aerojax.training.variation import epoch_order

CONFIG = TrainingConfig(epochs=4, batch=8, optimiser=OptimiserConfig(learning_rate=0.05))
INPUTS = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32)
TARGETS = INPUTS @ np.array([1.0, -2.0, 0.5], np.float32)


class Killed(Exception):
    """What a test raises where a process would die."""


def start():
    return {"weight": jnp.zeros((3, 1)), "bias": jnp.zeros(1)}


def loss(model, batch, keys):
    x, y = batch
    noise = 0.01 * jax.vmap(jax.random.normal)(keys)  # the keys matter, as dropout's do
    return jnp.mean((x @ model["weight"][:, 0] + model["bias"][0] + noise - y) ** 2)


def task(*, die_after=None, die_before_step=None, spoil_step=None):
    rows = []

    def batches(epoch):
        for place, index in enumerate(epoch_order(len(INPUTS), CONFIG.batch, seed=1, epoch=epoch)):
            step = 5 * epoch + place + 1
            if step == die_before_step:
                raise Killed
            y = TARGETS[index]
            yield INPUTS[index], np.full_like(y, np.nan) if step == spoil_step else y

    def validate(model):
        error = float(loss(model, (INPUTS, TARGETS), jax.random.split(jax.random.key(9), len(INPUTS))))
        return {"error": error, "score": -error}

    def report(row):
        rows.append(row)
        if row["epoch"] == die_after:
            raise Killed

    return Fit(loss, batches, len(INPUTS) // CONFIG.batch, validate, report), rows


def watched(plain):
    """The task, and the steps and figures that it tells of."""
    seen = []
    return replace(plain, watch=lambda step, figures: seen.append((step, figures))), seen


def same(a, b):
    return all(np.array_equal(x, y) for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True))


EVERY_THIRD = replace(CONFIG, checkpoint_steps=3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Final model, steps with their figures, and directory of a run that nobody killed."""
    folder = tmp_path_factory.mktemp("whole")
    plain, steps = watched(task()[0])
    return fit(start(), plain, EVERY_THIRD, seed=3, directory=folder), steps, folder


def test_a_killed_run_ends_with_the_same_bits(tmp_path, whole):
    model, _, folder = whole
    with pytest.raises(Killed):
        fit(start(), task(die_after=2)[0], CONFIG, seed=3, directory=tmp_path)
    assert latest_step(tmp_path / "checkpoints") == 10  # steps: two epochs of five
    # A row that was written after the checkpoint, as by a kill between the two, is written anew.
    with (tmp_path / "history.jsonl").open("a") as file:
        file.write('{"epoch": 3, "loss": 0.0}\n')
    assert same(fit(start(), task()[0], CONFIG, seed=3, directory=tmp_path), model)
    histories = [(place / "history.jsonl").read_text() for place in (folder, tmp_path)]
    rows = [json.loads(line) for line in histories[0].splitlines()]
    assert histories[0] == histories[1] and [row["epoch"] for row in rows] == [1, 2, 3, 4]
    assert rows[-1]["error"] < 0.8 * rows[0]["error"]


def test_another_seed_gives_other_weights(tmp_path, whole):
    assert not same(fit(start(), task()[0], CONFIG, seed=4, directory=tmp_path), whole[0])


def test_a_finished_run_is_returned_as_it_is(tmp_path, whole):
    idle, rows = task()
    again = shutil.copytree(whole[2], tmp_path / "again")
    assert same(fit(start(), idle, CONFIG, seed=3, directory=again), whole[0]) and rows == []


def test_the_best_model_is_returned(tmp_path):
    scores, judged, (plain, _) = iter([0.1, 0.9, 0.3, 0.2]), [], task()

    def validate(model):
        judged.append(model)
        return {"score": next(scores)}

    best = fit(start(), replace(plain, validate=validate), CONFIG, seed=3, directory=tmp_path)
    assert same(best, judged[1]) and not same(best, judged[3])


@pytest.mark.parametrize("step", [1, 4, 6, 20])
def test_a_run_killed_before_any_step_ends_with_the_same_bits(tmp_path, step, whole):
    """Checkpoints after every third step and every fifth, an epoch's last; kills before, at and after both kinds."""
    model, steps, folder = whole
    history = (folder / "history.jsonl").read_text()
    with pytest.raises(Killed):
        fit(start(), task(die_before_step=step)[0], EVERY_THIRD, seed=3, directory=tmp_path)
    kept = latest_step(tmp_path / "checkpoints") or 0
    assert kept == max(n for n in range(step) if n % 3 == 0 or n % 5 == 0)
    rest, later = watched(task()[0])
    assert same(fit(start(), rest, EVERY_THIRD, seed=3, directory=tmp_path), model)
    assert (tmp_path / "history.jsonl").read_text() == history and len(history.splitlines()) == 4
    assert [number for number, _ in steps] == list(range(1, 21)) and later == steps[kept:]


def test_a_history_without_a_checkpoint_is_begun_anew(tmp_path):
    (tmp_path / "history.jsonl").write_text('{"epoch": 1, "loss": 0.0}\n{"epo')  # killed while writing the first row
    fit(start(), task()[0], CONFIG, seed=3, directory=tmp_path)
    rows = [json.loads(line) for line in (tmp_path / "history.jsonl").read_text().splitlines()]
    assert [row["epoch"] for row in rows] == [1, 2, 3, 4] and rows[0]["loss"] > 0


def test_parts_of_a_batch_give_its_mean_gradient(tmp_path):
    curves, models = [], []
    for parts in (1, 2, 8):
        whole, steps = watched(task()[0])
        config = replace(CONFIG, micro_batches=parts)
        models.append(fit(start(), whole, config, seed=3, directory=tmp_path / str(parts)))
        curves.append([list(figures.values()) for _, figures in steps])
    assert np.shape(curves[0]) == (20, 2)
    for curve, model in zip(curves[1:], models[1:], strict=True):
        np.testing.assert_allclose(curve, curves[0], rtol=2e-5)
        np.testing.assert_allclose(model["weight"], models[0]["weight"], rtol=2e-5)
    with pytest.raises(UserError, match=r"training\.micro_batches=3 does not divide training\.batch=8"):
        fit(start(), task()[0], replace(CONFIG, micro_batches=3), seed=3, directory=tmp_path / "odd")


@pytest.mark.parametrize(("spoiled", "kept"), [(11, 10), (14, 12), (15, 12), (1, None)])
def test_a_loss_that_is_no_number_ends_the_run_and_leaves_the_checkpoint(tmp_path, spoiled, kept):
    jax.config.update("jax_debug_nans", False)  # the loop's own check is what is tested
    stays = "no checkpoint was kept" if kept is None else f"the checkpoint of step {kept} stays"
    epoch = (spoiled - 1) // 5 + 1
    message = rf"not finite at step {spoiled} \(epoch {epoch}\); lower training\.optimiser\.learning_rate .*{stays}"
    config = replace(CONFIG, checkpoint_steps=4)
    with pytest.raises(UserError, match=message):
        fit(start(), task(spoil_step=spoiled)[0], config, seed=3, directory=tmp_path)
    assert latest_step(tmp_path / "checkpoints") == kept
    rows = (tmp_path / "history.jsonl").read_text().splitlines() if kept else []
    assert len(rows) == (spoiled - 1) // 5 and all(np.isfinite(json.loads(row)["loss"]) for row in rows)
    if kept:  # the weights that stay are good: the same run with good data goes on from them
        rest, steps = watched(task()[0])
        fit(start(), rest, config, seed=3, directory=tmp_path)
        assert steps[0][0] == kept + 1 and np.isfinite([figures["loss"] for _, figures in steps]).all()


def test_less_than_a_batch_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"training\.batch=8 is larger than the training set"):
        fit(start(), replace(task()[0], steps_per_epoch=0), CONFIG, seed=3, directory=tmp_path)


def test_smoothed_cross_entropy():
    logits, labels = jnp.array([[2.0, 0.0, -1.0, 0.5], [0.0, 0.0, 0.0, 0.0]]), jnp.array([0, 3])
    logp = np.asarray(jax.nn.log_softmax(logits))
    weights = np.array([[0.9, 0.1 / 3, 0.1 / 3, 0.1 / 3], [0.1 / 3, 0.1 / 3, 0.1 / 3, 0.9]])
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(smoothed_cross_entropy(logits, labels, 0.1), -(weights * logp).sum(axis=1), rtol=1e-6)
    np.testing.assert_allclose(smoothed_cross_entropy(logits, labels, 0.0), [-logp[0, 0], -logp[1, 3]], rtol=1e-6)
    # Rows of the target sum to one: adding a constant to the logits changes nothing, and the gradient sums to zero.
    gradient = jax.grad(lambda z: smoothed_cross_entropy(z, labels, 0.1).sum())(logits)
    np.testing.assert_allclose(gradient.sum(axis=1), 0.0, atol=1e-6)
