"""Bring your own cameras: a calibration of another tool and a folder of videos or images become a capture."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from aerojax.capture.codecs.mask import MaskKind
from aerojax.capture.imports.calibration.auto import AutoCalibrationConfig
from aerojax.capture.imports.calibration.base import CalibrationConfig
from aerojax.capture.imports.calibration.ros import extract_images, is_bag
from aerojax.capture.imports.cameras import CameraImport, WorldConfig, import_cameras
from aerojax.capture.imports.media import Place
from aerojax.core.errors import UserError
from aerojax.core.files import write_json, write_text
from aerojax.geometry.geodesy import GeographicOrigin
from aerojax.pipeline.rig_check import check_rig
from aerojax.segment.auto import AutoConfig
from aerojax.segment.base import SegmenterConfig
from aerojax.view.rig import rig_picture
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """What to import, and where it goes.

    source: the calibration, a file or folder; a bag of ROS holds the images too.
    calibration: its format; auto recognises it.
    images: folder with a video or a folder of images for each camera, by the cameras' names; that of source if None.
    masks: folder with a folder of masks for each camera; those beside the images, if any, if None.
    out: becomes the capture; the images' own folder writes capture.json beside them and copies nothing.
    fps: frames a second; the videos' or the calibration's if None.
    frames: of the capture; all if None.
    place: how images come into the capture; link and absolute leave them where they are.
    world: where the calibration's world lies.
    mask_kind: what the masks hold, ids or picture; None judges by how they look.
    origin: latitude and longitude (degrees) and height (metres) of the world's origin, WGS 84; its axes are then +X
        east, +Y north, +Z up; empty if unknown.
    segment: how the object is found whose rays check the cameras.
    check: whether to check the cameras.
    """

    preset: str
    source: Path = field(metadata={"given": True})
    calibration: CalibrationConfig = field(default_factory=AutoCalibrationConfig)
    images: Path | None = None
    masks: Path | None = None
    out: Path
    fps: float | None = None
    frames: int | None = None
    place: Place = "auto"
    world: WorldConfig = field(default_factory=WorldConfig)
    mask_kind: MaskKind | None = None
    origin: tuple[float, ...] = ()
    segment: SegmenterConfig = field(default_factory=AutoConfig)
    check: bool = True


def _origin(config: Config) -> GeographicOrigin | None:
    if len(config.origin) not in (0, 3):
        raise UserError("invalid", f"origin={list(config.origin)}", "give latitude, longitude and height, or nothing")
    return GeographicOrigin(*config.origin) if config.origin else None


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Calibration and images in; capture.json and rig.svg out."""
    settings = CameraImport(config.fps, config.frames, config.place, config.world, config.mask_kind, _origin(config))
    calibration = config.calibration.read(config.source)
    images = config.images or (config.source if config.source.is_dir() else config.source.parent)
    with tempfile.TemporaryDirectory() as spare, progress_bar() as bar:
        task = bar.add_task("cameras", total=len(calibration.cameras))
        if config.images is None and is_bag(config.source):
            extract_images(config.source, images := Path(spare), config.fps or 30.0)
        made = import_cameras(
            calibration,
            images,
            config.out,
            settings,
            masks=config.masks,
            progress=lambda done, total, what: bar.update(task, completed=done, description=what),
        )
    capture = made.capture
    checked = check_rig(capture, config.segment) if config.check else None
    picture = rig_picture(capture.cameras, None if checked is None else checked.positions, config.out.name)
    write_text(config.out / "rig.svg", picture)
    notes = [*made.notes, *capture.warnings, *([] if checked is None else [checked.sentence()])]
    content = {"capture": str(config.out), "frames": capture.frames, "fps": capture.fps, "notes": notes}
    agreement = None if checked is None else {"agrees": checked.agrees, "offset_px": checked.offset_px}
    write_json(run.directory / "metrics.json", {**content, "cameras": len(capture.cameras), "check": agreement})
    console = Console()
    for note in notes:
        console.print(escape(note), soft_wrap=True)
    console.print(f"{config.out}: {capture.frames} frames of {len(capture.cameras)} cameras", soft_wrap=True)
    console.print(f"{config.out / 'rig.svg'}", soft_wrap=True)


if __name__ == "__main__":
    main()
