"""What the updates are told: errors in the views, the way out of them, neighbours and lengths."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.types import Gaussians
from aerojax.gaussians.render import render
from aerojax.geometry.cameras import project_points
from aerojax.reconstruct.refine.feedback import CHANGES, feedback, resized
from aerojax.reconstruct.refine.neighbours import finest_pixel, nearest, spacing
from aerojax.reconstruct.refine.parameters import turned
from aerojax.reconstruct.refine.sampling import seen_by
from tests.support.cut_views import cut_beyond
from tests.support.hull_views import DISTANCE, HALF_WIDTH
from tests.support.refined_hulls import sphere_views

VIEWS = resized(sphere_views(3), 32)


def blobs(count=12):
    """Coarse Gaussians on the ball's surface."""
    key_place, key_turn, key_colour = jax.random.split(jax.random.key(3), 3)
    place = jax.random.normal(key_place, (count, 3))
    place = 0.45 * place / jnp.linalg.norm(place, axis=-1, keepdims=True)
    turn = jax.random.normal(key_turn, (count, 4))
    turn = turn / jnp.linalg.norm(turn, axis=-1, keepdims=True)
    scale = jnp.broadcast_to(jnp.array([[0.2, 0.12, 0.06]]), (count, 3))
    return Gaussians(place, turn, scale, jnp.full(count, 0.6), jax.random.normal(key_colour, (count, 1, 3)))


def error(gaussians, views):
    """½ Σ |C - A·rgb|² over the coverage + ½ Σ (A - mask)², written again."""
    seen = render(gaussians, views.camera, background=jnp.zeros(3), antialias=True)
    colour = (seen.colour - seen.alpha[..., None] * views.rgb) * views.mask[..., None]
    return 0.5 * jnp.sum(colour**2) + 0.5 * jnp.sum((seen.alpha - views.mask) ** 2)


def moved(gaussians, change, axes):
    return Gaussians(
        gaussians.mean + change[:, 0:3] @ axes.T,
        turned(gaussians.quaternion, change[:, 3:6]),
        gaussians.scale * jnp.exp(change[:, 6:9]),
        gaussians.opacity + change[:, 9],
        gaussians.sh + change[:, None, 10:13],
    )


def changed_error(change, view):
    """The error in one view of blobs that are changed in its frame."""
    return error(moved(blobs(), change, view.camera.world_from_cam[0, :3, :3]), view)


def one_view(index):
    return jax.tree.map(lambda x: x[index : index + 1], VIEWS)


told, slope, height = jax.jit(feedback), jax.jit(jax.grad(changed_error)), jax.jit(changed_error)
ALL = jnp.ones(3, bool)


def test_gradients_are_those_of_each_views_error():
    found = told(blobs(), VIEWS, ALL)
    for index in range(3):
        wanted = slope(jnp.zeros((12, CHANGES)), one_view(index))
        np.testing.assert_allclose(found.gradient[index], wanted, rtol=1e-3, atol=1e-4 * np.abs(wanted).max())


def test_a_step_down_the_gradient_mends():
    gradient = told(blobs(), VIEWS, ALL).gradient[0]
    before, after = (float(height(-step * gradient, one_view(0))) for step in (0.0, 1e-4))
    predicted = 1e-4 * float(jnp.sum(gradient**2))
    assert 0.5 * predicted < before - after < 1.5 * predicted


def test_a_perfect_rendering_has_no_error():
    seen = jax.jit(lambda some, camera: render(some, camera, background=jnp.zeros(3), antialias=True))(
        blobs(), VIEWS.camera
    )
    shown = seen.colour / jnp.maximum(seen.alpha, 1e-6)[..., None]
    found = told(blobs(), replace(VIEWS, rgb=shown, mask=seen.alpha), ALL)
    np.testing.assert_allclose(found.images[..., 4:8], 0.0, atol=1e-5)
    np.testing.assert_allclose(found.gradient, 0.0, atol=1e-3)


def test_views_that_do_not_count_are_silent():
    found = told(blobs(), VIEWS, jnp.array([True, False, True]))
    for values in (found.images, found.depth, found.gradient):
        assert float(jnp.max(jnp.abs(values[1]))) == 0 < float(jnp.max(jnp.abs(values[0])))


def test_beyond_an_images_border_nothing_is_said():
    cut = cut_beyond(VIEWS, 1, 16, colour=5.0, mask=1.0)
    found, plain = told(blobs(), cut, ALL), told(blobs(), VIEWS, ALL)
    np.testing.assert_array_equal(found.images[1, :, 16:], 0.0)
    np.testing.assert_allclose(found.images[1, :, :16], plain.images[1, :, :16], atol=1e-6)
    for index in (0, 2):
        np.testing.assert_allclose(found.gradient[index], plain.gradient[index], atol=1e-4)
    assert bool(jnp.all(jnp.isfinite(found.gradient)))
    shown = seen_by(blobs().mean, VIEWS, ALL), seen_by(blobs().mean, cut, jnp.array([True, True, False]))
    np.testing.assert_array_equal(shown[0], [[True]] * 3)
    columns = project_points(blobs().mean, jax.tree.map(lambda x: x[1], VIEWS.camera))[:, 0]
    np.testing.assert_array_equal(shown[1], [[True] * 12, columns < 16, [False] * 12])
    half = resized(cut, 16)  # a pixel of two, one of which is not known, is not
    assert half.known is not None and half.known[1, :, :8].all() and not half.known[1, :, 8:].any()
    odd = resized(cut_beyond(VIEWS, 1, 15), 16).known
    assert odd is not None and odd[1, :, :7].all() and not odd[1, :, 7:].any()


def test_neighbours_are_the_nearest_real_ones():
    points = jax.random.normal(jax.random.key(0), (40, 3))
    real = jnp.arange(40) < 30
    near = jax.jit(nearest, static_argnums=2)(points, real, 5)
    distance = np.linalg.norm(np.asarray(points)[:, None] - np.asarray(points)[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    distance[:, 30:] = np.inf
    wanted = np.argsort(distance, axis=1)[:, :5]
    np.testing.assert_array_equal(near.index[:30], wanted[:30])
    np.testing.assert_array_equal(near.real, np.broadcast_to(np.asarray(real)[:, None], (40, 5)))
    found = jax.jit(spacing)(points, near)
    np.testing.assert_allclose(found[:30], np.take_along_axis(distance, wanted, 1)[:30].mean(axis=1), rtol=1e-4)
    np.testing.assert_array_equal(found[30:], 0.0)


def test_few_points_have_few_neighbours():
    near = nearest(jnp.eye(3), jnp.array([True, True, False]), 2)
    np.testing.assert_array_equal(near.real, [[True, False], [True, False], [False, False]])


def test_the_finest_pixel_is_that_of_the_nearest_camera():
    centre = jnp.zeros((1, 3))
    span = 2 * HALF_WIDTH / VIEWS.camera.width
    np.testing.assert_allclose(finest_pixel(centre, VIEWS.camera, jnp.ones((3, 1), bool)), [span], rtol=1e-5)
    near = VIEWS.camera.world_from_cam.at[1, :3, 3].mul(0.5)
    closer = replace(VIEWS.camera, world_from_cam=near)
    np.testing.assert_allclose(finest_pixel(centre, closer, jnp.ones((3, 1), bool)), [span / 2], rtol=1e-5)
    np.testing.assert_allclose(finest_pixel(centre, closer, jnp.array([[True], [False], [True]])), [span], rtol=1e-5)
    assert float(finest_pixel(centre, closer, jnp.zeros((3, 1), bool))[0]) == 1.0
    # Of two points the near view shows the second one alone.
    both, seen = jnp.zeros((2, 3)), jnp.array([[True, True], [False, True], [True, True]])
    np.testing.assert_allclose(finest_pixel(both, closer, seen), [span, span / 2], rtol=1e-5)
    assert DISTANCE > 1
