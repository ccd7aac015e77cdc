"""The Gaussians of a clip in the world's frame: a PLY file a frame, or one USD stage with time samples."""

from __future__ import annotations

from pathlib import Path

import jax
import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import Capture
from aerojax.core.types import Gaussians
from aerojax.gaussians.io.placement import place
from aerojax.gaussians.io.ply import write_ply
from aerojax.gaussians.io.usd import write_usd
from aerojax.pipeline.offline import Clip


def export_ply(clip: Clip, folder: Path) -> Path:
    """`frame_000012.ply` for each frame that was used, in the 3D-Gaussian-splatting layout."""
    folder.mkdir(parents=True, exist_ok=True)
    frames, origin = _in_world(clip)
    for number, gaussians in zip(clip.frames, frames, strict=True):
        write_ply(folder / f"frame_{number:06d}.ply", gaussians, origin=origin)
    return folder


def export_usd(capture: Capture, clip: Clip, path: Path) -> Path:
    """One prim of splats whose time codes are the capture's frame numbers."""
    frames, origin = _in_world(clip)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_usd(path, frames, frames_per_second=capture.fps, origin=origin, time_codes=clip.frames)
    return path


def _in_world(clip: Clip) -> tuple[list[Gaussians], Float64[np.ndarray, "3"]]:
    """One set a frame, about an origin that is zero unless they lie far from the world's."""
    placed, origin = place(clip.gaussians, clip.world_from_rig)
    count = len(clip.frames)
    host = jax.tree.map(np.asarray, placed)
    return [jax.tree.map(lambda leaf, i=i: jax.numpy.asarray(leaf[i]), host) for i in range(count)], origin
