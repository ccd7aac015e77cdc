"""Operators, time, votes and files of the classifier."""

from __future__ import annotations

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import logits_of, random_clip

from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.mambasplat.cost import published_operations
from aerojax.classify.mambasplat.lifting import normalise_published
from aerojax.classify.mambasplat.mamba import MambaMixer, MambaStack, MambaState, sinusoids
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.mambasplat.vector_neurons import clip_to_half_space, divide_by_rms, mix_channels
from aerojax.classify.voting import classify_next, classify_video, video_vote, window_starts
from aerojax.classify.weights import CONFIG_KEY, load_metadata, load_weights, save_weights
from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.pipeline.offline import clip_probabilities, probabilities_so_far

SMALL = MambaSplatConfig(depth=1, mamba_layers=2, d_model=32, token_features=8, scale_normalisation="frame")


def _plain_clip(q, k, slope):
    inner = jnp.sum(q * k, axis=-2, keepdims=True)
    return q - (1 - slope) * jnp.minimum(inner, 0.0) * k / jnp.sum(k * k, axis=-2, keepdims=True)


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_rectifier_projects_and_its_gradient_is_that_of_the_formula(x64, slope):
    q, k, g = jax.random.normal(jax.random.key(0), (3, 5, 4, 6), jnp.float64)
    y, pull = jax.vjp(lambda q, k: clip_to_half_space(q, k, slope), q, k)
    expected, expected_pull = jax.vjp(lambda q, k: _plain_clip(q, k, slope), q, k)
    np.testing.assert_allclose(y, expected, atol=1e-13)
    for ours, theirs in zip(pull(g), expected_pull(g), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    inner, before = jnp.sum(y * k, axis=-2), jnp.sum(q * k, axis=-2)
    np.testing.assert_allclose(inner, jnp.where(before < 0, slope * before, before), atol=1e-12)


def test_norm_has_the_gradient_of_its_formula(x64):
    x, g = jax.random.normal(jax.random.key(0), (2, 5, 4, 6), jnp.float64)
    x, gain = x.at[0].set(0.0), jnp.linspace(0.5, 2.0, 6)
    ours, pull = jax.vjp(divide_by_rms, x, gain)
    expected, expected_pull = jax.vjp(
        lambda x, gain: x * gain / jnp.sqrt(jnp.sum(x * x, axis=(-2, -1), keepdims=True) / 6 + 1e-6), x, gain
    )
    np.testing.assert_allclose(ours, expected, atol=1e-13)
    for a, b in zip(pull(g), expected_pull(g), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


@pytest.mark.parametrize(("inputs", "outputs"), [(3, 7), (7, 3)])
def test_mixing_has_the_gradient_of_a_matrix_product(inputs, outputs):
    x, w = jax.random.normal(jax.random.key(0), (2, 5, inputs)), jax.random.normal(jax.random.key(1), (outputs, inputs))
    ours = jax.grad(lambda x, w: jnp.sum(jnp.sin(mix_channels(x, w))), argnums=(0, 1))(x, w)
    expected = jax.grad(lambda x, w: jnp.sum(jnp.sin(x @ w.T)), argnums=(0, 1))(x, w)
    for a, b in zip(ours, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-5, atol=2e-5)


def test_mixer_equals_a_loop_over_the_recurrence():
    config = MambaSplatConfig(d_model=16, d_state=4)
    mixer = MambaMixer(config, key=jax.random.key(0))
    u = jax.random.normal(jax.random.key(1), (9, 16))
    state = MambaState(jnp.zeros((3, 32)), jnp.zeros((32, 4)))
    rows = []
    for frame in u:
        row, state = mixer.step(frame, state)
        rows.append(row)
    np.testing.assert_allclose(mixer(u), jnp.stack(rows), atol=1e-6)


def test_stack_streams_what_it_scans_and_is_causal():
    stack = MambaStack(SMALL, key=jax.random.key(0))
    hidden = jax.random.normal(jax.random.key(1), (7, 32))
    scan, step = jax.jit(lambda hidden: stack(hidden)), jax.jit(stack.step)
    whole, state = scan(hidden), stack.initial_state()
    for t, frame in enumerate(hidden):
        row, state = step(frame, state)
        np.testing.assert_allclose(row, whole[t], atol=2e-6)
    np.testing.assert_allclose(scan(hidden.at[5:].add(1.0))[:5], whole[:5], atol=1e-6)


@pytest.mark.parametrize("changes", [{"readout": "last"}, {"temporal": "none"}])
def test_a_stream_gives_the_logits_of_the_clip(changes):
    model = MambaSplat(dataclasses.replace(SMALL, **changes), key=jax.random.key(0))
    clip = random_clip(0, time=5, tokens=16)
    mask = jnp.ones((5, 16), bool).at[2].set(False)
    step = jax.jit(classify_next)
    state = model.initial_state()
    for columns, valid in zip(clip, mask, strict=True):
        logits, state = step(model, state, columns, valid)
    np.testing.assert_allclose(logits, logits_of(model, clip[None], mask)[0], atol=2e-6)
    with pytest.raises(UserError, match="scale_normalisation"):
        clip_model = MambaSplat(dataclasses.replace(model.config, scale_normalisation="clip"), key=jax.random.key(0))
        classify_next(clip_model, state, clip[0], mask[0])


def test_dropout_needs_a_key_and_leaves_evaluation_alone():
    model = MambaSplat(dataclasses.replace(SMALL, dropout=0.5), key=jax.random.key(0))
    clip, mask = random_clip(1, time=3, tokens=8), jnp.ones((3, 8), bool)
    train = jax.jit(lambda model, key: model(clip, mask, key=key))
    first, second = (train(model, jax.random.key(k)) for k in (1, 2))
    assert jnp.abs(first - second).max() > 1e-3
    np.testing.assert_array_equal(first, train(model, jax.random.key(1)))
    still = MambaSplat(dataclasses.replace(SMALL, dropout=0.0, drop_path=0.0, head_dropout=0.0), key=jax.random.key(0))
    evaluated = logits_of(still, clip[None], mask)[0]
    np.testing.assert_allclose(train(still, jax.random.key(1)), evaluated, atol=1e-6)


def test_positions_are_interleaved_sines_and_cosines():
    table = sinusoids(4, 6)
    angle = 3 / 10000 ** (2 / 6)
    np.testing.assert_allclose(table[3, 2:4], [np.sin(angle), np.cos(angle)], atol=1e-6)
    np.testing.assert_array_equal(table[0], [0, 1, 0, 1, 0, 1])


def test_window_starts():
    assert window_starts(30, 24, 3) == [0, 3, 6]
    assert window_starts(30, 16, 16) == [0, 14]
    assert window_starts(30, 16, 16, cover=False) == [0]
    assert window_starts(5, 24, 3) == [0]
    assert window_starts(30, 4, 3, cover=False) == list(range(0, 27, 3))
    with pytest.raises(UserError, match="stride is 0"):
        window_starts(30, 4, 0)


def test_video_of_any_length_is_a_vote_over_its_clips():
    model = MambaSplat(SMALL, key=jax.random.key(0))
    video, mask = random_clip(2, time=7, tokens=8), jnp.ones((7, 8), bool)
    probabilities = classify_video(model, video, mask, length=4, stride=4)
    clips = logits_of(model, jnp.stack([video[s : s + 4] for s in (0, 3)]), jnp.ones((), bool))
    np.testing.assert_allclose(probabilities, jax.nn.softmax(clips).mean(axis=0), atol=1e-6)
    short = classify_video(model, video[:3], mask[:3], length=4, stride=4)
    np.testing.assert_allclose(
        short, jax.nn.softmax(logits_of(model, video[None, :3], jnp.ones((), bool)))[0], atol=1e-6
    )
    empty = video_vote(jnp.zeros((1, 4)), jnp.zeros(1, jnp.int32), 2)
    np.testing.assert_allclose(empty, [[0.25] * 4, [0] * 4])


def test_weights_round_trip_with_their_configuration(tmp_path):
    model = MambaSplat(SMALL, key=jax.random.key(0))
    path = tmp_path / "model.safetensors"
    save_weights(path, model, {"classes": "bird drone"})
    again = load_weights(path)
    assert again.config == SMALL and load_metadata(path) == {"classes": "bird drone"}
    for a, b in zip(jax.tree.leaves(model), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(a, b)
    assert [p.name for p in tmp_path.iterdir()] == ["model.safetensors"]


def test_weights_that_do_not_fit_are_refused(tmp_path):
    from safetensors.numpy import load_file, save_file

    path = tmp_path / "model.safetensors"
    with pytest.raises(UserError, match="does not exist"):
        load_weights(path)
    path.write_bytes(b"not a tensor")
    with pytest.raises(UserError, match="not a complete safetensors file"):
        load_weights(path)
    save_weights(path, MambaSplat(SMALL, key=jax.random.key(0)))
    tensors = load_file(path)
    save_file(tensors, path)
    with pytest.raises(UserError, match=CONFIG_KEY):
        load_weights(path)
    del tensors["head.out.bias"]
    tensors |= {"extra": np.zeros(1, np.float32), "head.hidden.bias": np.zeros(3, np.float32)}
    save_file(tensors, path, metadata={CONFIG_KEY: json.dumps(dataclasses.asdict(SMALL))})
    with pytest.raises(UserError) as error:
        load_weights(path)
    for part in ("missing tensor head.out.bias", "unknown tensor extra", "head.hidden.bias has shape (3,)"):
        assert part in str(error.value)


def test_configurations_that_contradict_themselves_are_refused():
    with pytest.raises(UserError, match="lifting is 'covariance'"):
        published_config(lifting="covariance")
    with pytest.raises(UserError, match="dropout is 1"):
        MambaSplatConfig(dropout=1.0)
    with pytest.raises(UserError, match="depth is 0"):
        MambaSplatConfig(depth=0)
    with pytest.raises(UserError, match="d_model is 33"):
        MambaSplatConfig(d_model=33)
    assert to_dataclass({"mode": "C_O", "depth": 2}, MambaSplatConfig) == MambaSplatConfig(mode="C_O", depth=2)


@pytest.mark.parametrize(
    ("mode", "frames", "tokens", "billions", "digits"),
    [
        ("X", 24, 1024, 103.544, 3),
        ("C", 24, 1024, 44.4205, 4),
        ("X", 16, 512, 19.51, 2),
        ("C", 16, 512, 8.39, 2),
        ("X", 4, 1024, 17.26, 2),
        ("X", 12, 1024, 51.77, 2),
        ("C_O", 24, 1024, 59.20, 2),
        ("C_SH", 24, 1024, 88.76, 2),
        ("C_S_R", 24, 1024, 44.43, 2),
    ],
)
def test_operations_are_those_of_the_thesis(mode, frames, tokens, billions, digits):
    assert round(published_operations(published_config(mode), frames, tokens) / 1e9, digits) == billions


def test_published_weights_are_read_as_their_authors_prepare_them():
    small = {"depth": 1, "mamba_layers": 1, "d_model": 32, "token_features": 8}
    model = MambaSplat(published_config("X", **small), key=jax.random.key(0))
    columns = random_clip(3, time=2, tokens=16)
    prepared = jax.vmap(normalise_published)(columns)
    expected = jax.nn.softmax(model(prepared, jnp.ones(columns.shape[:2], bool)))
    read = probabilities_so_far(model, columns, tokens=16)
    np.testing.assert_allclose(read[-1], expected, atol=1e-6)


def test_the_last_of_all_prefixes_is_the_clip():
    model = MambaSplat(SMALL, key=jax.random.key(0))
    columns, present = random_clip(4, time=4, tokens=24), jnp.array([True, True, False, True])
    whole = clip_probabilities(model, columns, present, tokens=8)
    np.testing.assert_allclose(whole, probabilities_so_far(model, columns, present, tokens=8)[-1], atol=1e-6)
    assert whole.sum() == pytest.approx(1, abs=1e-5)
