"""Draw the pictures of docs/how_it_works.md and docs/gallery.md: captures of the simulator, classified stage by stage.

    make pictures

Test identities fly as `make run` has them. The page's screenshot is taken where Chromium is installed.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, UInt8

import aerojax
from aerojax.capture.format import Capture
from aerojax.core.arrays import AnyArray
from aerojax.core.files import write_bytes, write_text
from aerojax.core.types import CLASSES, Camera, Gaussians, Observation
from aerojax.pipeline.offline import Clip
from aerojax.pipeline.results import result_of
from aerojax.simulate.sample import SampleConfig, sample_capture
from aerojax.view.report.gather import Answer, classification_report
from aerojax.view.report.page import write_report
from aerojax.view.rig import rig_picture
from aerojax.view.svg import curves
from aerojax.view.templates import read_template

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
ASSETS = ROOT / "data" / "assets"
SIDE = 220
"""Pixels of a tile."""
GAP = 6
FEW = 4
"""Frames of the gallery's captures."""
Tile = UInt8[np.ndarray, "height width 3"]


def sample(label: str, frames: int | None) -> Capture:
    """The capture of a test identity of a class; as long as `make run` has it if `frames` is None."""
    config = SampleConfig(label=label, folder=ROOT / "data" / "samples")
    if frames is not None:
        config = replace(config, sequence=replace(config.sequence, frames=frames))
    return aerojax.read_capture(sample_capture(config, ASSETS))


def classified(capture: Capture) -> Clip:
    """All that was seen of it, with the shipped weights."""
    return aerojax.reconstruct_capture(
        capture,
        aerojax.PipelineConfig(),
        aerojax.load_classifier(),
        key=jax.random.key(0),
        keep_observations=True,
    )


def side_by_side(tiles: Sequence[Tile]) -> Tile:
    """Tiles of one height in a row, white between them."""
    gap = np.full((tiles[0].shape[0], GAP, 3), 255, np.uint8)
    parts = [part for tile in tiles for part in (tile, gap)]
    return np.concatenate(parts[:-1], axis=1)


def stacked(rows: Sequence[Tile]) -> Tile:
    """Rows of one width, white between them."""
    gap = np.full((GAP, rows[0].shape[1], 3), 255, np.uint8)
    parts = [part for row in rows for part in (row, gap)]
    return np.concatenate(parts[:-1])


def as_bytes(rgb: Float[AnyArray, "height width 3"]) -> Tile:
    """0..1 to 0..255."""
    return np.round(255 * np.clip(np.asarray(rgb), 0, 1)).astype(np.uint8)


def fitted(tile: Tile, width: int, height: int) -> Tile:
    """Another size; pixels stay visible where it grows."""
    smaller = tile.shape[0] > height
    return cv2.resize(tile, (width, height), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_NEAREST)


def camera_images(capture: Capture, seen: Observation) -> list[Tile]:
    """What the cameras recorded, with the window that is cut out."""
    tiles = []
    for index, rgb in enumerate(aerojax.read_frames(capture, seen.frame).rgb):
        if rgb is None:
            continue
        tile = as_bytes(rgb)
        corners = np.round(seen.windows[index]).astype(np.int32)
        cv2.polylines(tile, [corners], True, (200, 55, 45), max(2, tile.shape[1] // 250), cv2.LINE_AA)
        small = fitted(tile, SIDE * tile.shape[1] // tile.shape[0], SIDE)
        tiles.append(cv2.copyMakeBorder(small, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(150, 150, 150)))
    return tiles


def crops(seen: Observation) -> list[Tile]:
    """The object in each camera, and its coverage below."""
    tiles = []
    for rgb, mask in zip(np.asarray(seen.views.rgb), np.asarray(seen.views.mask), strict=True):
        coverage = np.repeat(mask[..., None], 3, axis=-1)
        tiles.append(stacked([fitted(as_bytes(part), SIDE, SIDE) for part in (rgb, coverage)]))
    return tiles


def from_around(gaussians: Gaussians, yaws: Sequence[float]) -> list[Tile]:
    """Gaussians about their centre from some directions, a little from above."""
    centred = aerojax.transform(gaussians, jnp.eye(4).at[:3, 3].set(-gaussians.mean.mean(axis=0)))
    radius = float(jnp.linalg.norm(centred.mean, axis=-1).max())
    focal = SIDE / 2 / math.tan(math.radians(20))
    K = jnp.array([[focal, 0, SIDE / 2], [0, focal, SIDE / 2], [0, 0, 1]], jnp.float32)
    tiles = []
    for yaw in yaws:
        towards = np.array([math.cos(yaw) * 0.94, math.sin(yaw) * 0.94, 0.34])
        eye = jnp.asarray(aerojax.look_at(towards * radius / math.sin(math.radians(20)), np.zeros(3)), jnp.float32)
        drawn = aerojax.render(centred, Camera(K, eye, width=SIDE, height=SIDE), background=jnp.ones(3), antialias=True)
        tiles.append(as_bytes(np.asarray(drawn.colour)))
    return tiles


def write_jpeg(name: str, rgb: Tile) -> None:
    """A picture of the documentation."""
    done, encoded = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    assert done
    write_bytes(PICTURES / name, encoded.tobytes())
    print(PICTURES / name)


def write_answer(clip: Clip) -> None:
    """Probabilities over the frames, with the names of the classes."""
    assert clip.log_probabilities is not None
    so_far = np.exp(clip.log_probabilities)
    drawn = curves(
        "probability so far, over the frames",
        clip.frames,
        {name: so_far[:, i].tolist() for i, name in enumerate(CLASSES)},
        "probability so far",
    )
    names = "".join(
        f'<circle class="f{i}" cx="{70 + 120 * i}" cy="248" r="5"/><text x="{80 + 120 * i}" y="252">{name}</text>'
        for i, name in enumerate(CLASSES)
    )
    style = f"<style>{read_template('dataset/plot.css')}.now{{display:none}}</style>"
    head = '<svg xmlns="http://www.w3.org/2000/svg" class="plot" viewBox="0 0 640 262"><rect width="640" height="262" '
    inner = drawn.replace("<svg ", '<svg width="640" height="230" ', 1)
    write_text(PICTURES / "answer.svg", f'{head}fill="#fff"/>{style}{inner}{names}</svg>\n')
    print(PICTURES / "answer.svg")


def write_screenshot(capture: Capture, clip: Clip) -> None:
    """The report as Chromium shows it; the picture of before stays where there is none."""
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        return print("Chromium is not installed: report.jpg stays as it is", file=sys.stderr)
    assert clip.log_probabilities is not None
    result = result_of(capture, clip)
    answer = Answer(
        observations=clip.observations,
        gaussians=clip.gaussians,
        position=clip.position,
        so_far=np.exp(clip.log_probabilities),
        dropped={event.frame: event.text for event in clip.dropped},
        latency_ms=clip.latency_ms,
        truth=capture.true_class(None),
        status=result["status"],
        result=result,
        made_by={"aerojax": aerojax.__version__},
    )
    with tempfile.TemporaryDirectory() as folder:
        page, picture = Path(folder) / "report.html", Path(folder) / "report.png"
        write_report(page, classification_report(capture, answer))
        flags = ("--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--hide-scrollbars")
        size = ("--enable-unsafe-swiftshader", "--window-size=1100,1000", "--virtual-time-budget=8000")
        command = [program, *flags, *size, f"--screenshot={picture}", page.as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=180)
        write_jpeg("report.jpg", cv2.imread(str(picture))[..., ::-1])


def draw_stages() -> None:
    """The pictures of docs/how_it_works.md."""
    capture = sample("drone", None)
    clip = classified(capture)
    middle = clip.observations[len(clip.observations) // 2]
    write_text(PICTURES / "rig.svg", rig_picture(capture.cameras, clip.position, "four cameras and the flight"))
    write_jpeg("cameras.jpg", side_by_side(camera_images(capture, middle)))
    write_jpeg("crops.jpg", side_by_side(crops(middle)))
    world = clip.in_world()
    times = np.linspace(0, len(clip.frames) - 1, 5).round().astype(int)
    write_jpeg("gaussians.jpg", side_by_side([from_around(at(world, int(time)), [0.6])[0] for time in times]))
    write_answer(clip)
    write_screenshot(capture, clip)


def at(gaussians: Gaussians, time: int) -> Gaussians:
    """Those of one frame of a clip."""
    return jax.tree.map(lambda leaf: leaf[time], gaussians)


def draw_gallery() -> None:
    """A row a class: one camera's crop, and the Gaussians from elsewhere."""
    for label in CLASSES:
        clip = classified(sample(label, FEW))
        seen = clip.observations[0]
        crop = fitted(as_bytes(np.asarray(seen.views.rgb)[0]), SIDE, SIDE)
        around = from_around(at(clip.in_world(), 0), [math.tau * turn / 4 + 0.5 for turn in range(4)])
        write_jpeg(f"{label}.jpg", side_by_side([crop, *around]))


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    draw_stages()
    draw_gallery()
