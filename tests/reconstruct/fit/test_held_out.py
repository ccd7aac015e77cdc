"""One view is kept from the fit; what is compared with it is drawn over its own background."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import LOOKING_ALONG_Z, QUICK, single

from aerojax.core.errors import UserError
from aerojax.core.types import View
from aerojax.reconstruct.fit.held_out import held_out_medians, render_beside_views, split_views


def views_of(count):
    """Views that can be told apart: image i has value i / 10."""
    rgb = jnp.arange(count)[:, None, None, None] / 10 * jnp.ones((count, 19, 23, 3))
    camera = jax.tree.map(lambda x: jnp.stack([x] * count), LOOKING_ALONG_Z)
    return View(rgb, jnp.zeros((count, 19, 23)), camera)


def test_the_held_out_view_is_counted_among_the_valid_ones():
    valid = np.array([True, False, True, True])
    fitting, held_out = split_views(views_of(4), valid, -2)
    np.testing.assert_allclose(fitting.rgb[:, 0, 0, 0], [0.0, 0.3])
    np.testing.assert_allclose(held_out.rgb[:, 0, 0, 0], [0.2])
    with pytest.raises(UserError, match="held_out=3: only 3 cameras see the whole object") as caught:
        split_views(views_of(4), valid, 3)
    assert caught.value.code == "out-of-range"


def test_both_images_have_the_views_own_background():
    views = views_of(2)
    compare = jax.jit(partial(render_beside_views, antialias=True), compiler_options=QUICK)
    rendered, target = compare(single((0, 0, -1), 0.1), views)
    np.testing.assert_allclose(rendered, views.rgb, atol=1e-6)
    np.testing.assert_allclose(target, views.rgb, atol=1e-6)


def test_medians_are_of_what_was_fitted_and_of_what_it_gained():
    figures = [(20.0, 14.0), (24.0, 23.0), (19.0, 20.0)]
    fits = [
        {f"{name}_held_out_view": {"foreground_psnr_db": db} for name, db in zip(("fitted", "hull"), pair, strict=True)}
        for pair in figures
    ]
    assert held_out_medians(fits) == {"median_db": 20.0, "median_gain_db": 1.0}
    assert held_out_medians([]) == {}
