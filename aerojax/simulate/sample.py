"""The capture that acts use where none is given: one identity that training never saw, simulated once."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from aerojax.capture.format import Capture
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.simulate.assets.catalogue import Identity, identities, outliers
from aerojax.simulate.plan.planner import SequenceConfig, plan_sample
from aerojax.simulate.record import record_scene
from aerojax.simulate.world.random_rigs import RandomRigConfig

_NEAR = RandomRigConfig(span_px=(90.0, 90.0), distance=(12.0, 12.0))


@dataclass(frozen=True)
class SampleConfig:
    """The capture that is simulated where none is given.

    label, seed: class, or kind of outlier such as ball or box, and which of its test identities flies how.
    folder: of all samples; each has one of its own in it.
    sequence: cameras, length and images.
    """

    label: str = "drone"
    seed: int = 3
    folder: Path = Path("data/samples")
    sequence: SequenceConfig = field(default_factory=lambda: SequenceConfig(rigs=(_NEAR,)))


def sample_capture(config: SampleConfig, assets: Path) -> Path:
    """The folder of a capture of an identity that training never saw; it is made if it is not there.

    Args:
        config: which one.
        assets: folder of identity stages, shared by sequences.

    Raises:
        UserError: `label` is no class and no kind of outlier.
    """
    held_out = [i for i in (*identities("test", 3), *outliers("test", 3)) if i.moves_like == config.label]
    if not held_out:
        known = (*CLASSES, *(i.family for i in outliers("test")))
        raise UserError("out-of-range", f"sample.label={config.label} is no class", f"choose one of {', '.join(known)}")
    identity = held_out[config.seed % len(held_out)]
    folder = config.folder / f"{identity.name}_seed{config.seed}_{config.sequence.frames}frames"
    if not (folder / "capture.json").exists():
        simulate_sequence(identity, config.sequence, seed=config.seed, folder=folder, assets=assets)
    return folder


def simulate_sequence(identity: Identity, config: SequenceConfig, *, seed: int, folder: Path, assets: Path) -> Capture:
    """Fly one identity past a rig and write the capture.

    Args:
        identity: what flies; its stage is built in `assets` if it is not there.
        config: rig, motion and images.
        seed: decides everything; the same seed gives the same bytes.
        folder: becomes the capture; `scene.usda` in it is the sequence's stage.
        assets: folder of identity stages, shared by sequences.
    """
    return record_scene(plan_sample(identity, config, seed=seed, assets=assets), folder)[0]
