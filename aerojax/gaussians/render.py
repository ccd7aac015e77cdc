"""Render Gaussians to colour, depth and alpha, differentiably, for any batch of scenes and cameras."""

from __future__ import annotations

import dataclasses
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from aerojax.core.errors import UserError
from aerojax.core.types import Camera, Gaussians, pytree_dataclass
from aerojax.gaussians.sh import colour_in_direction, degree_of
from aerojax.geometry.cameras import invert_rigid
from aerojax.geometry.rotations import normalise
from kernels.splat import blend as splat
from kernels.splat import reference as splat_reference
from kernels.splat.projection import MAX_MAGNITUDE, RULES, Shape, zero_rows

Backend = Literal["warp", "reference"]


@pytree_dataclass
class Rendering:
    """Images of Gaussians.

    colour: RGB over the background, unclipped above.
    depth: Σ z·alpha·T, metres, **not** divided by alpha; the background adds nothing. See `expected_depth`.
    alpha: coverage 1 - T, 0..1.
    dropped: how many Gaussians had a non-finite (or absurdly large) attribute and were left out.
    """

    colour: Float[Array, "*batch height width 3"]
    depth: Float[Array, "*batch height width"]
    alpha: Float[Array, "*batch height width"]
    dropped: Int[Array, "*batch"]


def expected_depth(rendering: Rendering, *, eps: float = 1e-6) -> Float[Array, "*batch height width"]:
    """Mean depth of what a pixel shows, Σ z·alpha·T / alpha, metres; 0 where nothing is drawn."""
    drawn = rendering.alpha > eps
    return jnp.where(drawn, rendering.depth / jnp.where(drawn, rendering.alpha, 1.0), 0.0)


def render(
    gaussians: Gaussians,
    camera: Camera,
    *,
    background: Float[Array, "*batch 3"] | None = None,
    antialias: bool = False,
    near: float = 0.2,
    rules: str = "inria",
    backend: Backend = "warp",
) -> Rendering:
    """Draw Gaussians (3D Gaussian splatting, Kerbl et al. 2023; thesis Eq. 3.5-3.8).

    Leading axes of `gaussians`, `camera` and `background` broadcast like NumPy's; all images are drawn in one launch.
    `jax.jit`, `jax.grad`, `jax.vmap` and `jax.lax.scan` work on it. Gradients are true derivatives inside one branch of
    the rules' decisions; ∂depth/∂z_i = alpha_i T_i beside the weights' own part.

    Computed, and returned, in float64 if an attribute of the Gaussians is float64, else in float32: attributes of other
    floating-point types (float16, bfloat16) are cast to it, and so are the camera and the background, of whatever type.
    Gradients have the types of the arguments.

    Args:
        gaussians: world frame, any floating-point types.
        camera: OpenCV cameras; skew is ignored. One with a non-finite entry sees only the background.
        background: RGB behind everything; black if None.
        antialias: scale opacity by the area that the 0.3-pixel low-pass adds (Yu et al. 2024), so that thin Gaussians
            keep their energy; train and render with the same setting.
        near: metres; Gaussians whose centre is nearer are not drawn.
        rules: "inria" (3σ squares, alpha ≤ 0.99) or "gsplat" (per-axis extent from the opacity, alpha ≤ 0.999).
        backend: "warp", or "reference": plain JAX, slow.

    Raises:
        UserError: unknown `rules`, an argument of another shape, a number of colour coefficients other than 1, 4, 9 or
            16, or attributes that are integers, booleans or complex, whose unit nobody knows (an opacity of 0..255?).
    """
    if rules not in RULES:
        raise UserError("invalid", f"rules: unknown name {rules!r}", f"choose one of {', '.join(RULES)}")
    background = jnp.zeros(3) if background is None else background
    _require_shapes(gaussians, camera, background)
    degree_of(gaussians.sh.shape[-2])
    shape = Shape(camera.width, camera.height, near, rules, antialias)
    draw = splat.splat if backend == "warp" else splat_reference.splat

    def one(mean, quaternion, scale, opacity, sh, K, world_from_cam, background):
        attributes = (mean, quaternion, scale, opacity[:, None], sh.reshape(-1, 3 * sh.shape[1]))
        columns = jax.lax.stop_gradient(jnp.concatenate(attributes, axis=-1))
        finite = jnp.all(jnp.isfinite(columns) & (jnp.abs(columns) <= MAX_MAGNITUDE), axis=-1)
        mean, quaternion, scale, opacity, sh = zero_rows((mean, quaternion, scale, opacity, sh), finite)
        # A lost camera sees nothing: opacity 0 and a stand-in, for arithmetic on NaN would poison gradients.
        known = jnp.all(jnp.isfinite(K)) & jnp.all(jnp.isfinite(world_from_cam))
        K, world_from_cam = (jnp.where(known, x, jnp.eye(len(x), dtype=x.dtype)) for x in (K, world_from_cam))
        opacity = jnp.where(known, opacity, 0)
        colour = colour_in_direction(sh, normalise(mean - world_from_cam[None, :3, 3]))
        camera_from_world = invert_rigid(world_from_cam)
        images = draw(mean, quaternion, scale, opacity, colour, K, camera_from_world, background, shape=shape)
        return *images[:3], jnp.sum(~finite)

    signature = "(n,x),(n,q),(n,x),(n),(n,k,x),(x,x),(q,q),(x)->(h,w,x),(h,w),(h,w),()"
    attributes = (gaussians.mean, gaussians.quaternion, gaussians.scale, gaussians.opacity, gaussians.sh)
    dtype = _computed_in(gaussians)
    arrays = [jnp.asarray(x, dtype) for x in (*attributes, camera.K, camera.world_from_cam, background)]
    return Rendering(*jnp.vectorize(one, signature=signature)(*_equal_batch_ranks(*arrays)))


def _require_shapes(gaussians: Gaussians, camera: Camera, background: Float[Array, "..."]) -> None:
    """Refuse arguments whose last axes are not what they should be, before their sizes meet somewhere inside."""
    count = jnp.shape(gaussians.mean)[-2] if jnp.ndim(gaussians.mean) > 1 else "gaussians"
    wanted = {
        "gaussians.mean": (gaussians.mean, (count, 3)),
        "gaussians.quaternion": (gaussians.quaternion, (count, 4)),
        "gaussians.scale": (gaussians.scale, (count, 3)),
        "gaussians.opacity": (gaussians.opacity, (count,)),
        "gaussians.sh": (gaussians.sh, (count, "coefficients", 3)),
        "camera.K": (camera.K, (3, 3)),
        "camera.world_from_cam": (camera.world_from_cam, (4, 4)),
        "background": (background, (3,)),
    }
    for name, (array, last) in wanted.items():
        shape = jnp.shape(array)
        found = shape[-len(last) :]
        fits = len(found) == len(last) and all(isinstance(b, str) or a == b for a, b in zip(found, last, strict=True))
        if not fits:
            expected = ", ".join(map(str, ("...", *last)))
            raise UserError("invalid", f"render: {name} has shape {shape}", f"it must be ({expected})")


def _computed_in(gaussians: Gaussians) -> jnp.dtype:
    """The type to compute in: float64 if an attribute has it, else float32."""
    kinds = {field.name: getattr(gaussians, field.name).dtype for field in dataclasses.fields(gaussians)}
    wrong = [f"{name} is {kind}" for name, kind in kinds.items() if not jnp.issubdtype(kind, jnp.floating)]
    if wrong:
        raise UserError("invalid", f"gaussians: {', '.join(wrong)}", "give floating-point numbers")
    return jnp.dtype("float64" if jnp.dtype("float64") in kinds.values() else "float32")


def _equal_batch_ranks(*arrays: Array) -> list[Array]:
    """Arguments of `render` with as many batch axes each; new ones have size 1."""
    ranks = [x.ndim - core for x, core in zip(arrays, (2, 2, 2, 1, 3, 2, 2, 1), strict=True)]
    return [x.reshape((1,) * (max(ranks) - rank) + x.shape) for x, rank in zip(arrays, ranks, strict=True)]
