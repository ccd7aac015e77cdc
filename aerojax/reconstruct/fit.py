"""Gaussians of one object by optimisation on its own views: slow, without training data, a ceiling for one pass.

Kerbl et al. 2023 without densification: the visual hull gives enough Gaussians in the right places. Every step draws
all views over the colour of each view's backdrop and compares with the images, whose clutter away from the object is
replaced by that colour. Rim pixels, which mix object and backdrop, are then right as they are; a term on alpha where
the mask is certain tells a backdrop-coloured object from none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float

from aerojax.gaussians.render import render
from aerojax.reconstruct.photometric import backdrop_colour, certain_pixels, over_backdrop, photometric_loss
from aerojax.types import Camera, Gaussians, View

MOST_CERTAIN = 0.8
"""Opacity at which a fit starts at most."""

Report = Callable[[int, float], None]
"""Called with (steps done, loss) every few steps."""


@dataclass(frozen=True)
class GaussianFitConfig:
    """Adam on Gaussians.

    steps: updates; the rates fall to a tenth over them.
    mean_rate: of the centres, in object radii.
    quaternion_rate, scale_rate, opacity_rate, colour_rate: of quaternion, log scale, logit opacity and coefficients.
    dissimilarity: λ of thesis Eq. 3.9.
    mask_weight: of mean |alpha - mask| over the pixels where the mask is certain.
    antialias: of the renderer; keep it for rendering the result.
    report_every: steps between reports.
    """

    steps: int = 300
    mean_rate: float = 2e-3
    quaternion_rate: float = 5e-3
    scale_rate: float = 1e-2
    opacity_rate: float = 5e-2
    colour_rate: float = 1e-2
    dissimilarity: float = 0.2
    mask_weight: float = 0.5
    antialias: bool = True
    report_every: int = 20


def fit_gaussians(
    start: Gaussians,
    views: View,
    *,
    config: GaussianFitConfig,
    report: Report | None = None,
) -> Gaussians:
    """Optimise all attributes of Gaussians until they look like the views.

    Args:
        start: for instance the visual hull; opacities strictly between 0 and 1 are reached from any start.
        views: images, masks and cameras (leading axis `view`) in the Gaussians' frame; at least 11 pixels a side.
        config: rates and steps.
        report: progress.

    Returns:
        Gaussians of the same number, unit quaternions.
    """
    radius = jnp.sqrt(jnp.mean(jnp.sum((start.mean - start.mean.mean(axis=0)) ** 2, axis=-1)))
    free = _free(start)
    optimiser = _optimiser(config)
    moments = optimiser.init(free)
    for first in range(0, config.steps, config.report_every):
        part = min(config.report_every, config.steps - first)
        free, moments, loss = _advance(free, moments, views, radius, config, part)
        if report is not None:
            report(first + part, float(loss))
    return _gaussians(free)


def _free(gaussians: Gaussians) -> dict[str, Array]:
    """Unconstrained parameters: logarithm of the scale, logit of the opacity."""
    # Not too sure of anything at first: the logistic curve is flat near 1, and what is wrong there would stay.
    opacity = jnp.clip(gaussians.opacity, 1e-3, MOST_CERTAIN)
    return {
        "mean": gaussians.mean,
        "quaternion": gaussians.quaternion,
        "scale": jnp.log(jnp.maximum(gaussians.scale, 1e-9)),
        "opacity": jnp.log(opacity) - jnp.log1p(-opacity),
        "sh": gaussians.sh,
    }


def _gaussians(free: dict[str, Array]) -> Gaussians:
    q = free["quaternion"]
    return Gaussians(
        mean=free["mean"],
        quaternion=q / jnp.maximum(jnp.linalg.norm(q, axis=-1, keepdims=True), 1e-9),
        scale=jnp.exp(free["scale"]),
        opacity=jax.nn.sigmoid(free["opacity"]),
        sh=free["sh"],
    )


def _optimiser(config: GaussianFitConfig) -> optax.GradientTransformation:
    rates = {
        "mean": config.mean_rate,
        "quaternion": config.quaternion_rate,
        "scale": config.scale_rate,
        "opacity": config.opacity_rate,
        "sh": config.colour_rate,
    }

    def adam(rate: float) -> optax.GradientTransformation:
        return optax.adam(optax.exponential_decay(rate, config.steps, 0.1), eps=1e-15)

    return optax.partition({name: adam(rate) for name, rate in rates.items()}, {name: name for name in rates})


@partial(jax.jit, static_argnames=("config", "steps"))
def _advance(
    free: dict[str, Array],
    moments: Any,
    views: View,
    radius: Float[Array, ""],
    config: GaussianFitConfig,
    steps: int,
) -> tuple[dict[str, Array], Any, Float[Array, ""]]:
    """Several updates in one compiled loop; the loss is the last one's."""
    optimiser = _optimiser(config)

    backdrop = backdrop_colour(views.rgb, views.mask)
    target = over_backdrop(views.rgb, views.mask, backdrop)
    certain = certain_pixels(views.mask)

    def loss(free: dict[str, Array]) -> Array:
        drawn = render(_gaussians(free), views.camera, background=backdrop, antialias=config.antialias)
        outline = jnp.mean(jnp.where(certain, jnp.abs(drawn.alpha - views.mask), 0.0))
        colours = photometric_loss(drawn.colour, target, dissimilarity=config.dissimilarity)
        return colours + config.mask_weight * outline

    def step(state: tuple[dict[str, Array], Any], _: None) -> tuple[Any, Array]:
        free, moments = state
        value, slope = jax.value_and_grad(loss)(free)
        update: tuple[Any, Any] = optimiser.update(slope, moments, free)
        change, moments = update
        # Centres move in units of the object's radius.
        change = {name: x * radius if name == "mean" else x for name, x in change.items()}
        return (optax.apply_updates(free, change), moments), value

    (free, moments), losses = jax.lax.scan(step, (free, moments), None, length=steps)
    return free, moments, losses[-1]


def draw_views(
    gaussians: Gaussians, camera: Camera, background: Float[Array, "*view 3"], *, antialias: bool
) -> Float[Array, "view height width 3"]:
    """Colour images of all cameras (leading axis `view`) in one launch."""
    return render(gaussians, camera, background=background, antialias=antialias).colour
