"""Schedule, weight decay, windows, augmentation and token draws against stored results of the released code."""

from __future__ import annotations

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.classify.mambasplat.config import published_config
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.released.tensor_names import published_tensors
from aerojax.core.types import Gaussians
from aerojax.data.windows import window_starts
from aerojax.gaussians.rotate import rotate
from aerojax.geometry.rotations import canonical_sign
from aerojax.training.optimisers import OptimiserConfig, decays, learning_rate
from aerojax.training.variation import VariationConfig, stretch_axes, vary_clip

TRAIN_STRIDE = 3


@pytest.fixture
def golden(shared):
    return np.load(shared / "golden/classifier/training.npz")


@pytest.mark.parametrize("steps_per_epoch", [1, 7])
def test_learning_rate_of_every_epoch(golden, x64, steps_per_epoch):
    epochs = len(golden["lr_per_epoch_50"])
    config = OptimiserConfig(learning_rate=1e-3, warmup=3 / epochs, final=1e-3, plateaus=epochs)
    rate = learning_rate(config, epochs * steps_per_epoch)
    found = jax.vmap(rate)(jnp.arange(epochs * steps_per_epoch)).reshape(epochs, steps_per_epoch)
    np.testing.assert_allclose(found, np.tile(golden["lr_per_epoch_50"][:, None], steps_per_epoch), rtol=1e-9)


def test_weight_decay_groups(shared):
    groups = json.loads((shared / "golden/classifier/weight_decay_groups_X.json").read_text())
    shapes = jax.eval_shape(lambda key: MambaSplat(published_config("X"), key=key), jax.random.key(0))
    marked = jax.tree.map(lambda leaf, flag: np.full(leaf.shape, flag), shapes, decays(shapes))
    ours = {name: bool(np.all(value)) for name, value in published_tensors(marked).items()}
    # What the released model also holds but never calls has no place in ours.
    used = {name: group for name, group in groups.items() if not name.startswith("bridge.")}
    assert ours == {name: group == "decay" for name, group in used.items()}
    assert sum(ours.values()) > 50 and not all(ours.values())


def test_window_counts_and_last_starts(golden):
    rows = golden["windows_nframes_T_dt_train_count_last"].tolist()
    assert len(rows) == 80
    for frames, length, dilation, train, count, last in rows:
        stride = TRAIN_STRIDE if train else length
        starts = window_starts(frames, length, stride, dilation=dilation, cover=False)
        if count:
            assert (len(starts), starts[-1]) == (count, last)
        else:  # the released loader drops a video that is too short; ours pads it
            assert starts == [0] and (length - 1) * dilation >= frames


def _numbered(frames, tokens):
    """A clip whose opacity column holds the frame's number and whose colour holds the token's."""
    clip = np.zeros((frames, tokens, 14), np.float32)
    clip[..., 3] = 1.0
    clip[..., 10] = np.arange(frames)[:, None]
    clip[..., 11] = np.arange(tokens)
    return jnp.asarray(clip)


def _draws(clip, config, keys):
    every = jnp.ones(clip.shape[0], bool)
    return jax.jit(jax.vmap(lambda key: vary_clip(clip, every, config, key=key)[0]))(keys)


def test_training_windows_start_where_the_released_ones_do(golden):
    rows = golden["windows_nframes_T_dt_train_count_last"].tolist()
    count, last = next(row[4:] for row in rows if row[:4] == [30, 16, 1, 1])
    config = VariationConfig(frames=16, tokens=2, stride=TRAIN_STRIDE, jitter=0.0, colour=0.0, drop=0.0)
    drawn = _draws(_numbered(30, 2), config, jax.random.split(jax.random.key(0), 200))
    starts = np.asarray(drawn[:, 0, 0, 10]).astype(int)
    assert sorted(set(starts.tolist())) == list(range(0, last + 1, TRAIN_STRIDE)) and len(set(starts.tolist())) == count
    np.testing.assert_array_equal(drawn[:, :, 0, 10], starts[:, None] + np.arange(16))


def test_every_frame_draws_its_own_half_of_the_tokens(golden):
    """Generators differ, so the numbers do; what they are does not: 512 of 1024, none twice, other ones each frame."""
    config = VariationConfig(frames=2, tokens=512, jitter=0.0, colour=0.0, drop=0.0)
    ours = np.asarray(_draws(_numbered(2, 1024), config, jax.random.split(jax.random.key(0), 1))[0, ..., 11])
    theirs = [golden[f"subsample_1024_to_512_{name}_frame"] for name in ("first", "second")]
    for draws in (ours, theirs):
        kept = [set(np.asarray(draw).astype(int).tolist()) for draw in draws]
        assert all(len(frame) == 512 and max(frame) < 1024 for frame in kept)
        assert 180 < len(kept[0] & kept[1]) < 330  # half of each by chance


@pytest.mark.parametrize("kind", ["none", "z", "so3"])
def test_stretch_then_rotation(golden, kind):
    columns = stretch_axes(jnp.asarray(golden["aug_in"]), golden["aug_scale"])
    if kind != "none":
        columns = rotate(Gaussians.from_columns(columns), jnp.asarray(golden[f"aug_R_{kind}"])).columns()
    expected = golden[f"aug_out_{kind}"]
    np.testing.assert_allclose(columns[..., :3], expected[..., :3], atol=2e-6)
    np.testing.assert_allclose(
        canonical_sign(columns[..., 3:7]), canonical_sign(jnp.asarray(expected[..., 3:7])), atol=2e-6
    )
    np.testing.assert_allclose(columns[..., 7:], expected[..., 7:], atol=2e-6)
