"""The drift diagnostic: its figures by hand, the 24 quaternions of an ellipsoid, and that it catches broken models."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip, representatives

from aerojax.classify.base import untrained
from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.data.windows import Windows
from aerojax.evaluate.drift import axis_relabellings, drift_figures, relabel_axes, verdict
from aerojax.evaluate.drift_passes import relabelling_drift, rotation_drift
from aerojax.geometry.covariances import covariance_from_axes
from aerojax.geometry.rotations import canonical_sign


def model_of(config):
    return untrained(config, tokens=32, frames=4, key=jax.random.key(0))


TINY = {"depth": 1, "mamba_layers": 1, "d_model": 16}


@pytest.fixture(scope="module")
def windows() -> Windows:
    """Two clips of four frames, the last frame of the second one absent."""
    columns = np.stack([np.asarray(random_clip(seed, time=4, tokens=32)) for seed in (0, 1)])
    present = np.ones((2, 4), bool)
    present[1, 3] = False
    return Windows(columns, present, np.array([0, 1]), np.array([0, 1]), ("a@0", "b@0"), ("a", "b"))


def test_figures_by_hand():
    original = np.array([[3.0, 1.0], [0.5, 0.4]])
    change = np.array([[[0.0, 1e-3], [0.0, 0.02]], [[0.0, 0.0], [-0.2, 0.0]]])
    turned = original + change
    figures = drift_figures(original, original + 1e-6, turned)
    assert figures["passes"] == 4 and figures["flips"] == 1 and figures["flip_rate"] == 0.25
    assert figures["largest_drift"] == pytest.approx(0.2) and figures["verdict"] == "LEAK"
    assert figures["noise_floor"] == pytest.approx(1e-6)
    assert figures["smallest_margin"] == pytest.approx(0.1)
    assert figures["safety"] == pytest.approx(0.25) and not figures["guaranteed"]
    assert figures["relative_drift"] == pytest.approx(0.2 / np.mean([1.25, 0.3]))
    assert figures["median_drift"] == pytest.approx(np.median([1e-3, 0.02, 0.0, 0.2]))


def test_an_unmoved_model_is_guaranteed():
    original = np.array([[3.0, 1.0], [0.5, 0.4]])
    figures = drift_figures(original, original, original[None])
    assert figures["guaranteed"] and figures["safety"] is None and figures["verdict"] == "HOLDS"


def test_verdicts_have_the_bands_of_the_thesis():
    assert [verdict(d) for d in (0.0, 1e-4, 1.1e-4, 1e-2, 1.1e-2)] == ["HOLDS"] * 2 + ["MARGINAL"] * 2 + ["LEAK"]
    assert verdict(float("nan")) == "LEAK"


def test_relabelling_keeps_every_ellipsoid():
    quaternions, orders = axis_relabellings()
    reference = np.array([quaternion for quaternion, _ in representatives()])
    # q and -q are the same: each of ours is one of theirs, and none is there twice.
    same = np.abs(quaternions @ reference.T) > 1 - 1e-5
    np.testing.assert_array_equal([same.sum(axis=0), same.sum(axis=1)], np.ones((2, 24)))
    clip = random_clip(0, time=2, tokens=24)
    clip = clip.at[..., 3:7].set(canonical_sign(clip[..., 3:7]))
    other = jax.jit(relabel_axes)(clip, jnp.asarray(quaternions, jnp.float32), jnp.asarray(orders))
    covariance = jax.jit(covariance_from_axes)
    before, after = (covariance(c[..., 3:7], c[..., 7:10]) for c in (clip, other))
    np.testing.assert_allclose(after, before, atol=1e-5 * float(jnp.abs(before).max()))
    np.testing.assert_array_equal(other[..., :3], clip[..., :3])
    # All but the identity change the numbers.
    assert int(jnp.sum(jnp.abs(other - clip)[..., 3:10].max(axis=(0, 2)) > 1e-3)) == 23


@pytest.mark.parametrize("lifting", ["covariance", "columns"])
def test_the_exact_model_holds_and_only_covariance_hides_the_quaternion(windows, lifting):
    model = model_of(MambaSplatConfig(lifting=lifting, **TINY))
    turned = rotation_drift(model, windows, 3, seed=0)
    assert turned["passes"] == 6 and turned["largest_drift"] <= 1e-5 and turned["flips"] == 0
    assert turned["noise_floor"] <= 1e-5
    other = relabelling_drift(model, windows, seed=0)
    assert other["passes"] == 47 * 2
    assert other["largest_drift"] <= 1e-5 if lifting == "covariance" else other["largest_drift"] > 1e-3


def test_double_precision_tells_a_leak_from_rounding(windows):
    exact = model_of(MambaSplatConfig(**TINY))
    assert rotation_drift(exact, windows, 2, seed=0, double=True)["largest_drift"] <= 1e-12
    # The published bias is a leak: double precision does not mend it.
    leaking = model_of(published_config("C", bias_epsilon=1e-2, **TINY))
    figures = rotation_drift(leaking, windows, 2, seed=0, double=True)
    assert figures["largest_drift"] > 1e-6 and figures["noise_floor"] <= 1e-12
