"""Measure whether colours alone tell the class: identities seen in training against those of the test split."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from rich.console import Console

from aerojax.core.files import write_json
from aerojax.core.seeds import seed_of
from aerojax.core.types import CLASSES
from aerojax.evaluate.dataset_qa.colour_leak import CLASSIFIERS, colour_statistics, measure_leak
from aerojax.simulate.assets.catalogue import Identity, build_identity, identities
from aerojax.simulate.render.asset_image import AssetRenderer, srgb_bytes
from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar
from kernels.rays.raytrace import Lighting

LIGHTS = ("albedo", "lit")
"""Even light from everywhere, so that pixels show the paint alone; and sun, sky and ground."""


@dataclass(frozen=True, kw_only=True)
class Config:
    """One measurement.

    assets: USD stages of the identities.
    width, height: of a view, pixels. views: of each individual.
    per_family: individuals of each family. per_class: of each class instead, if not null.
    permutations: draws of chance that the answer is compared with.
    """

    preset: str
    seed: int = 0
    assets: Path = Path("data/assets")
    width: int = 120
    height: int = 90
    per_family: int = 1
    per_class: int | None = None
    views: int = 6
    permutations: int = 500


def light_of(kind: str, rng: np.random.Generator) -> Lighting:
    """A light that does not depend on the class."""
    if kind == "albedo":
        return Lighting(sun=0.0, sky=1.0, ground=1.0)
    x, y, z, sun, sky, ground = (
        float(v) for v in (*rng.normal(size=2), rng.uniform(0.5, 3.0), *rng.uniform(0.2, 0.6, 3))
    )
    return Lighting((x, y, z), sun=sun, sky=sky, ground=ground)


def statistics_of(identity: Identity, config: Config) -> dict[str, Float[np.ndarray, "view 33"]]:
    """Colour statistics of an identity's pixels, by light, in views that its name and the seed draw."""
    renderer = AssetRenderer(mesh := load_animated_mesh(build_identity(identity, config.assets)))
    rng = np.random.default_rng(seed_of("colour leak", config.seed, identity.name))
    found: dict[str, list[np.ndarray]] = {light: [] for light in LIGHTS}
    for _ in range(config.views):
        seconds, azimuth = rng.uniform(0, max(mesh.cycle_seconds, 0.1)), rng.uniform(0, 360)
        elevation = rng.uniform(-60, 60)
        for light in LIGHTS:
            seen = renderer.image(
                seconds, azimuth, elevation, width=config.width, height=config.height, lighting=light_of(light, rng)
            )
            pixels = srgb_bytes(seen.linear)[seen.coverage > 0.5] / 255.0
            found[light].append(colour_statistics(pixels))
    return {light: np.stack(rows) for light, rows in found.items()}


def measure(config: Config) -> dict[str, Any]:
    """Accuracy on test identities against chance, by light and classifier."""
    members = {split: identities(split, config.per_class, per_family=config.per_family) for split in ("train", "test")}
    features: dict[str, dict[str, np.ndarray]] = {}
    with progress_bar() as bar:
        task = bar.add_task("identities", total=sum(map(len, members.values())))
        for split, everyone in members.items():
            rows = []
            for identity in everyone:
                rows.append(statistics_of(identity, config))
                bar.advance(task)
            features[split] = {light: np.concatenate([r[light] for r in rows]) for light in LIGHTS}
    labels = {s: np.repeat([CLASSES.index(i.label) for i in m], config.views) for s, m in members.items()}
    individual = np.repeat(np.arange(len(members["train"])), config.views)
    majority = np.bincount(labels["test"]).max() / len(labels["test"])
    results: dict[str, Any] = {"identities": {s: len(m) for s, m in members.items()}, "views": config.views}
    results |= {"majority_accuracy": float(majority), "chance_of_balanced_accuracy": 1 / len(CLASSES)}
    for light in LIGHTS:
        train, test = (features["train"][light], labels["train"], individual), (features["test"][light], labels["test"])
        for name, classify in CLASSIFIERS.items():
            leak = measure_leak(classify, train, test, permutations=config.permutations, seed=config.seed)
            results[f"{light}_{name}"] = dataclasses.asdict(leak)
    return results


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print one line a classifier."""
    results = measure(config)
    write_json(run.directory / "results.json", {**results, "seed": config.seed, **run.origin})
    for name, leak in results.items():
        if isinstance(leak, dict) and "balanced" in leak:
            low, high = leak["interval"]
            Console().print(f"{name}: balanced {leak['balanced']:.1%}, by chance {low:.1%} to {high:.1%}")
    Console().print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
