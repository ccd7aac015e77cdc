"""The report in Chromium: pictures at three times and two sizes, driven by script; nothing is requested."""

from __future__ import annotations

import dataclasses
import itertools
import math

import jax.numpy as jnp
import numpy as np
import pytest
from support.chromium import Tab, chromium, needs_chromium
from support.report_examples import make_frame, make_report, make_splats

from aerojax.core.types import SH_C0, Camera, Gaussians
from aerojax.gaussians.render import render
from aerojax.view.report.page import write_report

pytestmark = needs_chromium


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "an answer – 1.html"
    frames = (make_frame(0), make_frame(1), make_frame(5))
    rig = make_report(()).rig
    suspect = (rig[0], dataclasses.replace(rig[1], suspect=True), rig[2])
    write_report(path, make_report(frames, rig=suspect))
    return path


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    with chromium(tmp_path_factory.mktemp("profile")) as tab:
        yield tab


def coloured(picture: np.ndarray) -> float:
    """Share of pixels that are clearly no grey: the balls of the examples are of every colour."""
    values = picture.astype(int)
    return float((values.max(axis=2) - values.min(axis=2) > 60).mean())


def differ(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape != b.shape or float(np.abs(a.astype(int) - b).mean()) > 0.5


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (1280, True), (340, False), (340, True)])
def test_every_frame_is_drawn(tab: Tab, page, width, dark):
    tab.resize(width, 800, dark=dark)
    seen = []
    for frame in (0, 1, 5):
        tab.open(page, f"frame={frame}&view=object")
        tab.settle()
        assert tab.run("document.querySelector('#now').textContent") == f"frame {frame}"
        seen.append(tab.picture(".view"))
        assert coloured(seen[-1]) > 0.05
    assert differ(seen[0], seen[1]) and differ(seen[1], seen[2])
    assert (seen[0][3, 3].mean() < 100) == dark
    assert tab.run("document.documentElement.scrollWidth") == width, "nothing sticks out"
    assert tab.complaints() == []


def test_it_can_be_turned_zoomed_and_played(tab: Tab, page):
    tab.resize(1280, 800)
    tab.open(page)
    tab.settle()
    pictures = [tab.picture(".view")]

    def after(script: str) -> None:
        tab.run(script)
        tab.settle()
        pictures.append(tab.picture(".view"))

    key = "document.querySelector('.view canvas').dispatchEvent(new KeyboardEvent('keydown', {{key: '{}'}}))"
    for name in ("ArrowLeft", "ArrowUp", "+", "+"):
        after(key.format(name))
    x, y = tab.run(
        "(r => [r.x + r.width / 2, r.y + r.height / 2])(document.querySelector('.view').getBoundingClientRect())"
    )
    mouse = {"button": "left", "buttons": 1}
    tab.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, **mouse)
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + 120, y=y + 10, **mouse)
    tab.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + 120, y=y + 10, **mouse)
    after("0")
    after("document.querySelector('[data-view=scene]').click()")
    after("document.querySelector('[data-show=cameras]').click()")
    after("document.querySelector('[data-view=\"1\"]').click()")
    assert tab.run("document.querySelector('.through b').textContent") == "through cam_02"
    after(key.format("Home"))
    for before, then in itertools.pairwise(pictures):
        assert differ(before, then)
    assert coloured(pictures[4]) > 1.5 * coloured(pictures[0]), "two steps nearer"
    tab.run("document.body.dispatchEvent(new KeyboardEvent('keydown', {key: '.', bubbles: true}))")
    assert tab.run("document.querySelector('#now').textContent") == "frame 1"
    tab.run("document.querySelector('#speed').value = 1; document.querySelector('#play').click()")
    assert tab.run("document.querySelector('#play').getAttribute('aria-label')") == "Pause"
    moved = "document.querySelector('#now').textContent !== 'frame 1'"
    waited = f"new Promise(done => {{ const look = () => {moved} ? done(true) : setTimeout(look, 5); look(); }})"
    assert tab.run(waited), "the tab's own patience ends this where nothing moves"
    assert tab.complaints() == []


def test_a_dropped_frame_says_why(tab: Tab, page):
    tab.resize(1280, 800)
    tab.open(page, "frame=3")
    tab.settle()
    assert tab.run("document.querySelector('#detail').textContent") == "dropped: too few cameras"
    assert tab.run("document.querySelectorAll('.camera.absent').length") == 3
    assert coloured(tab.picture(".view")) > 0, "the last reconstruction stays, faded"


def test_overlays_can_be_switched(tab: Tab, page):
    tab.resize(1280, 800)
    shown = {}
    for over in ("none", "outline", "box", "place", "splats"):
        tab.open(page, f"frame=0&over={over}")
        tab.settle()
        shown[over] = tab.picture(".camera .picture")
    plain = shown.pop("none").astype(int)
    changed = {over: int((np.abs(picture - plain).max(axis=2) > 40).sum()) for over, picture in shown.items()}
    assert min(changed.values()) > 50, changed
    tab.open(page, "frame=0&show=none")
    tab.settle()
    assert coloured(tab.picture(".view")) == 0.0


def test_a_page_of_many_cameras_has_no_hole(tab: Tab, tmp_path):
    cameras = tuple(f"c{index}" for index in range(7))
    path = tmp_path / "seven.html"
    write_report(path, make_report((make_frame(0, cameras),), rig=()))
    for width in (1280, 340):
        tab.resize(width, 800)
        tab.open(path)
        boxes = tab.run(
            "[...document.querySelectorAll('.camera')].map(f => f.getBoundingClientRect())"
            ".map(r => [r.x, r.right, r.bottom])"
        )
        left, right, bottom = np.array(boxes).T
        grid = tab.run("(r => [r.x, r.right, r.bottom])(document.querySelector('.cameras').getBoundingClientRect())")
        last = np.abs(bottom - grid[2]) < 2
        covered = sum(r - x for x, r in zip(left[last], right[last], strict=True)) + 12 * (last.sum() - 1)
        assert covered == pytest.approx(grid[1] - grid[0], abs=3)


def test_without_script_or_webgl_a_still_remains(tmp_path, page):
    with chromium(tmp_path / "profile", "--disable-3d-apis") as tab:
        tab.resize(1280, 800)
        tab.open(page)
        assert "still picture" in tab.run("document.querySelector('#keys').textContent")
        assert coloured(tab.picture(".view")) > 0.05
        tab.call("Emulation.setScriptExecutionDisabled", value=True)
        tab.open(page)
        shot = tab.picture("html")
        assert coloured(shot) > 0.01


def test_splats_are_those_of_the_renderer(tab: Tab, tmp_path):
    """Seen through a camera, a handful of large Gaussians looks as `gaussians.render` draws it."""
    base = make_splats(12, 3)
    scale = np.full((12, 3), 0.12, np.float32) * np.array([[1.0, 0.5, 0.25]], np.float32)
    splats = dataclasses.replace(base, scale=scale)
    frame = dataclasses.replace(make_frame(0), splats=splats)
    path = tmp_path / "few.html"
    write_report(path, make_report((frame,), dropped={}))
    tab.resize(1000, 900)
    tab.open(path, "view=cam_01&show=gaussians")
    tab.run(
        "document.querySelectorAll('.behind, .through, .scale, .labels').forEach(node => node.remove());"
        "document.querySelector('.view').style.background = '#000';"
        "document.querySelector('.view').style.borderRadius = '0'"
    )
    tab.settle()
    drawn = tab.picture(".view canvas").astype(np.float32) / 255
    height, width = drawn.shape[:2]
    crop = frame.crops[0]
    s = min(width / crop.lens.width, height / crop.lens.height)
    cx = crop.lens.cx * s + (width - s * crop.lens.width) / 2
    cy = crop.lens.cy * s + (height - s * crop.lens.height) / 2
    K = jnp.array([[crop.lens.fx * s, 0, cx], [0, crop.lens.fy * s, cy], [0, 0, 1]], jnp.float32)
    camera = Camera(K, jnp.asarray(crop.centre_from_cam, jnp.float32), width=width, height=height)
    sh = jnp.asarray((splats.rgb[:, None] - 0.5) / SH_C0)
    columns = map(jnp.asarray, (splats.mean, splats.quaternion, splats.scale, splats.opacity))
    expected = np.asarray(render(Gaussians(*columns, sh), camera, background=jnp.zeros(3)).colour)
    assert math.isfinite(expected.sum()) and expected.max() > 0.3
    difference = np.abs(drawn - expected)
    assert difference.mean() < 0.01 and np.quantile(difference, 0.99) < 0.05
