"""Optimise Gaussians on one frame of a capture and measure them from a camera that the optimisation never saw."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console

from aerojax.capture.format import read_capture
from aerojax.errors import UserError
from aerojax.gaussians.ply import write_ply
from aerojax.gaussians.rotate import transform
from aerojax.gaussians.usd import write_usd
from aerojax.pipeline import FrameImages, PipelineConfig, frame_images
from aerojax.reconstruct.fit import GaussianFitConfig, draw_views, fit_gaussians
from aerojax.reconstruct.hull import hull_gaussians
from aerojax.reconstruct.photometric import (
    backdrop_colour,
    certain_pixels,
    foreground_psnr,
    over_backdrop,
    structural_similarity,
)
from aerojax.types import Gaussians, View
from experiments.launch import Run, experiment, write_json
from experiments.progress import progress_bar
from experiments.sample import SampleConfig, sample_capture


@dataclass(frozen=True)
class Config:
    """One fit.

    capture: folder; a held-out identity is simulated where none is given.
    frame: index in the capture.
    object: instance id in the masks; the largest one if None.
    held_out: position, among the cameras that see the whole object, of the one kept for measuring.
    """

    preset: str
    capture: Path | None
    frame: int
    object: int | None
    held_out: int
    assets: Path
    sample: SampleConfig
    pipeline: PipelineConfig
    fit: GaussianFitConfig


def split_views(seen: FrameImages, held_out: int) -> tuple[View, View]:
    """Views for fitting, and the one for measuring."""
    index = np.flatnonzero(seen.valid)
    if not -len(index) <= held_out < len(index):
        raise UserError(f"held_out={held_out}: only {len(index)} cameras see the whole object")
    chosen = index[held_out]
    rest = index[index != chosen]
    return jax.tree.map(lambda x: x[rest], seen.views), jax.tree.map(lambda x: x[chosen : chosen + 1], seen.views)


def measure(gaussians: Gaussians, views: View, antialias: bool) -> tuple[dict[str, float], np.ndarray]:
    """PSNR on the object and inside its rim, and SSIM, over each view's backdrop; and truth above drawing."""
    backdrop = backdrop_colour(views.rgb, views.mask)
    drawn = draw_views(gaussians, views.camera, backdrop, antialias=antialias)
    target = over_backdrop(views.rgb, views.mask, backdrop)
    figures = {
        "foreground_psnr_db": float(foreground_psnr(drawn, target, views.mask)),
        "interior_psnr_db": float(foreground_psnr(drawn, target, views.mask * certain_pixels(views.mask))),
        "ssim": float(structural_similarity(drawn, target)),
    }
    return figures, np.concatenate([np.concatenate(list(x), axis=1) for x in (target, jnp.clip(drawn, 0, 1))])


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Capture in; metrics.json, fitted.ply, fitted.usdc (world frame) and a picture of the held-out view out."""
    capture = read_capture(config.capture or sample_capture(config.sample, config.assets))
    seen = frame_images(capture, config.frame, config.pipeline, object_id=config.object)
    fitting, held_out = split_views(seen, config.held_out)
    start = hull_gaussians(fitting, config=config.pipeline.hull)
    began = time.perf_counter()
    with progress_bar() as bar:
        task = bar.add_task("fit", total=config.fit.steps)

        def report(done: int, loss: float) -> None:
            bar.update(task, completed=done, description=f"loss {loss:.4f}")

        fitted = fit_gaussians(start, fitting, config=config.fit, report=report)
    seconds = time.perf_counter() - began
    results: dict[str, Any] = {"capture": str(capture.folder), "frame": config.frame, "gaussians": len(fitted.mean)}
    results |= {"fitting_views": len(fitting.mask), "steps": config.fit.steps, "seconds": seconds}
    for name, gaussians in (("hull", start), ("fitted", fitted)):
        for where, views in (("fitting_views", fitting), ("held_out_view", held_out)):
            figures, picture = measure(gaussians, views, config.fit.antialias)
            results[f"{name}_{where}"] = figures
            bgr = np.round(255 * picture[..., ::-1]).astype(np.uint8)
            cv2.imwrite(str(run.directory / f"{name}_{where}.png"), bgr)
    world_from_crop = jnp.asarray(capture.cameras[0].world_from_cam @ seen.rig_from_crop, jnp.float32)
    placed = transform(fitted, world_from_crop)
    write_ply(run.directory / "fitted.ply", placed)
    write_usd(run.directory / "fitted.usdc", [placed])
    write_json(run.directory / "metrics.json", results)
    before, after = (results[f"{name}_held_out_view"]["foreground_psnr_db"] for name in ("hull", "fitted"))
    console = Console()
    console.print(f"held-out view: {after:.2f} dB on the object (hull {before:.2f} dB), {seconds:.0f} s")
    console.print(str(run.directory / "metrics.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
