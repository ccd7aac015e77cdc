"""Views of which a part lies beyond an image's border."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import View


def cut_beyond(views: View, view: int, column: int, *, colour: float = 0.0, mask: float = 0.0) -> View:
    """The same views with an image that ends at a column of its crop; beyond it the arrays hold anything."""
    known = np.ones(views.mask.shape, bool) if views.known is None else np.array(views.known)
    known[view, :, column:] = False
    rgb, masks = views.rgb.at[view, :, column:].set(colour), views.mask.at[view, :, column:].set(mask)
    return replace(views, rgb=rgb, mask=masks, known=jnp.asarray(known))


def aimed_aside(cameras: Sequence[CaptureCamera], camera: int, column: int) -> tuple[CaptureCamera, ...]:
    """The same cameras, one with an image that begins at a column of what it was."""
    K = cameras[camera].K.copy()
    K[0, 2] -= column
    return (*cameras[:camera], replace(cameras[camera], K=K), *cameras[camera + 1 :])
