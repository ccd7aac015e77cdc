"""Every act that goes on where it was stopped, at its smallest, as a command."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping
from pathlib import Path

from aerojax.evaluate.kills.processes import run_command
from aerojax.evaluate.kills.trials import KillTarget

ROOT = Path(__file__).resolve().parents[2]
SEQUENCES = (
    *("preset=smoke", "rig=sim1", "classes=[bird,drone]", "sequences.train=0", "frames=2", "images.samples=2"),
    *("rig.fixed.width=640", "rig.fixed.height=360", "rig.fixed.focal_px=1400.0", "workers=2"),
)
FACTORY = ("preset=smoke", "rigs.kinds=[sphere]", "rigs.cameras=[3,4]", "rigs.width_px=[20,40]", "workers=2")
TRAINING = ("preset=smoke", "tests=[]", "also_test=[]", "training.epochs=4", "training.checkpoint_steps=1")
SCENES = ("preset=smoke", "objects=8", "workers=2")
RECONSTRUCTOR = (
    *("preset=smoke", "reconstruct=lgm", "training.epochs=2", "training.checkpoint_steps=1"),
    *("model.size=16", "model.down=[16,16]", "model.up=[16]"),
    *("model.attends_down=[false,true]", "model.attends_up=[false]"),
)
TINY = tuple(f"model.{name}" for name in ("token_features=8", "token_invariants=8", "channels=4", "heads=2"))
GROWING = ("*history.jsonl", "*checkpoints/*", "*events.out*")
IGNORED = ("*checkpoints/*", "*weights.md")
"""What training keeps for itself, and pages that state minutes in a sentence."""
ON_NOTHING = frozenset({"generate_dataset", "generate_clips"})
"""Acts that work on nothing."""
ON_SCENES = "train_reconstructor"
ON_CLIPS = ("train_classifier", "compare_classifiers")
"""How the names of acts that work on clips begin."""
ACTS = (
    *("generate_dataset", "reconstruct_dataset", "generate_clips", "train_classifier classify=views"),
    *("train_classifier classify=mambasplat", ON_SCENES, "fit_gaussians", "export_dataset"),
    "compare_classifiers -m",
)
FORMATS = "[coco,yolo,mot,colmap,nerfstudio,replicator]"


def act(name: str, *overrides: str, out: Path) -> tuple[str, ...]:
    """The command line of an act whose run's directory is `out`/run."""
    return (sys.executable, "-m", f"experiments.{name}", *overrides, f"hydra.run.dir={out}/run")


def make_inputs(folder: Path, environment: Mapping[str, str], acts: Collection[str]) -> None:
    """What these acts work on: two sequences, clips of every split, scenes of two.

    Raises:
        RuntimeError: one of the acts that make them fails.
    """
    commands = []
    if not ON_NOTHING.issuperset(acts):
        commands.append(act("generate_dataset", *SEQUENCES, f"folder={folder}/data", out=folder / "sequences"))
    if any(name.startswith(ON_CLIPS) for name in acts):
        for split in ("train", "val", "test"):
            where = (f"folder={folder}/clips", f"split={split}")
            commands.append(act("generate_clips", *FACTORY, *where, out=folder / f"factory_{split}"))
    if ON_SCENES in acts:
        for split in ("train", "val"):
            where = (f"folder={folder}/views", f"split={split}")
            commands.append(act("generate_views", *SCENES, *where, out=folder / f"views_{split}"))
    for command in commands:
        ended = run_command(command, folder=ROOT, environment=environment)
        if ended.code != 0:
            raise RuntimeError(f"{' '.join(command)} failed: {ended.said}")


def targets(inputs: Path) -> dict[str, KillTarget]:
    """The acts by name, as in `ACTS`; `inputs` is what `make_inputs` made."""
    clips = (f"clips=[{inputs}/clips/sphere]",)
    capture = min((path.parent for path in inputs.glob("data/test/*/capture.json")), default=inputs)

    def training(*overrides: str) -> KillTarget:
        return KillTarget(
            lambda out: act("train_classifier", *TRAINING, *clips, *overrides, out=out),
            growing=GROWING,
            ignoring=IGNORED,
        )

    made = (
        KillTarget(lambda out: act("generate_dataset", *SEQUENCES, f"folder={out}/data", out=out)),
        KillTarget(
            lambda out: act(
                "reconstruct_dataset",
                *("preset=smoke", "workers=2", f"datasets=[{inputs}/data]", f"folder={out}/clips"),
                out=out,
            ),
        ),
        KillTarget(lambda out: act("generate_clips", *FACTORY, f"folder={out}/clips", out=out)),
        training(),
        training("classify=mambasplat", "variation.tokens=16", *TINY),
        KillTarget(
            lambda out: act("train_reconstructor", *RECONSTRUCTOR, f"views=[{inputs}/views]", out=out),
            growing=GROWING,
            ignoring=IGNORED,
        ),
        KillTarget(
            lambda out: act("fit_gaussians", "preset=smoke", f"capture={capture}", out=out),
        ),
        KillTarget(
            lambda out: act(
                "export_dataset",
                *("preset=smoke", "workers=2", f"dataset={inputs}/data", f"format={FORMATS}", f"out={out}/export"),
                out=out,
            ),
        ),
        KillTarget(
            lambda out: (
                *(sys.executable, "-m", "experiments.compare_classifiers", "-m", *TRAINING, *clips, *TINY),
                *("classifier=E_C,E_X", "seed=0", "variation.tokens=16", f"test.rotations={out}/rotations"),
                f"hydra.sweep.dir={out}/sweep",
            ),
            growing=(*GROWING, "*table.json"),
            ignoring=(*IGNORED, "*table.md"),
        ),
    )
    return dict(zip(ACTS, made, strict=True))
