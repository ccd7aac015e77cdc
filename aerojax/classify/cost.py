"""Operations of one forward pass, counted as the thesis counts them."""

from __future__ import annotations

import math

from aerojax.classify.config import MambaSplatConfig, uses_colour, uses_opacity, uses_shape
from aerojax.classify.encoder import FEED_FORWARD_FACTOR
from aerojax.errors import UserError


def published_operations(config: MambaSplatConfig, frames: int, tokens: int) -> int:
    """Floating-point operations of one clip: two for each multiply-add of a matrix product.

    This is what PyTorch's counter sees of the released modules with the reference scan: matrix products, the depthwise
    convolution with the outputs of its padding, and the read-out C·s of the scan's state; not norms, activations,
    softmax or the recurrence. A lift of one vector multiplies without a sum and is therefore not seen.

    Args:
        config: the published variant with its VN-In bridge and Mamba layers.
        frames: frames of the clip.
        tokens: Gaussians of a frame.

    Raises:
        UserError: for another variant, bridge or temporal model, which this formula does not describe.
    """
    if (config.variant, config.bridge, config.temporal) != ("published", "vn_in", "mamba"):
        raise UserError("operations are counted for variant 'published', bridge 'vn_in' and temporal 'mamba' only")
    c, d, attended = config.channels, config.d_model, config.heads * config.head_dim
    wide, slots = FEED_FORWARD_FACTOR * c, 3 + uses_opacity(config.mode) + 3 * uses_colour(config.mode)
    lift = tokens * 4 * c * 3 if uses_shape(config.mode) else 0
    block = tokens * (4 * c * attended + 2 * c * wide + 2 * wide * wide) * slots + 2 * tokens**2 * attended * slots
    frame_mlp = 2 * c * c + 2 * c * c + c * c + 2 * c * c + 3 * c
    bridge = 3 * frame_mlp + 9 * c + c * slots * d
    inner, rank = config.expand * d, math.ceil(d / 16)
    layer = d * 2 * inner + inner * (rank + 2 * config.d_state) + rank * inner + inner * d
    convolution = (frames + config.d_conv - 1) * inner * config.d_conv
    scan = frames * inner * config.d_state
    frame = lift + config.depth * block + c * c * slots + bridge + config.mamba_layers * layer
    clip = frames * frame + config.mamba_layers * (convolution + scan)
    return 2 * (clip + d * d // 2 + d // 2 * config.classes)
