"""Calibrate a camera network from videos of a board that is carried through the scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

from aerojax.capture.calibrate.board import Board, BoardConfig
from aerojax.capture.calibrate.network import LensKind, calibrate_network
from aerojax.capture.calibrate.recording import as_capture_cameras, calibration_document, look_for_board
from aerojax.core.files import write_json, write_text
from aerojax.view.rig import rig_picture
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """The recording, the board, and where the world is.

    videos: folder with a video or a folder of images for each camera, named by the camera, that began together.
    board: that is carried through the scene.
    step: frames between those that are looked at.
    lens: distortion to look for; none, radial (k1, k2) or full (k1, k2, p1, p2, k3).
    ground_frame: a frame in which the board lies on the ground, face up, which becomes z = 0; None makes the first
        camera level and the origin.
    """

    preset: str
    videos: Path = field(metadata={"given": True})
    board: BoardConfig = field(default_factory=BoardConfig)
    step: int = 10
    lens: LensKind = "radial"
    ground_frame: int | None = None


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Videos in; calibration.json, which `import_cameras` reads, and rig.svg out."""
    board = Board(config.board)
    with progress_bar() as bar:
        task = bar.add_task("board", total=None)

        def show(done: int, total: int, what: str) -> None:
            bar.update(task, completed=done, total=total, description=what)

        views = look_for_board(config.videos, board, config.step, progress=show)
        network = calibrate_network(views, board, config.lens, config.ground_frame, progress=show)
    path = run.directory / "calibration.json"
    write_json(path, calibration_document(views, network))
    write_text(run.directory / "rig.svg", rig_picture(as_capture_cameras(views, network), title="calibrated network"))
    seen = {camera.name: len(camera.seen) for camera in views}
    lens_px = dict(zip(network.names, network.lens_px, strict=True))
    write_json(run.directory / "metrics.json", {"network_px": network.network_px, "lens_px": lens_px, "views": seen})
    table = Table("camera", "views of the board", "lens off by, px")
    for name, error in lens_px.items():
        table.add_row(name, str(seen[name]), f"{error:.2f}")
    console = Console()
    console.print(table)
    console.print(f"poses off by {network.network_px:.2f} px\n{path}\n{run.directory / 'rig.svg'}", soft_wrap=True)
    console.print(f"next: import_cameras source={path} images=FOLDER out=CAPTURE", soft_wrap=True, markup=False)


if __name__ == "__main__":
    main()
