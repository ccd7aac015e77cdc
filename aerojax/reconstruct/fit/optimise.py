"""Gaussians of one object by optimisation on its own views: slow, without training data, a ceiling for one pass.

Kerbl et al. 2023 with a constant number of Gaussians: it starts at the surface of the visual hull, and Gaussians that
no image needs move to where the images pull hardest. Every step draws a few views over backdrops of a new random
colour, so that neither a white part nor a hole can pass for the other; this needs the share of the backdrop in every
pixel (`aerojax.reconstruct.fit.matte`).

The hull is the largest shape with these silhouettes: a view between the cameras shows it too fat. The shadow term asks
for the smallest: it is the mean opacity seen by cameras at random places, which have no image. For a convex body the
mean shadow is a quarter of its surface (Cauchy 1832), so the term favours the least surface that still fills the masks.
It is strong at first, when what bulges must go, and weak at last, when it would only make surfaces thin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, Int, Key

from aerojax.core.types import Camera, Gaussians, View, pytree_dataclass
from aerojax.gaussians.render import render
from aerojax.geometry.cameras import look_at
from aerojax.geometry.rotations import normalise, rotation_from_quaternion
from aerojax.reconstruct.fit.photometric import backdrop_colour, photometric_loss

MOST_CERTAIN = 0.8
"""Opacity at which a fit starts at most."""
FAINT = 0.02
"""Opacity below which a Gaussian is of no use: five steps of an 8-bit image."""
SHORTER = 0.6
"""Length of a half over the whole's: two halves of 0.6 at ±0.5 have a standard deviation of 0.78 together."""

Report = Callable[[int, float], None]
"""Called with (steps done, loss) every few steps."""


@dataclass(frozen=True)
class GaussianFitConfig:
    """Adam on Gaussians.

    steps: updates; the rates fall to a tenth over them.
    views: how many of the views a step draws, at random; all if there are fewer.
    mean_rate: of the centres, in object radii.
    quaternion_rate, scale_rate, opacity_rate, colour_rate: of quaternion, log scale, logit opacity and coefficients.
    largest: standard deviation that no Gaussian outgrows, over the largest at the start.
    dissimilarity: λ of thesis Eq. 3.9.
    mask_weight: of mean |alpha - mask|.
    shadow_weight: of the mean alpha of cameras at random places, at the first step.
    shadow_decay: its factor over all steps.
    shadow_views: how many of them a step draws.
    moved: share of the Gaussians, the least useful ones, that move after every report but the first and the last ones.
    antialias: of the renderer; keep it for rendering the result.
    report_every: steps between reports.
    """

    steps: int = 240
    views: int = 2
    mean_rate: float = 4e-3
    quaternion_rate: float = 1e-2
    scale_rate: float = 2e-2
    opacity_rate: float = 0.1
    colour_rate: float = 2e-2
    largest: float = 1.0
    dissimilarity: float = 0.2
    mask_weight: float = 0.5
    shadow_weight: float = 0.4
    shadow_decay: float = 0.05
    shadow_views: int = 1
    moved: float = 0.12
    antialias: bool = True
    report_every: int = 60


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
        start: for instance `hull_gaussians`; opacities strictly between 0 and 1 are reached from any start.
        views: images, apparent opacities as masks, and cameras (leading axis `view`) in the Gaussians' frame with the
            object near its origin; at least 11 pixels a side.
        config: rates and steps.
        key: random backdrops and places.
        report: progress.

    Returns:
        Gaussians of the same number, unit quaternions.
    """
    radius = jnp.sqrt(jnp.mean(jnp.sum((start.mean - start.mean.mean(axis=0)) ** 2, axis=-1)))
    limits = _Limits(radius, jnp.log(config.largest * jnp.max(start.scale)))
    free = _free(start)
    state = _State(free, _optimiser(config).init(free), jnp.zeros(len(start.mean)))
    for first in range(0, config.steps, config.report_every):
        part = min(config.report_every, config.steps - first)
        keys = jax.random.split(jax.random.fold_in(key, first), part)
        state, loss = _advance(state, views, limits, keys, jnp.asarray(first), config)
        # What was moved last has yet to find its place: none in the first stretch, none in the last fifth.
        if first > 0 and first + part < 0.8 * config.steps:
            state = _move_idle(state, int(config.moved * len(start.mean)))
        if report is not None:
            report(first + part, float(loss))
    return _gaussians(state.free)


@pytree_dataclass
class _Limits:
    """The object's radius, metres, and the logarithm of the largest scale."""

    radius: Float[Array, ""]
    log_scale: Float[Array, ""]


@pytree_dataclass
class _State:
    """Parameters, Adam's moments, and how hard the images pulled at every centre since the last move."""

    free: dict[str, Array]
    moments: Any
    pull: Float[Array, "gaussian"]


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
    free: dict[str, Array],
    views: View,
    own: Float[Array, "view height width 3"],
    shadow_weight: Float[Array, ""],
    key: Array,
    config: GaussianFitConfig,
) -> Float[Array, ""]:
    """Thesis Eq. 3.9 over random backdrops in some of the views, with the mask and shadow terms."""
    key_backdrop, key_shadow, key_views = jax.random.split(key, 3)
    count = min(config.views, len(views.mask))
    chosen = jax.random.permutation(key_views, len(views.mask))[:count]
    extra = _shadow_cameras(views.camera, key_shadow, config.shadow_views)
    views, own = jax.tree.map(lambda x: x[chosen], (views, own))
    backdrop = jax.random.uniform(key_backdrop, (count, 3))
    cameras = jax.tree.map(lambda *x: jnp.concatenate(x), views.camera, extra)
    behind = jnp.concatenate([backdrop, jnp.zeros((config.shadow_views, 3))])
    drawn = render(_gaussians(free), cameras, background=behind, antialias=config.antialias)
    target = own + (1 - views.mask[..., None]) * backdrop[:, None, None, :]
    colours = photometric_loss(drawn.colour[:count], target, dissimilarity=config.dissimilarity)
    outline = jnp.mean(jnp.abs(drawn.alpha[:count] - views.mask))
    shadow = jnp.sum(drawn.alpha[count:]) / max(1, drawn.alpha[count:].size)
    return colours + config.mask_weight * outline + shadow_weight * shadow


@partial(jax.jit, static_argnames="config")
def _advance(
    state: _State,
    views: View,
    limits: _Limits,
    keys: Key[Array, "step"],
    first: Int[Array, ""],
    config: GaussianFitConfig,
) -> tuple[_State, Float[Array, ""]]:
    """One update a key in one compiled loop, and the mean loss; `first` steps are done."""
    optimiser = _optimiser(config)
    own = _own_light(views)

    def step(state: _State, x: tuple[Array, Array]) -> tuple[_State, Array]:
        key, done = x
        weight = config.shadow_weight * config.shadow_decay ** (done / config.steps)
        value, slope = jax.value_and_grad(_loss)(state.free, views, own, weight, key, config)
        update: tuple[Any, Any] = optimiser.update(slope, state.moments, state.free)
        change, moments = update
        # Centres move in units of the object's radius.
        change = {name: x * limits.radius if name == "mean" else x for name, x in change.items()}
        free: Any = optax.apply_updates(state.free, change)
        free = {name: jnp.minimum(x, limits.log_scale) if name == "scale" else x for name, x in free.items()}
        return _State(free, moments, state.pull + jnp.linalg.norm(slope["mean"], axis=-1)), value

    state, losses = jax.lax.scan(step, state, (keys, first + jnp.arange(len(keys))))
    return state, jnp.mean(losses)


@partial(jax.jit, static_argnames="count")
def _move_idle(state: _State, count: int) -> _State:
    """Halve the `count` Gaussians that the images pull at most; the other halves are those that did least.

    A fit that cannot show what a place needs pulls its Gaussians to and fro (Kerbl et al. 2023, §5.2). The halves lie
    half a standard deviation to both sides of the centre, along the longest axis, and are shorter along it.
    """
    free = state.free
    opacity = jax.nn.sigmoid(free["opacity"])
    order = jnp.argsort(jnp.where(opacity < FAINT, 0.0, state.pull))
    idle, busy = order[:count], order[len(order) - count :]
    halved = _gaussians({name: x[busy] for name, x in free.items()})
    longest = jax.nn.one_hot(jnp.argmax(halved.scale, axis=-1), 3)
    axes = rotation_from_quaternion(halved.quaternion)
    aside = 0.5 * jnp.einsum("nij,nj->ni", axes, longest * halved.scale)
    new = {name: x.at[idle].set(x[busy]) for name, x in free.items()}
    new["mean"] = new["mean"].at[busy].add(aside).at[idle].add(-aside)
    shorter = longest * np.log(SHORTER)
    new["scale"] = new["scale"].at[busy].add(shorter).at[idle].add(shorter)
    # What a Gaussian remembers of its old place says nothing of the new one.
    moments = jax.tree.map(lambda x: x.at[idle].set(0) if jnp.shape(x)[:1] == order.shape else x, state.moments)
    return _State(new, moments, jnp.zeros_like(state.pull))


def draw_views(
    gaussians: Gaussians, camera: Camera, background: Float[Array, "*view 3"], *, antialias: bool
) -> Float[Array, "view height width 3"]:
    """Colour images of all cameras (leading axis `view`) in one launch."""
    return render(gaussians, camera, background=background, antialias=antialias).colour
