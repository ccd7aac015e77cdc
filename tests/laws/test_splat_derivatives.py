"""The splatter's gradients against central finite differences in double precision."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import BACKGROUND, QUICK, make_camera, make_gaussians

from aerojax.gaussians.render import render
from aerojax.geometry.cameras import points_in_camera

CASES = {
    "plain": ("inria", False, {"spread": 0.3}),
    "clamped_alpha_and_early_stop": ("inria", False, {"sigma": (0.15, 0.4), "opacity": (0.98, 1.0)}),
    "clamped_jacobian": ("inria", False, {"spread": 1.2, "sigma": (0.2, 0.6)}),
    "gsplat_antialias_small": ("gsplat", True, {"sigma": (0.005, 0.05)}),
    "gsplat_clamped": ("gsplat", False, {"spread": 1.2, "sigma": (0.2, 0.6), "opacity": (0.5, 1.0)}),
}


STEP = 1e-6


def direction_of(leaf, rng) -> np.ndarray:
    """A random direction in one input; constant entries of camera matrices are not inputs."""
    direction = rng.normal(size=leaf.shape)
    if leaf.shape == (4, 4):
        direction[3] = 0
    if leaf.shape == (3, 3):
        direction[[0, 1, 2, 2, 2], [1, 0, 0, 1, 2]] = 0
    return direction


@pytest.mark.parametrize("case", CASES)
def test_gradients_are_finite_differences(x64, case):
    """Central differences along a random direction of every input, camera and background included.

    A pixel where some alpha crosses 1/255 inside the step jumps; those few are found by their second difference and
    left out of the loss.
    """
    rules, antialias, ranges = CASES[case]
    rng = np.random.default_rng(list(CASES).index(case))
    arguments = (make_gaussians(20 + list(CASES).index(case), count=40, **ranges), make_camera(), jnp.array(BACKGROUND))

    def images(gaussians, camera, background):
        image = render(gaussians, camera, background=background, rules=rules, antialias=antialias)
        return jnp.concatenate([image.colour, image.depth[..., None], image.alpha[..., None]], axis=-1)

    draw = jax.jit(images, compiler_options=QUICK)
    leaves, structure = jax.tree.flatten(arguments)
    centre = draw(*arguments)
    directions = [direction_of(leaf, rng) for leaf in leaves]
    moved = []
    for i, direction in enumerate(directions):
        either = [leaves[i] + sign * STEP * direction for sign in (1, -1)]
        moved.append([draw(*structure.unflatten([*leaves[:i], leaf, *leaves[i + 1 :]])) for leaf in either])
    smooth = np.all([np.abs(up - 2 * centre + down).max(-1) < 1e-6 for up, down in moved], axis=0)
    assert smooth.mean() > 0.95
    weights = rng.normal(size=centre.shape) * smooth[..., None]

    slopes = jax.jit(jax.grad(lambda *a: jnp.sum(weights * images(*a)), argnums=(0, 1, 2)), compiler_options=QUICK)
    for (up, down), slope, direction in zip(moved, jax.tree.leaves(slopes(*arguments)), directions, strict=True):
        expected = jnp.sum(weights * (up - down)) / (2 * STEP)
        scale = float(jnp.linalg.norm(slope) * np.linalg.norm(direction))
        np.testing.assert_allclose(jnp.sum(slope * direction), expected, rtol=1e-6, atol=1e-7 * scale + 1e-7)

    if case == "clamped_alpha_and_early_stop":
        assert float(centre[..., 4].max()) > 0.999 and float((1 - centre[..., 4]).min()) >= 1e-4
    elif "clamped" in case:
        in_camera = points_in_camera(arguments[0].mean, arguments[1])
        ratio = jnp.abs(in_camera[:, 0] / in_camera[:, 2])
        assert int(jnp.sum((ratio > 1.3 * 22 / 40) & (in_camera[:, 2] > 0.2))) >= 3
