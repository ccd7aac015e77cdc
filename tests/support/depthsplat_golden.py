"""The published DepthSplat encoder's reference data: weights by recipe, inputs, and our stages beside its stages."""

from __future__ import annotations

import dataclasses
import json
import zlib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.types import Camera, View
from aerojax.reconstruct.depthsplat.config import DepthSplatConfig, parity_config
from aerojax.reconstruct.depthsplat.cost_volume import depth_range
from aerojax.reconstruct.depthsplat.gaussians import bounded_scale
from aerojax.reconstruct.depthsplat.grids import repeat
from aerojax.reconstruct.depthsplat.network import DepthSplatNetwork, normalised
from aerojax.reconstruct.depthsplat.reconstructor import untrained_depthsplat
from aerojax.reconstruct.depthsplat.tensor_names import network_from_published
from aerojax.reconstruct.depthsplat.transformer import neighbours_of

SIZE = 128


def golden_config() -> DepthSplatConfig:
    return dataclasses.replace(parity_config(), size=SIZE)


def recipe_tensors(folder: Path) -> dict[str, np.ndarray]:
    """Weights as the README's recipe draws them."""
    entries = json.loads((folder / "params.json").read_text())["recipe"]
    return {entry["name"]: _draw(entry["name"], tuple(entry["shape"]), entry["rule"]) for entry in entries}


def _draw(name: str, shape: tuple[int, ...], rule: str) -> np.ndarray:
    z = np.random.default_rng(zlib.crc32(name.encode())).standard_normal(shape)
    if rule.endswith("*z/sqrt(prod(shape[1:]))"):
        z = float(rule.split("*")[0]) * z / np.sqrt(np.prod(shape[1:]))
    elif "+" in rule:
        base, spread = rule.removesuffix("*z").split("+")
        z = float(base) + float(spread) * z
    else:
        z = float(rule.removesuffix("*z")) * z
    return z.astype(np.float32)


def golden_network(folder: Path, *, corrected_mask: bool = False) -> DepthSplatNetwork:
    """The network with those weights; upstream's shortcuts, but for the shift mask where asked.

    The stored numbers have zeros beyond the border of the Gaussian head's convolutions, where upstream's source and the
    README say the nearest pixel.
    """
    shapes = jax.eval_shape(lambda key: untrained_depthsplat(golden_config(), key=key), jax.random.key(0)).network
    network = network_from_published(recipe_tensors(folder), shapes)
    network.transformer.blocks.compat = not corrected_mask
    network.gaussian_head.first.edge = network.gaussian_head.last.edge = "zeros"
    return network


def golden_views(folder: Path) -> View:
    """The inputs, with masks of the whole image."""
    with np.load(folder / "inputs.npz") as stored:
        rgb = stored["image_u8"].transpose(0, 2, 3, 1).astype(np.float32) / 255
        K = stored["K_normalised"].astype(np.float32) * np.array([SIZE, SIZE, 1], np.float32)[None, :, None]
        camera = Camera(jnp.asarray(K), jnp.asarray(stored["c2w"], jnp.float32), SIZE, SIZE)
    return View(jnp.asarray(rgb), jnp.ones(rgb.shape[:3]), camera)


def _channels_first(x: jax.Array) -> jax.Array:
    return jnp.moveaxis(x, -1, 1)


@jax.jit
def feature_stages(network: DepthSplatNetwork, views: View) -> dict[str, jax.Array]:
    """The stages up to the features of every view, by the names of the reference data."""
    images = normalised(views.rgb, views.mask)
    neighbours = neighbours_of(views.camera.world_from_cam[:, :3, 3], jnp.ones(3, bool), 5)
    pyramid = network.backbone(images)
    found = {"cnn_half_a": pyramid.half_first, "cnn_half_b": pyramid.half, "cnn_quarter": pyramid.quarter}
    found["vit_input"] = network.monocular.resized(images)
    found |= _transformer_stages(network, pyramid.quarter, neighbours)
    features = network.features(images, neighbours)
    found |= {"mono_eighth0": features.monocular[0], "mono_eighth3": features.monocular[3]}
    found = {name: _channels_first(x) for name, x in found.items()}
    tokens = network.monocular.tokens(images)
    found |= {"vit_block0_in": tokens, "vit_pos_embed": network.monocular.position_table(9)}
    found["vit_block0_out"] = jax.tree.map(lambda leaf: leaf[0], network.monocular.blocks)(tokens)
    taps = network.monocular(images)
    return found | {f"vit_tap{2 + 3 * i}_tokens": tap.reshape(3, 81, -1) for i, tap in enumerate(taps)}


def _transformer_stages(network, x, neighbours) -> dict[str, jax.Array]:
    x = network.transformer.positioned(x)
    found = {"mv_block0_in": x}
    for index in range(6):
        block = jax.tree.map(lambda leaf, index=index: leaf[index], network.transformer.blocks)
        if index < 2:
            found[f"mv_block{index}_after_self"] = block.attend_self(x, shifted=index % 2 == 1)
        x = block(x, neighbours, shifted=index % 2 == 1)
        found[f"mv_block{index}_out"] = x
    return found | {"mv_final": x}


@jax.jit
def depth_stages(network: DepthSplatNetwork, views: View) -> dict[str, jax.Array]:
    """The stages from the cost volume to the Gaussians, by the names of the reference data."""
    valid, cameras = jnp.ones(3, bool), views.camera
    neighbours = neighbours_of(cameras.world_from_cam[:, :3, 3], valid, 5)
    features = network.features(normalised(views.rgb, views.mask), neighbours)
    span = depth_range(cameras, valid, network.config)
    sweep = network.sweep(features, cameras, neighbours, span)
    inputs = network.cost_features(sweep, features, views.mask)
    regressor = network.regressor
    unet_in = regressor.stem(inputs)
    unet_out = regressor.unet(unet_in, valid)
    out, straight = regressor.last(unet_out), regressor.straight(inputs)
    logits = network.depth_head(out + straight)
    coarse = network.coarse_depth(sweep, features, views.mask, valid)
    low, high = 1 / network.config.far, 1 / network.config.near
    inverse = low + coarse.place * (high - low)
    found = {
        "cost_volume": sweep.cost,
        "unet_in": unet_in,
        "unet_input_block1_out": regressor.unet.down[0](regressor.unet.stem(unet_in), valid),
        "unet_out": unet_out,
        "regressor_out": out,
        "regressor_residual_out": straight,
        "depth_logits": logits,
        "depth_prob": jax.nn.softmax(logits, axis=-1),
        "dpt_residual": network.depth_residual(network.depth_upsampler(features, inverse))[..., None],
    }
    found = {name: _channels_first(x) for name, x in found.items()}
    found |= {"inv_depth_coarse": inverse, "match_prob_quarter": coarse.certainty}
    return found | _gaussian_stages(network, views, features, coarse, span)


def _gaussian_stages(network, views, features, coarse, span) -> dict[str, jax.Array]:
    place = network.fine_place(coarse, features)
    depth = 1 / span.inverse_depth(place)
    upsampled = network.feature_upsampler(features)
    raw = network.raw_gaussians(views.rgb, place, coarse, features)
    certainty = repeat(coarse.certainty[..., None], 4)
    hidden = network.gaussian_head.hidden(views.rgb, depth[..., None], certainty, upsampled)
    predicted = network(views, jnp.ones(3, bool))
    maps = {"features_full": upsampled, "gaussian_regressor_out": hidden, "gaussian_raw": raw}
    found = {name: _channels_first(x) for name, x in maps.items()}
    gaussians = jax.tree.map(lambda leaf: leaf.reshape(3, SIZE, SIZE, *leaf.shape[1:]), predicted.gaussians)
    return found | {
        "depth": predicted.depth,
        "opacity": gaussians.opacity,
        "mean": gaussians.mean,
        "scale_thesis": bounded_scale(raw[..., 3:6], jnp.ones(()), network.config),
        "scale": gaussians.scale,
        "quaternion": gaussians.quaternion,
        "sh_dc": gaussians.sh[..., 0, :],
    }


def relative_errors(found: dict[str, jax.Array], path: Path) -> dict[str, float]:
    """‖ours - stored‖/‖stored‖ of every stored tensor that `found` has, thinned as its name says."""
    errors = {}
    with np.load(path) as stored:
        for name, expected in stored.items():
            stage, _, step = name.partition("__s")
            if stage in found:
                ours = np.asarray(found[stage])
                if step:
                    at = slice(None, None, int(step))
                    ours = ours[:, :, at, at] if ours.shape[1] == expected.shape[1] else ours[:, at, at]
                errors[name] = float(np.linalg.norm(ours - expected) / np.linalg.norm(expected))
    return errors
