"""Optimise Gaussians on one frame of a capture and measure them from a camera that the optimisation never saw."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console

from aerojax.capture.format import read_capture
from aerojax.core.errors import UserError, failure
from aerojax.core.files import write_bytes, write_json
from aerojax.evaluate.images import image_figures
from aerojax.gaussians.io.placement import place
from aerojax.gaussians.io.ply import write_ply
from aerojax.gaussians.io.usd import write_usd
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import observe_frame
from aerojax.reconstruct.fit.held_out import held_out_medians, render_beside_views, split_views
from aerojax.reconstruct.fit.matte import matted_views
from aerojax.reconstruct.fit.optimise import GaussianFitConfig, fit_gaussians
from aerojax.reconstruct.fit.start import only_real
from aerojax.simulate.sample import SampleConfig, sample_capture
from experiments._launch.batches import end_batch, result_folders
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """One fit.

    capture: folder; a held-out identity is simulated where none is given.
    captures: folders, fitted one after the other instead of `capture`.
    frame: index in the capture.
    object: instance id in the masks; the largest one if None.
    assets: where the simulated identity's stage lies. sample: which identity is simulated.
    pipeline: what finds the object and makes the first Gaussians. fit: how they are optimised.
    seed: of the fit's random backgrounds, views and cameras.
    held_out: position, among the cameras that see the whole object, of the one kept for measuring.
    """

    preset: str
    capture: Path | None = field(default=None, metadata={"given": True})
    captures: tuple[Path, ...] = ()
    frame: int = 0
    object: int | None = None
    held_out: int = -1
    assets: Path = Path("data/assets")
    sample: SampleConfig = field(default_factory=SampleConfig)
    seed: int = 0
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    fit: GaussianFitConfig = field(default_factory=GaussianFitConfig)


def fit_capture(config: Config, folder: Path, directory: Path) -> dict[str, Any]:
    """Fit one capture; metrics.json, fitted.ply, fitted.usdc (world frame) and pictures go to `directory`."""
    capture = read_capture(folder)
    seen = observe_frame(capture, config.frame, config.pipeline, object_id=config.object)
    fitting, held_out = split_views(seen.views, seen.valid, config.held_out)
    hull = only_real(config.pipeline.reconstruct.build(), fitting)
    matted = matted_views(capture, seen)
    matted_fitting, _ = split_views(matted, seen.valid, config.held_out)
    began = time.perf_counter()
    with progress_bar() as bar:
        task = bar.add_task("fit", total=config.fit.steps)

        def report(done: int, loss: float) -> None:
            bar.update(task, completed=done, description=f"loss {loss:.4f}")

        fitted = fit_gaussians(hull, matted_fitting, config=config.fit, key=jax.random.key(config.seed), report=report)
    results: dict[str, Any] = {"capture": capture.folder.name, "frame": config.frame, "gaussians": len(fitted.mean)}
    results |= {"fitting_views": len(fitting.mask), "held_out_views": 1, "crop_px": config.pipeline.crop_size}
    matte = "coverage" if all(c.coverage for c in capture.cameras) else "estimated"
    results |= {"steps": config.fit.steps, "seconds": time.perf_counter() - began, "matte": matte, "seed": config.seed}
    directory.mkdir(parents=True, exist_ok=True)
    for name, gaussians in (("hull", hull), ("fitted", fitted)):
        for where, views in (("fitting_views", fitting), ("held_out_view", held_out)):
            rendered, target = render_beside_views(gaussians, views, antialias=config.fit.antialias)
            results[f"{name}_{where}"] = image_figures(rendered, target, views.mask)
            rows = [np.concatenate(list(x), axis=1) for x in (target, jnp.clip(rendered, 0, 1))]
            bgr = np.round(255 * np.concatenate(rows)[..., ::-1]).astype(np.uint8)
            write_bytes(directory / f"{name}_{where}.png", cv2.imencode(".png", bgr)[1].tobytes())
    placed, origin = place(fitted, seen.world_from_crop)
    write_ply(directory / "fitted.ply", placed, origin=origin)
    write_usd(directory / "fitted.usdc", [placed], origin=origin)
    write_json(directory / "metrics.json", results)
    return results


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Captures in; per capture a folder with metrics and Gaussians, and summary.json, out. Code 1 if one failed."""
    console, summary, failed = Console(), [], []
    if not config.captures:
        folder = config.capture or sample_capture(config.sample, config.assets)
        summary = [fit_capture(config, folder, run.directory)]
    for folder, name in zip(config.captures, result_folders(config.captures), strict=True):
        try:
            summary.append({**fit_capture(config, folder, run.directory / name), "results": name})
        except (UserError, OSError) as error:
            failed.append({"capture": str(folder), **failure(error)})
        whole = {"fits": summary, "failed": failed, **held_out_medians(summary), **run.origin}
        write_json(run.directory / "summary.json", whole)
    for one in summary:
        before, after = (one[f"{name}_held_out_view"]["foreground_psnr_db"] for name in ("hull", "fitted"))
        console.print(f"{one['capture']}: held-out view {after:.2f} dB on the object (hull {before:.2f} dB)")
    failures = [f"{one['capture']}: not fitted: {one['text']}" for one in failed]
    console.print("\n".join([str(run.directory), *failures]), soft_wrap=True, markup=False)
    end_batch(len(failed), len(summary), "were not fitted")


if __name__ == "__main__":
    main()
