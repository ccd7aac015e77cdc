"""Where a fit starts: what a reconstructor makes of the views."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians, View
from aerojax.reconstruct.base import Reconstructor


def only_real(reconstructor: Reconstructor, views: View) -> Gaussians:
    """The real Gaussians of these views, without repeats; their number is known only afterwards.

    Raises:
        UserError: the silhouettes do not meet.
    """
    gaussians, count = jax.jit(reconstructor.__call__)(views, jnp.ones(len(views.mask), bool))
    if int(count) == 0:
        raise UserError(
            "no-usable-frames", "the silhouettes of the cameras do not meet: check calibration, masks and clocks"
        )
    return jax.tree.map(lambda x: x[: int(count)], gaussians)
