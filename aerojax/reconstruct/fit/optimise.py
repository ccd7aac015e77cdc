"""Gaussians of one object by optimisation on its own views: slow, without training data, a ceiling for one pass.

Kerbl et al. 2023 with a constant number of Gaussians: it starts at the surface of the visual hull, and Gaussians that
no image needs are relocated to where the positional gradients are largest (after Kheradmand et al. 2024, §4.2). Every
step renders a few views over backgrounds of a new random colour, so that neither a white part nor a hole can pass for
the other; this needs the matte of every view (`aerojax.reconstruct.fit.matte`).

The hull is the largest shape with these silhouettes: a view between the cameras shows it too fat. The alpha regulariser
asks for the smallest: it is the mean alpha in cameras at random places, which have no image. For a convex body the mean
projected area is a quarter of its surface (Cauchy 1832), so the term favours the least surface that still fills the
masks. It is strong at first, when what bulges must go, and weak at last, when it would only make surfaces thin.

Cameras on a short line see little of the depth: any thin sheet with the right outline explains their images, and the
alpha regulariser would choose one. It weighs less there, as the least observed direction has less information than
`WELL_OBSERVED` of the best one (`depth_observed`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, Int, Key

from aerojax.core.types import Camera, Gaussians, View, pytree_dataclass, static_field
from aerojax.gaussians.render import render
from aerojax.geometry.cameras import look_at
from aerojax.geometry.rotations import normalise, rotation_from_quaternion
from aerojax.reconstruct.fit.photometric import background_colour, photometric_loss

MAX_START_OPACITY = 0.8
"""Opacity at which a fit starts at most."""
DEAD_OPACITY = 0.02
"""Opacity below which a Gaussian is of no use: five steps of an 8-bit image."""
SPLIT_SCALE = 0.6
"""Length of a half over the whole's: two halves of 0.6 at ±0.5 have a standard deviation of 0.78 together."""

WELL_OBSERVED = 0.25
"""Information about a position along a direction, over that along the best one, from which on it counts as known: it
is what two cameras 60 degrees apart have of the depth, sin² 30°."""

Report = Callable[[int, float], None]
"""Called with (steps done, mean loss) every few steps."""


@pytree_dataclass
class GaussianFitConfig:
    """Adam on Gaussians. Weights and learning rates are data of a pytree, so that another one compiles nothing anew.

    steps: updates; the learning rates fall to a tenth over them.
    views: how many of the views a step renders, at random; all if there are fewer.
    mean_rate: learning rate of the centres, in object radii.
    quaternion_rate, scale_rate, opacity_rate, colour_rate: learning rates of quaternion, log scale, logit opacity and
        spherical-harmonics coefficients.
    max_scale: standard deviation that no Gaussian outgrows, over the largest at the start.
    dssim_weight: λ of thesis Eq. 3.9.
    mask_weight: of mean |alpha - mask|.
    alpha_weight: of the alpha regulariser, at the first step.
    alpha_decay: its factor over all steps.
    alpha_views: cameras at random places that a step renders for it.
    relocated: share of the Gaussians, the least useful ones, that is relocated after every report but the first and the
        last ones.
    antialias: of the renderer; keep it for rendering the result.
    report_every: steps between reports.
    """

    steps: int = static_field(default=240)
    views: int = static_field(default=2)
    mean_rate: float = 4e-3
    quaternion_rate: float = 1e-2
    scale_rate: float = 2e-2
    opacity_rate: float = 0.1
    colour_rate: float = 2e-2
    max_scale: float = 1.0
    dssim_weight: float = 0.2
    mask_weight: float = 0.5
    alpha_weight: float = 0.4
    alpha_decay: float = 0.05
    alpha_views: int = static_field(default=1)
    relocated: float = 0.12
    antialias: bool = static_field(default=True)
    report_every: int = static_field(default=60)


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
        start: for instance a reconstructor's (`aerojax.reconstruct.fit.start`).
        views: images, mattes as masks, and cameras (leading axis `view`) in the Gaussians' frame with the object near
            its origin; at least 11 pixels a side.
        config: learning rates and steps.
        key: random backgrounds, views and cameras.
        report: progress.

    Returns:
        Gaussians of the same number, unit quaternions.
    """
    radius = jnp.sqrt(jnp.mean(jnp.sum((start.mean - start.mean.mean(axis=0, keepdims=True)) ** 2, axis=-1)))
    limits = _Limits(radius, jnp.log(config.max_scale * jnp.max(start.scale)), depth_observed(views.camera))
    parameters = _parameters_of(start)
    state = _State(parameters, _optimiser(config).init(parameters), jnp.zeros(len(start.mean)))
    for first in range(0, config.steps, config.report_every):
        part = min(config.report_every, config.steps - first)
        keys = jax.random.split(jax.random.fold_in(key, first), part)
        state, loss = _run_steps(state, views, limits, keys, jnp.asarray(first), config)
        # A relocated Gaussian has yet to settle: none in the first stretch, none in the last fifth.
        if first > 0 and first + part < 0.8 * config.steps:
            state = _relocate(state, int(config.relocated * len(start.mean)))
        if report is not None:
            report(first + part, float(loss))
    return _gaussians_of(state.parameters)


@pytree_dataclass
class _Limits:
    """The object's radius, metres; the logarithm of the largest scale; see `depth_observed`."""

    radius: Float[Array, ""]
    log_scale: Float[Array, ""]
    depth_observed: Float[Array, ""]


@pytree_dataclass
class _State:
    """Parameters, Adam's moments, and the sum of each centre's gradient norms since the last relocation."""

    parameters: dict[str, Array]
    moments: Any
    gradient_norm: Float[Array, "gaussian"]


def _parameters_of(gaussians: Gaussians) -> dict[str, Array]:
    """Unconstrained parameters: logarithm of the scale, logit of the opacity."""
    # The logistic curve is flat near 1: what starts opaque in a wrong place would stay.
    opacity = jnp.clip(gaussians.opacity, 1e-3, MAX_START_OPACITY)
    return {
        "mean": gaussians.mean,
        "quaternion": gaussians.quaternion,
        "scale": jnp.log(jnp.maximum(gaussians.scale, 1e-9)),
        "opacity": jnp.log(opacity) - jnp.log1p(-opacity),
        "sh": gaussians.sh,
    }


def _gaussians_of(parameters: dict[str, Array]) -> Gaussians:
    q = parameters["quaternion"]
    return Gaussians(
        mean=parameters["mean"],
        quaternion=q / jnp.maximum(jnp.linalg.norm(q, axis=-1, keepdims=True), 1e-9),
        scale=jnp.exp(parameters["scale"]),
        opacity=jax.nn.sigmoid(parameters["opacity"]),
        sh=parameters["sh"],
    )


def _optimiser(config: GaussianFitConfig) -> optax.GradientTransformation:
    rates = {
        "mean": config.mean_rate,
        "quaternion": config.quaternion_rate,
        "scale": config.scale_rate,
        "opacity": config.opacity_rate,
        "sh": config.colour_rate,
    }
    schedules = {name: optax.exponential_decay(rate, config.steps, 0.1) for name, rate in rates.items()}
    return optax.partition(
        {name: optax.adam(schedule, eps=1e-15) for name, schedule in schedules.items()}, {name: name for name in rates}
    )


def _premultiplied_foreground(views: View) -> Float[Array, "view height width 3"]:
    """What the object adds to each pixel: the image less the background's share; nothing where there is no object."""
    background = background_colour(views.rgb, views.mask)[:, None, None, :]
    alpha = views.mask[..., None]
    return jnp.where(alpha > 1e-3, views.rgb - (1 - alpha) * background, 0.0)


def _random_cameras(cameras: Camera, key: Key[Array, ""], count: int) -> Camera:
    """Cameras all around the origin, at the mean distance and with the mean focal length of `cameras`."""
    distance = jnp.mean(jnp.linalg.norm(cameras.world_from_cam[:, :3, 3], axis=-1))
    direction = normalise(jax.random.normal(key, (count, 3)))
    world_from_cam = jax.vmap(lambda centre: look_at(centre, jnp.zeros(3)))(direction * distance)
    K = jnp.broadcast_to(jnp.mean(cameras.K, axis=0), (count, 3, 3))
    return Camera(K, world_from_cam, cameras.width, cameras.height)


def depth_observed(cameras: Camera) -> Float[Array, ""]:
    """How well cameras tell every direction of a place near the origin, 0..1; 1 for cameras all around.

    The mean of I - d dᵀ over the viewing directions d is the information of pixels of equal size at the object. Its
    least eigenvalue over its greatest one, and that over `WELL_OBSERVED`, at most 1.
    """
    away = normalise(cameras.world_from_cam[:, :3, 3])
    information = jnp.eye(3) - jnp.mean(away[:, :, None] * away[:, None, :], axis=0)
    values = jnp.linalg.eigvalsh(information)
    return jnp.clip(values[0] / (WELL_OBSERVED * values[2]), 0.0, 1.0)


def _loss(
    parameters: dict[str, Array],
    views: View,
    foreground: Float[Array, "view height width 3"],
    alpha_weight: Float[Array, ""],
    key: Array,
    config: GaussianFitConfig,
) -> Float[Array, ""]:
    """Thesis Eq. 3.9 over random backgrounds in some of the views, with the mask term and the alpha regulariser."""
    key_background, key_cameras, key_views = jax.random.split(key, 3)
    count = min(config.views, len(views.mask))
    chosen = jax.random.permutation(key_views, len(views.mask))[:count]
    extra = _random_cameras(views.camera, key_cameras, config.alpha_views)
    views, foreground = jax.tree.map(lambda x: x[chosen], (views, foreground))
    background = jax.random.uniform(key_background, (count, 3))
    cameras = jax.tree.map(lambda *x: jnp.concatenate(x), views.camera, extra)
    backgrounds = jnp.concatenate([background, jnp.zeros((config.alpha_views, 3))])
    rendering = render(_gaussians_of(parameters), cameras, background=backgrounds, antialias=config.antialias)
    target = foreground + (1 - views.mask[..., None]) * background[:, None, None, :]
    photometric = photometric_loss(rendering.colour[:count], target, dssim_weight=config.dssim_weight)
    mask = jnp.mean(jnp.abs(rendering.alpha[:count] - views.mask))
    alpha = jnp.sum(rendering.alpha[count:]) / max(1, rendering.alpha[count:].size)
    return photometric + config.mask_weight * mask + alpha_weight * alpha


@jax.jit
def _run_steps(
    state: _State,
    views: View,
    limits: _Limits,
    keys: Key[Array, "step"],
    first: Int[Array, ""],
    config: GaussianFitConfig,
) -> tuple[_State, Float[Array, ""]]:
    """One update a key in one compiled loop, and the mean loss; `first` steps are done."""
    optimiser = _optimiser(config)
    foreground = _premultiplied_foreground(views)

    def step(state: _State, x: tuple[Array, Array]) -> tuple[_State, Array]:
        key, done = x
        weight = limits.depth_observed * config.alpha_weight * config.alpha_decay ** (done / config.steps)
        loss, gradient = jax.value_and_grad(_loss)(state.parameters, views, foreground, weight, key, config)
        with jax.numpy_dtype_promotion("standard"):  # optax raises decays to integer powers
            update: tuple[Any, Any] = optimiser.update(gradient, state.moments, state.parameters)
        change, moments = update
        # Centres move in units of the object's radius.
        change = {name: x * limits.radius if name == "mean" else x for name, x in change.items()}
        parameters: Any = optax.apply_updates(state.parameters, change)
        parameters["scale"] = jnp.minimum(parameters["scale"], limits.log_scale)
        norm = jnp.linalg.norm(gradient["mean"], axis=-1)
        return _State(parameters, moments, state.gradient_norm + norm), loss

    state, losses = jax.lax.scan(step, state, (keys, first + jnp.arange(len(keys))))
    return state, jnp.mean(losses)


@partial(jax.jit, static_argnames="count")
def _relocate(state: _State, count: int) -> _State:
    """Split the `count` Gaussians of the largest positional gradients; the second halves are those of the smallest.

    A fit that cannot show what a place needs has large gradients there (Kerbl et al. 2023, §5.2). Dead Gaussians, which
    have none, go first (Kheradmand et al. 2024). The halves lie half a standard deviation to both sides of the centre,
    along the longest axis, and are shorter along it.
    """
    old = state.parameters
    opacity = jax.nn.sigmoid(old["opacity"])
    order = jnp.argsort(jnp.where(opacity < DEAD_OPACITY, 0.0, state.gradient_norm))
    relocated, split = order[:count], order[len(order) - count :]
    whole = _gaussians_of({name: x[split] for name, x in old.items()})
    longest = jax.nn.one_hot(jnp.argmax(whole.scale, axis=-1), 3)
    axes = rotation_from_quaternion(whole.quaternion)
    offset = 0.5 * jnp.einsum("nij,nj->ni", axes, longest * whole.scale)
    new = {name: x.at[relocated].set(x[split]) for name, x in old.items()}
    new["mean"] = new["mean"].at[split].add(offset).at[relocated].add(-offset)
    shorter = longest * float(np.log(SPLIT_SCALE))
    new["scale"] = new["scale"].at[split].add(shorter).at[relocated].add(shorter)
    # The moments of the old place say nothing of the new one.
    moments = jax.tree.map(lambda x: x.at[relocated].set(0) if jnp.shape(x)[:1] == order.shape else x, state.moments)
    return _State(new, moments, jnp.zeros_like(state.gradient_norm))
