"""The two rule sets against numbers worked out by hand."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import LOOKING_ALONG_Z, drawing, single

from kernels.splat.projection import RULES, Shape, project

LIMIT = {"inria": 1.3 * 160 / 60, "gsplat": 120 / 30 + 0.3 * 160 / 60}
"""Largest X/Z of the Jacobian at W = 160, fx = 30, cx = 40: 1.3 half fields of view, or the image's edge plus 0.3."""


def project_one(mean, scale, principal, rules: str, opacity: float = 0.8):
    """One axis-aligned Gaussian in a 160×160 image of focal length 30 whose camera is the world frame."""
    K = jnp.array([[30.0, 0, principal], [0, 30.0, 80.25], [0, 0, 1]])
    shape = Shape(160, 160, 0.2, rules, False)
    columns = (jnp.array([mean]), jnp.array([[1.0, 0, 0, 0]]), jnp.array([scale]), jnp.array([opacity]))
    compiled = jax.jit(project, static_argnames="shape")
    return compiled(*columns, K, jnp.eye(4), jnp.array([True]), shape=shape)


@pytest.mark.parametrize(("rules", "rectangle"), [("inria", [2, 2, 8, 8]), ("gsplat", [4, 2, 6, 8])])
def test_extent_in_tiles(rules, rectangle):
    """σ = (3, 12) px, o = 0.8, centre 80.25: a = 9.3, c = 144.3 px².

    inria: r = ⌈3√144.3⌉ = 37; (79.75 ∓ 37 [+15])/16 → 2, 8 on both axes.
    gsplat: √(2 ln 204) = 3.261σ; r = (⌈9.95⌉, ⌈39.2⌉) = (10, 40); (80.25 ∓ r)/16 → 4, 6 and 2, 8.
    """
    splats = project_one([0.0, 0, 1], [0.1, 0.4, 0.1], 80.25, rules)
    np.testing.assert_array_equal(splats.rectangle[0], rectangle)
    np.testing.assert_allclose(splats.conic[0], [1 / 9.3, 0, 1 / 144.3], rtol=1e-5)


@pytest.mark.parametrize("rules", RULES)
def test_jacobian_ratio_is_clamped(rules):
    """At X/Z = 6 the image variance along u is (30·0.5)²·(1 + limit²) + 0.3; the centre is not clamped."""
    splats = project_one([6.0, 0, 1], [0.5, 0.5, 0.5], 40.0, rules)
    np.testing.assert_allclose(splats.conic[0, 0], 1 / (225 * (1 + LIMIT[rules] ** 2) + 0.3), rtol=1e-5)
    np.testing.assert_allclose(splats.centre[0], [220.0, 80.25], rtol=1e-6)


@pytest.mark.parametrize(("opacity", "drawn"), [(0.0038, False), (0.0041, True)])
def test_invisible_gaussians_are_listed_nowhere_by_gsplat(opacity, drawn):
    """1/255 = 0.00392 decides."""
    splats = project_one([0.0, 0, 1], [0.1, 0.4, 0.1], 80.25, "gsplat", opacity)
    assert bool(jnp.any(splats.rectangle != 0)) == drawn


@pytest.mark.parametrize(("rules", "most"), [("inria", 0.99), ("gsplat", 0.999)])
def test_opacity_is_clamped(rules, most):
    gaussian = dataclasses.replace(single((0, 0, 1), 0.2), opacity=jnp.ones(1))
    draw = drawing(rules)
    image = draw(gaussian, LOOKING_ALONG_Z, background=jnp.zeros(3))
    np.testing.assert_allclose(image.alpha[10, 9], most, rtol=1e-6)


def test_stop_at_equality():
    """`T < t` with gsplat's t ends at exactly 1e-4, with inria's it does not; in both float types."""
    for dtype in (np.dtype("float32"), np.dtype("float64")):
        exact = dtype.type(1e-4)
        assert not exact < dtype.type(RULES["inria"].stop(dtype))
        assert exact < dtype.type(RULES["gsplat"].stop(dtype))
        assert not np.nextafter(exact, dtype.type(1)) < dtype.type(RULES["gsplat"].stop(dtype))
