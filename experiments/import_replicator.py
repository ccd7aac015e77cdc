"""Import a multi-camera recording of Isaac Replicator as a capture."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from aerojax.capture.imports.replicator import ReplicatorImport, import_replicator
from aerojax.capture.imports.replicator_camera import UpAxis
from aerojax.core.files import write_json
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """The recording, what it does not say, and where the capture goes.

    recording: the folder that holds a folder a render product. out: must not exist.
    fps: frames a second, which the format does not hold.
    classes: class of a label or prim path, None to ignore it. up: the stage's axis.
    """

    preset: str
    recording: Path
    out: Path
    fps: float
    classes: dict[str, str | None] = field(default_factory=dict)
    up: UpAxis = "z"


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Recording in, capture out."""
    settings = ReplicatorImport(config.fps, config.classes, config.up)
    with progress_bar() as bar:
        task = bar.add_task("frames", total=None)
        capture = import_replicator(
            config.recording,
            config.out,
            settings,
            progress=lambda done, total, what: bar.update(task, completed=done, total=total),
        )
    objects = {} if capture.truth is None else {o.identity: o.class_name for o in capture.truth.objects}
    content = {"frames": capture.frames, "cameras": len(capture.cameras), "objects": objects}
    write_json(run.directory / "metrics.json", {"capture": str(config.out), **content})
    Console().print(f"{config.out}: {capture.frames} frames of {len(capture.cameras)} cameras, objects {objects}")


if __name__ == "__main__":
    main()
