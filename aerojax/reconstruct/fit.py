"""Gaussians of one object by optimisation on its own views: slow, without training data, a ceiling for one pass.

Kerbl et al. 2023 without densification: a fog through the visual hull gives enough Gaussians in every place that the
masks allow. Every step draws all views over backdrops of a new random colour, so that neither a white part nor a hole
can pass for the other; this needs the share of the backdrop in every pixel (`aerojax.reconstruct.matte`).

The hull is the largest shape with these silhouettes: a view between the cameras shows it too fat. The shadow term asks
for the smallest: it is the mean opacity seen by cameras at random places, which have no image. For a convex body the
mean shadow is a quarter of its surface (Cauchy 1832), so the term favours the least surface that still fills the masks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Key

from aerojax.gaussians.render import render
from aerojax.geometry.cameras import look_at
from aerojax.geometry.rotations import normalise
from aerojax.reconstruct.photometric import backdrop_colour, photometric_loss
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
    mask_weight: of mean |alpha - mask|.
    shadow_weight: of the mean alpha of cameras at random places.
    shadow_views: how many of them a step draws.
    antialias: of the renderer; keep it for rendering the result.
    report_every: steps between reports.
    """

    steps: int = 300
    mean_rate: float = 2e-3
    quaternion_rate: float = 5e-3
    scale_rate: float = 1e-2
    opacity_rate: float = 0.1
    colour_rate: float = 1e-2
    dissimilarity: float = 0.2
    mask_weight: float = 0.5
    shadow_weight: float = 0.3
    shadow_views: int = 2
    antialias: bool = True
    report_every: int = 20


def fit_gaussians(
    start: Gaussians,
    views: View,
    *,
    config: GaussianFitConfig,
    key: Key[Array, ""],
    report: Report | None = None,
) -> Gaussians:
    """Optimise all attributes of Gaussians until they look like the views.

    Args:
        start: for instance `solid_gaussians`; opacities strictly between 0 and 1 are reached from any start.
        views: images, apparent opacities as masks, and cameras (leading axis `view`) in the Gaussians' frame with the
            object near its origin; at least 11 pixels a side.
        config: rates and steps.
        key: random backdrops and places.
        report: progress.

    Returns:
        Gaussians of the same number, unit quaternions.
    """
    radius = jnp.sqrt(jnp.mean(jnp.sum((start.mean - start.mean.mean(axis=0)) ** 2, axis=-1)))
    free = _free(start)
    moments = _optimiser(config).init(free)
    for first in range(0, config.steps, config.report_every):
        part = min(config.report_every, config.steps - first)
        keys = jax.random.split(jax.random.fold_in(key, first), part)
        free, moments, loss = _advance(free, moments, views, radius, keys, config)
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


def _own_light(views: View) -> Float[Array, "view height width 3"]:
    """What the object adds to each pixel: the image less the backdrop's share; nothing where there is no object."""
    backdrop = backdrop_colour(views.rgb, views.mask)[:, None, None, :]
    opacity = views.mask[..., None]
    return jnp.where(opacity > 1e-3, views.rgb - (1 - opacity) * backdrop, 0.0)


def _shadow_cameras(cameras: Camera, key: Key[Array, ""], count: int) -> Camera:
    """Cameras all around the origin, at the mean distance and with the mean focal length of `cameras`."""
    distance = jnp.mean(jnp.linalg.norm(cameras.world_from_cam[:, :3, 3], axis=-1))
    direction = normalise(jax.random.normal(key, (count, 3)))
    poses = jax.vmap(lambda centre: look_at(centre, jnp.zeros(3)))(direction * distance)
    K = jnp.broadcast_to(jnp.mean(cameras.K, axis=0), (count, 3, 3))
    return Camera(K, poses, cameras.width, cameras.height)


def _loss(
    free: dict[str, Array], views: View, own: Float[Array, "view height width 3"], key: Array, config: GaussianFitConfig
) -> Float[Array, ""]:
    """Thesis Eq. 3.9 over random backdrops, with the mask and shadow terms."""
    key_backdrop, key_shadow = jax.random.split(key)
    count = len(views.mask)
    backdrop = jax.random.uniform(key_backdrop, (count, 3))
    extra = _shadow_cameras(views.camera, key_shadow, config.shadow_views)
    cameras = jax.tree.map(lambda *x: jnp.concatenate(x), views.camera, extra)
    behind = jnp.concatenate([backdrop, jnp.zeros((config.shadow_views, 3))])
    drawn = render(_gaussians(free), cameras, background=behind, antialias=config.antialias)
    target = own + (1 - views.mask[..., None]) * backdrop[:, None, None, :]
    colours = photometric_loss(drawn.colour[:count], target, dissimilarity=config.dissimilarity)
    outline = jnp.mean(jnp.abs(drawn.alpha[:count] - views.mask))
    shadow = jnp.sum(drawn.alpha[count:]) / max(1, drawn.alpha[count:].size)
    return colours + config.mask_weight * outline + config.shadow_weight * shadow


@partial(jax.jit, static_argnames="config")
def _advance(
    free: dict[str, Array],
    moments: Any,
    views: View,
    radius: Float[Array, ""],
    keys: Key[Array, "step"],
    config: GaussianFitConfig,
) -> tuple[dict[str, Array], Any, Float[Array, ""]]:
    """One update a key in one compiled loop; the loss is the last one's."""
    optimiser = _optimiser(config)
    own = _own_light(views)

    def step(state: tuple[dict[str, Array], Any], key: Array) -> tuple[Any, Array]:
        free, moments = state
        value, slope = jax.value_and_grad(_loss)(free, views, own, key, config)
        update: tuple[Any, Any] = optimiser.update(slope, moments, free)
        change, moments = update
        # Centres move in units of the object's radius.
        change = {name: x * radius if name == "mean" else x for name, x in change.items()}
        return (optax.apply_updates(free, change), moments), value

    (free, moments), losses = jax.lax.scan(step, (free, moments), keys)
    return free, moments, losses[-1]


def draw_views(
    gaussians: Gaussians, camera: Camera, background: Float[Array, "*view 3"], *, antialias: bool
) -> Float[Array, "view height width 3"]:
    """Colour images of all cameras (leading axis `view`) in one launch."""
    return render(gaussians, camera, background=background, antialias=antialias).colour
