"""The encoder: images and cameras in, a depth and a Gaussian for every pixel out."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx
from jaxtyping import Array, Bool, Float

from aerojax.core.errors import UserError
from aerojax.core.types import Camera, Gaussians, View, pytree_dataclass
from aerojax.reconstruct.depthsplat.backbone import Backbone
from aerojax.reconstruct.depthsplat.config import CELL, DepthSplatSizes
from aerojax.reconstruct.depthsplat.cost_volume import (
    DepthRange,
    PlaneSweep,
    depth_range,
    feature_cameras,
    plane_sweep,
)
from aerojax.reconstruct.depthsplat.draws import Draws
from aerojax.reconstruct.depthsplat.gaussians import GaussianHead, pixel_gaussians
from aerojax.reconstruct.depthsplat.grids import repeat, resize, resize_patches
from aerojax.reconstruct.depthsplat.layers import Convolution, gelu
from aerojax.reconstruct.depthsplat.monocular import MonocularBranch
from aerojax.reconstruct.depthsplat.transformer import MultiViewTransformer, Neighbours, neighbours_of
from aerojax.reconstruct.depthsplat.unet import CostRegressor
from aerojax.reconstruct.depthsplat.upsampler import ResidualHead, Upsampler, ViewFeatures

IMAGE_MEAN, IMAGE_DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of ImageNet's sRGB, which the published weights were trained with."""
IS_OBJECT = 0.5
"""Coverage from which a pixel is the object's: the thesis' masks are binary."""


class DepthHead(nnx.Module):
    """Features of depth → logits of the candidates."""

    def __init__(self, config: DepthSplatSizes, *, draws: Draws):
        width = config.unet_width
        self.first = Convolution(width, 2 * width, draws=draws, edge="nearest")
        self.last = Convolution(2 * width, config.candidates, draws=draws, edge="nearest")

    def __call__(self, x: Float[Array, "view height width channel"]) -> Float[Array, "view height width candidate"]:
        """Logits."""
        return self.last(gelu(self.first(x)))


@pytree_dataclass
class CoarseDepth:
    """Depth of every cell, from the softmax over the candidates.

    place: expected place in the range of inverse depth, 0 far to 1 near.
    certainty: the largest probability.
    """

    place: Float[Array, "view height width"]
    certainty: Float[Array, "view height width"]


@pytree_dataclass
class Encoding:
    """Everything of every pixel before it becomes a Gaussian.

    place: in the range of inverse depth, 0 where the mask shows no object.
    raw: attributes before any bound.
    span: the range.
    """

    place: Float[Array, "view height width"]
    raw: Float[Array, "view height width attribute"]
    span: DepthRange


@pytree_dataclass
class Prediction:
    """What the network says of every pixel of every view.

    depth: metres along the optical axis; the far end of the range where the mask shows no object.
    gaussians: one a pixel, views one after the other, row by row, in the frame of the cameras; opacity 0 where the mask
        shows no object and in views that do not count.
    """

    depth: Float[Array, "view height width"]
    gaussians: Gaussians


class DepthSplatNetwork(nnx.Module):
    """The encoder; a pytree of its parameters.

    Turning all cameras about the origin turns the Gaussians: nothing but relative poses is read.
    """

    def __init__(self, config: DepthSplatSizes, *, draws: Draws):
        self.config = config
        self.backbone = Backbone(config, draws=draws)
        self.transformer = MultiViewTransformer(config, draws=draws)
        self.monocular = MonocularBranch(config, draws=draws)
        inputs = config.candidates + 2 * config.width + config.vit_width
        self.regressor = CostRegressor(inputs, config, draws=draws)
        self.depth_head = DepthHead(config, draws=draws)
        self.depth_upsampler = Upsampler(config, config.depth_width, depth=True, draws=draws)
        self.depth_residual = ResidualHead(config.depth_width, draws=draws)
        self.feature_upsampler = Upsampler(config, config.feature_width, depth=False, draws=draws)
        self.gaussian_head = GaussianHead(config, draws=draws)

    def __call__(self, views: View, valid: Bool[Array, "view"]) -> Prediction:
        """Depth and Gaussians of one frame.

        Args:
            views: at least two, `config.size` pixels wide and high, whose cameras look at the frame's origin; sRGB.
            valid: views that count; the others are not read.

        Raises:
            UserError: images of another size, or a single view.
        """
        found = self.encode(views, valid)
        coverage = jnp.where(valid[:, None, None], views.mask, 0.0)
        gate = jnp.where(coverage > IS_OBJECT, coverage, 0.0)
        depth = 1 / found.span.inverse_depth(found.place)
        return Prediction(depth, pixel_gaussians(found.raw, depth, gate, views, found.span.unit, self.config))

    def encode(self, views: View, valid: Bool[Array, "view"]) -> Encoding:
        """The networks' part of the call, with the same arguments."""
        self._refuse(views)
        kind = self.backbone.stem.weight[...].dtype
        coverage = jnp.where(valid[:, None, None], views.mask, 0.0)
        neighbours = neighbours_of(views.camera.world_from_cam[:, :3, 3], valid, self.config.neighbours)
        span = depth_range(views.camera, valid, self.config)
        features = self.features(normalised(views.rgb, coverage).astype(kind), neighbours)
        sweep = self.sweep(features, views.camera, neighbours, span)
        coarse = self.coarse_depth(sweep, features, coverage, valid)
        place = jnp.where(coverage > IS_OBJECT, self.fine_place(coarse, features), 0.0)
        raw = self.raw_gaussians(views.rgb, place, coarse, features).astype(jnp.float32)
        return Encoding(place, raw, span)

    def features(self, images: Float[Array, "view size size 3"], neighbours: Neighbours) -> ViewFeatures:
        """Of normalised images."""
        convolved = self.backbone(images)
        matched = self.transformer(convolved.quarter, neighbours)
        size, compat = self.config.size, self.config.compat
        patches = self.monocular(images)
        monocular = tuple(resize_patches(x, size // 8, size=size, compat=compat) for x in patches)
        return ViewFeatures(convolved, matched, monocular)

    def sweep(self, features: ViewFeatures, cameras: Camera, neighbours: Neighbours, span: DepthRange) -> PlaneSweep:
        """Agreement of the matched features at candidates uniform in inverse depth, the first one far."""
        places = jnp.linspace(0.0, 1.0, self.config.candidates)
        inverse = span.inverse_depth(jnp.broadcast_to(places, (len(span.near), len(places))))
        cells = feature_cameras(cameras, compat=self.config.compat)
        return plane_sweep(features.matched, cells, neighbours, inverse, compat=self.config.compat)

    def cost_features(
        self, sweep: PlaneSweep, features: ViewFeatures, coverage: Float[Array, "view size size"]
    ) -> Float[Array, "view quarter quarter channel"]:
        """What the regressor reads: the cost where the mask shows the object (thesis §5.5.1), and all features.

        A cell counts as soon as one of its pixels does, so that rods thinner than a cell are kept.
        """
        view, size = coverage.shape[:2]
        cells = coverage.reshape(view, size // CELL, CELL, size // CELL, CELL).max(axis=(2, 4)) > IS_OBJECT
        cost = jnp.where(cells[..., None], sweep.cost, 0.0).astype(features.matched.dtype)
        mono = resize(features.monocular[-1], size // CELL, compat=self.config.compat)
        return jnp.concatenate([cost, features.convolved.quarter, features.matched, mono], axis=-1)

    def coarse_depth(
        self,
        sweep: PlaneSweep,
        features: ViewFeatures,
        coverage: Float[Array, "view size size"],
        valid: Bool[Array, "view"],
    ) -> CoarseDepth:
        """Expectation over the candidates, in inverse depth."""
        hidden = self.regressor(self.cost_features(sweep, features, coverage), valid)
        share = jax.nn.softmax(self.depth_head(hidden).astype(jnp.float32), axis=-1)
        places = jnp.linspace(0.0, 1.0, self.config.candidates)
        return CoarseDepth(share @ places, jnp.max(share, axis=-1))

    def fine_place(self, coarse: CoarseDepth, features: ViewFeatures) -> Float[Array, "view size size"]:
        """The coarse depth at full resolution plus what the monocular features add to it, within the range.

        The far plane is put in afterwards: between cells it would bleed into the object's rim.
        """
        low, high = 1 / self.config.far, 1 / self.config.near
        inverse = low + coarse.place * (high - low)
        upsampled = self.depth_upsampler(features, inverse.astype(features.matched.dtype))
        residual = self.depth_residual(upsampled).astype(jnp.float32)
        whole = resize(inverse[..., None], self.config.size, compat=self.config.compat)[..., 0]
        return jnp.clip((whole + residual - low) / (high - low), 0.0, 1.0)

    def raw_gaussians(
        self,
        rgb: Float[Array, "view size size 3"],
        place: Float[Array, "view size size"],
        coarse: CoarseDepth,
        features: ViewFeatures,
    ) -> Float[Array, "view size size attribute"]:
        """Attributes before any bound: opacity, offset, scale, quaternion, colour coefficients.

        The depth that is read is that of the thesis' arrangement, whatever the cameras' distance is.
        """
        low, high = 1 / self.config.far, 1 / self.config.near
        upsampled = self.feature_upsampler(features)
        certainty, compat = coarse.certainty[..., None], self.config.compat
        certainty = repeat(certainty, CELL) if compat else resize(certainty, self.config.size, compat=False)
        depth = 1 / (low + place * (high - low))
        kind = upsampled.dtype
        return self.gaussian_head(rgb.astype(kind), depth[..., None].astype(kind), certainty.astype(kind), upsampled)

    def _refuse(self, views: View) -> None:
        count, height, width = views.mask.shape
        if (height, width) != (self.config.size, self.config.size):
            problem = f"images of {width}×{height} pixels, but the network's are {self.config.size}² pixels"
            raise UserError("mismatch", problem, "resample them with `resized_views`")
        if count < 2:
            raise UserError("mismatch", "a single view, but depth comes from two views at least", "add views")


def normalised(
    rgb: Float[Array, "view height width 3"], coverage: Float[Array, "view height width"]
) -> Float[Array, "view height width 3"]:
    """sRGB over white (thesis §5.5.2), in standard deviations of ImageNet's."""
    mask = coverage[..., None]
    over_white = rgb * mask + (1 - mask)
    mean, deviation = (np.asarray(v, np.float32)[None, None, None] for v in (IMAGE_MEAN, IMAGE_DEVIATION))
    return (over_white - mean) / deviation


def resized_views(views: View, size: int) -> View:
    """Views of another size: averaged where they shrink, interpolated where they grow; cameras to fit."""
    have = views.camera.width
    if (views.camera.height, have) == (size, size):
        return views

    def resample(x: Any) -> Any:
        return jax.image.resize(x, (x.shape[0], size, size, *x.shape[3:]), "linear", antialias=True)

    ratio = jnp.asarray([size / have, size / views.camera.height, 1.0], views.camera.K.dtype)
    K = views.camera.K * ratio[None, :, None]
    camera = Camera(K, views.camera.world_from_cam, size, size)
    return View(resample(views.rgb), resample(views.mask), camera)
