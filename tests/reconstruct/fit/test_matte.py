"""Mattes of known blends."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from aerojax.reconstruct.fit.matte import matte_from_coverage, matte_from_mask


def test_matte_from_coverage_undoes_the_blend_of_light():
    """A black object that covers half a white pixel: light 0.5 is shown as sRGB 0.7354, so a = 0.2646."""
    shown = jnp.array([0.0, 0.7354, 1.0])[None, :, None] * jnp.ones((1, 1, 3))
    coverage = jnp.array([[1.0, 0.5, 0.0]])
    matte = matte_from_coverage(shown, coverage, jnp.ones_like(shown))
    # The prior of weight 0.01 pulls towards the coverage: (3·0.2646 + 0.01·0.5)/3.01.
    np.testing.assert_allclose(matte, [[1.0, (3 * 0.2646 + 0.005) / 3.01, 0.0]], atol=1e-3)
    invisible = matte_from_coverage(jnp.ones((1, 1, 3)), jnp.array([[0.3]]), jnp.ones((1, 1, 3)))
    np.testing.assert_allclose(invisible, 0.3, atol=1e-6)


def test_matte_from_mask_finds_the_share_of_boundary_pixels():
    """A square 0.2 on 0.8 whose boundary shows 0.5: the share is one half, whatever the mask says."""
    rgb = jnp.full((1, 24, 24, 3), 0.8).at[0, 7:17, 7:17].set(0.5).at[0, 8:16, 8:16].set(0.2)
    for border in (7, 8):
        mask = jnp.zeros((1, 24, 24)).at[0, border : 24 - border, border : 24 - border].set(1.0)
        matte = np.asarray(matte_from_mask(rgb, mask))[0]
        assert (matte[10:14, 10:14] == 1).all() and (matte[:5] == 0).all()
        np.testing.assert_allclose(matte[7, 9:15], 0.5, atol=0.03 if border == 8 else 0.1)
    thin = jnp.zeros((1, 24, 24)).at[0, 12].set(1.0)
    np.testing.assert_array_equal(matte_from_mask(rgb, thin), thin)
