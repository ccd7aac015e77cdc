"""From the logits of clips to the label of a video: windows, votes and streams."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from aerojax.classify.mambasplat.model import MambaSplat, StreamState
from aerojax.core.errors import UserError


def window_starts(frames: int, length: int, stride: int, *, dilation: int = 1, cover: bool = True) -> list[int]:
    """First frames of the clips of a video.

    Args:
        frames: frames of the video.
        length: frames of a clip.
        stride: frames between the starts of two clips.
        dilation: frames between two frames of a clip.
        cover: adds one clip at the very end where the stride would leave frames unseen.

    Returns:
        Starts in order; [0] for a video shorter than a clip (pad and mask it).

    Raises:
        UserError: if a size is below one.
    """
    for name, value in (("frames", frames), ("length", length), ("stride", stride), ("dilation", dilation)):
        if value < 1:
            raise UserError("invalid", f"{name} is {value}", "it must be at least 1")
    last = frames - (length - 1) * dilation - 1
    if last < 0:
        return [0]
    starts = list(range(0, last + 1, stride))
    return [*starts, last] if cover and starts[-1] != last else starts


def video_vote(
    logits: Float[Array, "clip label"], video: Int[Array, "clip"], videos: int
) -> Float[Array, "{videos} label"]:
    """Class probabilities of each video: its clips' softmax, averaged.

    Args:
        logits: one row a clip.
        video: index of each clip's video.
        videos: how many there are; one without clips gets zeros.

    Returns:
        Rows that sum to one. `argmax` gives the label; an exact tie goes to the lowest class.
    """
    total = jax.ops.segment_sum(jax.nn.softmax(logits), video, num_segments=videos)
    return total / jnp.maximum(total.sum(axis=1, keepdims=True), 1e-12)


def classify_video(
    model: MambaSplat,
    columns: Float[Array, "frame token 14"],
    mask: Bool[Array, "frame token"],
    *,
    length: int,
    stride: int,
) -> Float[Array, "label"]:
    """Class probabilities of one video of any length, by voting over clips that reach its last frame.

    Args:
        model: either variant; `columns` as its call wants them.
        columns: all frames of the video.
        mask: valid tokens.
        length: frames of a clip; a shorter video is padded with empty frames.
        stride: frames between the starts of two clips.
    """
    missing = max(0, length - columns.shape[0])
    columns = jnp.pad(columns, ((0, missing), (0, 0), (0, 0)))
    mask = jnp.pad(mask, ((0, missing), (0, 0)))
    starts = np.array(window_starts(columns.shape[0], length, stride))
    index = starts[:, None] + np.arange(length)
    logits = _clip_logits(model, columns[index], mask[index])
    return video_vote(logits, jnp.zeros(len(starts), jnp.int32), 1)[0]


@jax.jit
def _clip_logits(
    model: MambaSplat, columns: Float[Array, "clip time token 14"], mask: Bool[Array, "clip time token"]
) -> Float[Array, "clip label"]:
    return jax.lax.map(lambda clip: model(*clip), (columns, mask))


def classify_next(
    model: MambaSplat,
    state: StreamState,
    columns: Float[Array, "token 14"],
    mask: Bool[Array, "token"],
) -> tuple[Float[Array, "label"], StreamState]:
    """Logits of a stream after one more frame, in time and memory that do not grow.

    Equals the model's call on all frames so far if each frame has been normalised by itself: the exact variant needs
    `scale_normalisation` frame or none, because a clip's radius depends on frames to come.

    Raises:
        UserError: if the model normalises whole clips, compares frames or numbers them.
    """
    if (how := model.config.scale_normalisation) not in ("frame", "none"):
        raise UserError(
            "out-of-range", f"scale_normalisation is {how!r} in MambaSplatConfig", "a stream needs 'frame' or 'none'"
        )
    if model.config.motion_features:
        raise UserError(
            "out-of-range",
            "motion_features is True in MambaSplatConfig",
            "a stream's frames come one by one: use False",
        )
    if model.config.positional_encoding:
        raise UserError(
            "out-of-range", "positional_encoding is True in MambaSplatConfig", "a stream has no last frame: use False"
        )
    features, valid = model.frame_features(columns[None], mask[None])
    return model.step(features[0], valid[0], state)
