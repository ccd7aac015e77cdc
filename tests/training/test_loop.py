"""Training: the same numbers after a kill, honest ends, fair batches, variation that commutes with rotation."""

from __future__ import annotations

import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.evaluate.labels import confusion_matrix, label_figures
from aerojax.gaussians.rotate import covariance, rotate
from aerojax.geometry.rotations import haar_rotation
from aerojax.training.checkpoint import latest_step, restore_state, save_state
from aerojax.training.loop import Fit, TrainingConfig, fit, smoothed_cross_entropy
from aerojax.training.optimisers import OptimiserConfig, adamw, decays
from aerojax.training.variation import VariationConfig, epoch_order, vary_clip

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


def test_a_killed_run_ends_with_the_same_bits(tmp_path):
    whole, rows = task()
    uninterrupted = fit(start(), whole, CONFIG, seed=3, directory=tmp_path / "whole")
    assert rows[-1]["error"] < 0.8 * rows[0]["error"]
    with pytest.raises(Killed):
        fit(start(), task(die_after=2)[0], CONFIG, seed=3, directory=tmp_path / "killed")
    assert latest_step(tmp_path / "killed/checkpoints") == 10  # steps: two epochs of five
    # A row that was written after the checkpoint, as by a kill between the two, is written anew.
    with (tmp_path / "killed/history.jsonl").open("a") as file:
        file.write('{"epoch": 3, "loss": 0.0}\n')
    resumed = fit(start(), task()[0], CONFIG, seed=3, directory=tmp_path / "killed")
    assert same(resumed, uninterrupted)
    histories = [(tmp_path / name / "history.jsonl").read_text() for name in ("whole", "killed")]
    assert histories[0] == histories[1]
    assert [json.loads(line)["epoch"] for line in histories[0].splitlines()] == [1, 2, 3, 4]


def test_another_seed_gives_other_weights(tmp_path):
    one = fit(start(), task()[0], CONFIG, seed=3, directory=tmp_path / "a")
    assert not same(one, fit(start(), task()[0], CONFIG, seed=4, directory=tmp_path / "b"))


def test_a_finished_run_is_returned_as_it_is(tmp_path):
    one = fit(start(), task()[0], CONFIG, seed=3, directory=tmp_path)
    idle, rows = task()
    assert same(one, fit(start(), idle, CONFIG, seed=3, directory=tmp_path)) and rows == []


def test_the_best_model_is_returned(tmp_path):
    scores, judged, (plain, _) = iter([0.1, 0.9, 0.3, 0.2]), [], task()

    def validate(model):
        judged.append(model)
        return {"score": next(scores)}

    best = fit(start(), replace(plain, validate=validate), CONFIG, seed=3, directory=tmp_path)
    assert same(best, judged[1]) and not same(best, judged[3])


EVERY_THIRD = replace(CONFIG, checkpoint_steps=3)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """Final model, steps with their figures, and the history of a run that nobody killed."""
    folder = tmp_path_factory.mktemp("whole")
    whole, steps = watched(task()[0])
    model = fit(start(), whole, EVERY_THIRD, seed=3, directory=folder)
    return model, steps, (folder / "history.jsonl").read_text()


@pytest.mark.parametrize("step", [1, 4, 5, 6, 12, 20])
def test_a_run_killed_before_any_step_ends_with_the_same_bits(tmp_path, step, uninterrupted):
    """Checkpoints after every third step and every fifth, an epoch's last; kills before, at and after both kinds."""
    model, steps, history = uninterrupted
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


def test_less_than_a_batch_is_refused_and_one_step_is_a_run(tmp_path):
    with pytest.raises(UserError, match=r"training\.batch=8 is larger than the training set"):
        fit(start(), replace(task()[0], steps_per_epoch=0), CONFIG, seed=3, directory=tmp_path)
    optimiser = adamw(CONFIG.optimiser, steps=1)
    change, _ = optimiser.update(
        {"a": jnp.ones((2, 2))}, optimiser.init({"a": jnp.ones((2, 2))}), {"a": jnp.ones((2, 2))}
    )
    assert np.isfinite(change["a"]).all() and (np.asarray(change["a"]) < 0).all()


def test_checkpoints_keep_the_newest_and_refuse_another_model(tmp_path):
    assert latest_step(tmp_path / "none") is None
    for step in (1, 2, 10):
        save_state(tmp_path, step, {"a": np.arange(step, dtype=np.float32), "b": np.array(step)})
    assert [p.name for p in tmp_path.iterdir()] == ["step_00000010"]
    like = {"a": np.zeros(10, np.float32), "b": np.array(0)}
    restored = restore_state(tmp_path, 10, like)
    np.testing.assert_array_equal(restored["a"], np.arange(10))
    assert int(restored["b"]) == 10
    with pytest.raises(UserError, match="belongs to another model, optimiser or training set"):
        restore_state(tmp_path, 10, like | {"a": np.zeros(9, np.float32)})
    with pytest.raises(UserError, match="belongs to another model"):
        restore_state(tmp_path, 10, like | {"c": np.zeros(1)})
    (tmp_path / "step_00000011.orbax-checkpoint-tmp").mkdir()  # what a kill while writing leaves
    assert latest_step(tmp_path) == 10


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


def test_epochs_are_shuffled_the_same_way_each_time():
    first = list(epoch_order(11, 4, seed=0, epoch=5))
    assert [len(b) for b in first] == [4, 4] and len(set(np.concatenate(first))) == 8
    assert all(np.array_equal(a, b) for a, b in zip(first, epoch_order(11, 4, seed=0, epoch=5), strict=True))
    for changes in ({"seed": 1, "epoch": 5}, {"seed": 0, "epoch": 6}):
        assert not np.array_equal(np.concatenate(first), np.concatenate(list(epoch_order(11, 4, **changes))))
    assert list(epoch_order(3, 4, seed=0, epoch=0)) == []
    left_out = {
        i for e in range(8) for i in set(range(11)) - set(np.concatenate(list(epoch_order(11, 4, seed=0, epoch=e))))
    }
    assert len(left_out) > 3  # not always the same tail


def a_clip(time=6, tokens=20, seed=0):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(time, tokens, 14)).astype(np.float32)
    columns[..., 3:7] /= np.linalg.norm(columns[..., 3:7], axis=-1, keepdims=True)
    columns[..., 7:10] = np.exp(0.3 * columns[..., 7:10])
    return jnp.asarray(columns)


EVERY = jnp.ones(6, bool)


def test_variation_commutes_with_rotation():
    """Jitter is isotropic noise in the world's axes, so it is off where equality is asked for."""
    config = VariationConfig(frames=4, tokens=12, jitter=0.0)
    turn, key, clip = haar_rotation(key=jax.random.key(8)), jax.random.key(1), a_clip()
    turned_first, seen_first = vary_clip(rotate(Gaussians.from_columns(clip), turn).columns(), EVERY, config, key=key)
    varied, seen = vary_clip(clip, EVERY, config, key=key)
    turned_after = rotate(Gaussians.from_columns(varied), turn)
    np.testing.assert_array_equal(seen, seen_first)
    np.testing.assert_allclose(turned_first[..., :3], turned_after.mean, atol=1e-5)
    ours = covariance(Gaussians.from_columns(turned_first))
    np.testing.assert_allclose(ours, covariance(turned_after), atol=1e-5)
    np.testing.assert_allclose(turned_first[..., 10:], varied[..., 10:], atol=1e-6)


def test_jitter_is_isotropic_and_follows_the_size():
    config = VariationConfig(frames=6, tokens=200, jitter=0.1, colour=0.0, drop=0.0)
    clip = a_clip(tokens=200)
    clip = clip.at[..., 10].set(jnp.arange(200.0))
    offsets = []
    for scale in (1.0, 10.0):
        large = clip.at[..., :3].multiply(scale)
        varied, _ = vary_clip(large, EVERY, config, key=jax.random.key(0))
        source = np.asarray(varied[..., 10]).astype(int)
        time = np.arange(6)[:, None]
        offsets.append(np.asarray(varied[..., :3]) - np.asarray(large)[time, source, :3])
    spread = offsets[0].reshape(-1, 3).std(axis=0)
    np.testing.assert_allclose(spread, 0.1 * np.sqrt(3), rtol=0.12)  # radius of a unit normal cloud is √3
    np.testing.assert_allclose(offsets[1], 10 * offsets[0], atol=1e-4)


def test_windows_stay_inside_a_short_clip():
    config, present = VariationConfig(frames=4, tokens=8), jnp.arange(6) < 3
    for seed in range(5):
        columns, seen = vary_clip(a_clip(), present, config, key=jax.random.key(seed))
        assert columns.shape == (4, 8, 14) and seen.shape == (4, 8)
        np.testing.assert_array_equal(np.asarray(seen).any(axis=1), [True, True, True, False])
        assert np.asarray(seen)[0].sum() >= 8 * (1 - config.drop) - 1


def test_nothing_varied_is_a_choice_of_tokens():
    config = VariationConfig(frames=6, tokens=20, jitter=0.0, colour=0.0, drop=0.0)
    columns, seen = vary_clip(a_clip(), EVERY, config, key=jax.random.key(0))
    assert seen.all()
    for ours, theirs in zip(np.asarray(columns), np.asarray(a_clip()), strict=True):
        np.testing.assert_allclose(ours[np.argsort(ours[:, 0])], theirs[np.argsort(theirs[:, 0])], atol=1e-6)


def test_weight_decay_spares_vectors_and_state_matrices():
    leaf = jnp.zeros
    parameters = {
        "head": {"weight": leaf((4, 3)), "bias": leaf(4)},
        "blocks": {"weight": leaf((2, 4, 3)), "gain": leaf((2, 4))},
        "temporal": {"layers": {"A_log": leaf((2, 8, 16)), "D": leaf((2, 8)), "in": leaf((2, 8, 8))}},
    }
    assert decays(parameters) == {
        "head": {"weight": True, "bias": False},
        "blocks": {"weight": True, "gain": False},
        "temporal": {"layers": {"A_log": False, "D": False, "in": True}},
    }


def test_decay_moves_only_what_decays():
    parameters, gradient = (
        {"weight": jnp.ones((3, 2)), "bias": jnp.ones(3)},
        {"weight": jnp.ones((3, 2)), "bias": -jnp.ones(3)},
    )
    changes = []
    for decay in (0.0, 0.5):
        optimiser = adamw(replace(CONFIG.optimiser, weight_decay=decay), steps=10)
        changes.append(optimiser.update(gradient, optimiser.init(parameters), parameters)[0])
    rate = 0.01 * CONFIG.optimiser.learning_rate  # the first step of the warm-up
    np.testing.assert_allclose(changes[1]["weight"] - changes[0]["weight"], -0.5 * rate, rtol=1e-3)
    np.testing.assert_array_equal(changes[1]["bias"], changes[0]["bias"])


def test_label_figures_by_hand():
    log_probabilities = np.log(np.array([[0.7, 0.1, 0.1, 0.1], [0.4, 0.3, 0.2, 0.1], [0.1, 0.1, 0.7, 0.1]]))
    figures = label_figures(log_probabilities, np.array([0, 1, 2]))
    assert figures["accuracy"] == pytest.approx(2 / 3)
    assert figures["nll"] == pytest.approx(-np.log([0.7, 0.3, 0.7]).mean())
    assert figures["recall"] == [1.0, 0.0, 1.0, None]
    # F1: bird 2·1/(1+2), drone 0, airplane 1; the helicopter has no example.
    assert figures["macro_f1"] == pytest.approx((2 / 3 + 0 + 1) / 3)
    assert figures["confusion"] == [[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0]]
    assert json.loads(json.dumps(figures)) == figures
    np.testing.assert_array_equal(confusion_matrix(np.array([1, 1]), np.array([0, 0]), 2), [[0, 2], [0, 0]])
