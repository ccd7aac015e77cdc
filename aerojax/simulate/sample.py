"""The capture that `classify` uses where none is given."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.plan.single import SequenceConfig, simulate_sequence


@dataclass(frozen=True)
class SampleConfig:
    """The capture that is simulated where none is given: which test identity, by class and seed."""

    label: str
    seed: int
    folder: Path
    sequence: SequenceConfig


def sample_capture(config: SampleConfig, assets: Path) -> Path:
    """A capture of an identity that training never saw, made once."""
    held_out = [i for i in identities("test", 3) if i.label == config.label]
    if not held_out:
        raise UserError(
            "out-of-range", f"sample.label={config.label} is no class", f"choose one of {', '.join(CLASSES)}"
        )
    identity = held_out[config.seed % len(held_out)]
    folder = config.folder / f"{identity.name}_seed{config.seed}_{config.sequence.frames}frames"
    if not (folder / "capture.json").exists():
        simulate_sequence(identity, config.sequence, seed=config.seed, folder=folder, assets=assets)
    return folder
