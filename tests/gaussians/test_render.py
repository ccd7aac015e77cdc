"""Which number types the renderer takes, what it computes in, and what it refuses by name."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import BACKGROUND, QUICK, make_camera, make_gaussians

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.render import _require_shapes, render
from kernels.splat import blend, reference
from kernels.splat.projection import Shape, Splats

ATTRIBUTES = tuple(field.name for field in dataclasses.fields(Gaussians))
BACKENDS = ("warp", "reference")


def cast(gaussians: Gaussians, **kinds) -> Gaussians:
    return dataclasses.replace(gaussians, **{name: getattr(gaussians, name).astype(k) for name, k in kinds.items()})


def drawn(gaussians: Gaussians, backend: str, dtype=np.float32):
    draw = jax.jit(lambda g, c, b: render(g, c, background=b, backend=backend), compiler_options=QUICK)
    return draw(gaussians, make_camera(dtype=dtype), jnp.array(BACKGROUND, dtype))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["float16", "bfloat16"])
def test_half_precision_is_computed_in_single(kind, backend):
    """What is drawn are the rounded Gaussians, to the bit."""
    half = cast(make_gaussians(0, 5, 4, np.float32), **dict.fromkeys(ATTRIBUTES, kind))
    single = cast(half, **dict.fromkeys(ATTRIBUTES, "float32"))
    found, wanted = drawn(half, backend), drawn(single, backend)
    assert found.colour.dtype == found.depth.dtype == found.alpha.dtype == jnp.float32
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("backend", BACKENDS)
def test_mixed_types_are_computed_in_the_widest(backend, x64):
    gaussians = make_gaussians(1, 5, 4, np.float64)
    mixed = cast(gaussians, mean="float32", opacity="float16", sh="bfloat16")
    found = drawn(mixed, backend)
    wanted = drawn(cast(mixed, **dict.fromkeys(ATTRIBUTES, "float64")), backend, np.float32)
    assert found.colour.dtype == jnp.float64
    np.testing.assert_array_equal(found.colour, wanted.colour)
    assert drawn(cast(mixed, scale="float32", quaternion="float32"), backend).colour.dtype == jnp.float32


def test_gradients_have_the_types_of_the_arguments():
    half = cast(make_gaussians(2, 4, 1, np.float32), opacity="float16", sh="bfloat16")
    camera = make_camera(dtype=np.float32)
    slope = jax.grad(lambda g: jnp.sum(render(g, camera, background=jnp.array(BACKGROUND)).colour))(half)
    assert [getattr(slope, name).dtype for name in ATTRIBUTES] == [getattr(half, name).dtype for name in ATTRIBUTES]
    assert float(jnp.abs(slope.sh).max()) > 0


@pytest.mark.parametrize("kind", ["int32", "uint8", "bool", "complex64"])
def test_other_numbers_are_refused_by_name(kind):
    gaussians = make_gaussians(3, 4, 1, np.float32)
    odd = jax.tree.unflatten(
        jax.tree.structure(gaussians),
        [x.astype(kind) if i in (0, 3) else x for i, x in enumerate(jax.tree.leaves(gaussians))],
    )
    with pytest.raises(UserError, match=f"gaussians: mean is {kind}, opacity is {kind}; give floating"):
        render(odd, make_camera(dtype=np.float32), background=jnp.array(BACKGROUND))


def test_cameras_and_backgrounds_of_any_type_are_cast():
    gaussians, camera = make_gaussians(4, 4, 1, np.float32), make_camera(dtype=np.float32)
    whole = dataclasses.replace(camera, K=jnp.round(camera.K))
    integers = jax.tree.unflatten(jax.tree.structure(whole), [whole.K.astype(int), whole.world_from_cam])
    wanted = render(gaussians, whole, background=jnp.zeros(3)).colour
    found = render(gaussians, integers, background=jnp.zeros(3, jnp.bfloat16)).colour
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("module", [blend, reference])
def test_kernels_name_types_that_they_are_not_compiled_for(module):
    g = make_gaussians(5, 3, 1, np.float32)
    colour = g.sh[:, 0]
    others = (jnp.eye(3), jnp.eye(4), jnp.zeros(3))
    shape = Shape(16, 16, 0.2, "inria", False)
    with pytest.raises(TypeError, match=r"mean float16, quaternion float32.*camera_from_world float32"):
        module.splat(g.mean.astype("float16"), g.quaternion, g.scale, g.opacity, colour, *others, shape=shape)
    half = jnp.zeros((3, 2), jnp.float16)
    splats = Splats(half, jnp.zeros((3, 3)), jnp.zeros(3), jnp.zeros(3), jnp.zeros((3, 4), jnp.int32))
    with pytest.raises(TypeError, match="centre float16, colour float32"):
        module.blend(splats, colour, jnp.zeros(3), width=16, height=16)


def test_without_a_background_it_is_black():
    gaussians, camera = make_gaussians(0, 5, 4, np.float32), make_camera(dtype=np.float32)
    black = render(gaussians, camera, background=jnp.zeros(3), backend="reference").colour
    np.testing.assert_array_equal(render(gaussians, camera, backend="reference").colour, black)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("gaussians.quaternion", {"quaternion": jnp.ones((5, 3))}, r"shape \(5, 3\); it must be \(\.\.\., 5, 4\)"),
        ("gaussians.opacity", {"opacity": jnp.ones((4,))}, r"shape \(4,\); it must be \(\.\.\., 5\)"),
        ("gaussians.sh", {"sh": jnp.ones((5, 3))}, r"shape \(5, 3\); it must be \(\.\.\., 5, coefficients, 3\)"),
    ],
)
def test_a_wrong_shape_is_named(name, change, words):
    gaussians = make_gaussians(0, 5, 4, np.float32)
    # As without the shape checks that only tests have: the attributes are put past them.
    wrong = jax.tree.unflatten(
        jax.tree.structure(gaussians), [change.get(one, getattr(gaussians, one)) for one in ATTRIBUTES]
    )
    with pytest.raises(UserError, match=f"render: {name} has {words}"):
        render(wrong, make_camera(dtype=np.float32))
    with pytest.raises(UserError, match=r"render: background has shape \(4,\)"):
        _require_shapes(gaussians, make_camera(dtype=np.float32), jnp.zeros(4))
