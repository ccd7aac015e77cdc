"""The report page: one file, no request, nothing unescaped, the right numbers, a bounded size."""

from __future__ import annotations

import base64
import dataclasses
import html.parser
import json
import re

import cv2
import numpy as np
import pytest

from aerojax.view.report.content import CameraAgreement, CameraCrop, ClassificationReport, FrameReport
from aerojax.view.report.page import write_report

HOSTILE = '<script>alert("1")</script>&\'[[data]]'


CLASSES = ("bird", "drone", "airplane", "helicopter")


def make_frame(frame: int, cameras: tuple[str, ...] = ("cam_01", "cam_02", "cam_03"), side: int = 40) -> FrameReport:
    rng = np.random.default_rng(frame)
    crops = []
    for index, camera in enumerate(cameras):
        rgb = np.full((side, side + 10, 3), 30 * index + 20, np.uint8)
        mask = np.zeros((side, side + 10), bool)
        mask[10:30, 5:25] = True
        rgb[mask] = (200, 40, 40)
        crops.append(CameraCrop(camera, rgb, mask, (100.0, 50.0, 150.0, 90.0), (960, 540)))
    points = rng.normal(size=(500, 3)).astype(np.float32) * np.float32(0.2) + np.float32(5)
    colours = rng.integers(0, 256, (500, 3), dtype=np.uint8)
    probabilities = np.array([0.1, 0.7, 0.15, 0.05], np.float32)
    return FrameReport(frame, tuple(crops), points, colours, probabilities, np.array([1.0 + frame, 2.0, 8.0]))


def make_report(frames: tuple[FrameReport, ...], **changes) -> ClassificationReport:
    report = ClassificationReport(
        title="flight 7",
        label="drone",
        probabilities=dict(zip(CLASSES, (0.0312, 0.9123, 0.0441, 0.0124), strict=True)),
        truth="drone",
        frames=frames,
        dropped={3: "too few cameras", 4: "too few cameras", 9: "too small"},
        latency_ms={"read": 12.34, "reconstruct": 201.5},
        notes=("A remark.",),
    )
    return dataclasses.replace(report, **changes)


class Page(html.parser.HTMLParser):
    """Collects elements and texts of a page and checks that the elements nest."""

    EMPTY = frozenset({"meta", "img", "input", "line", "circle", "rect", "path", "polyline", "br"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if tag not in self.EMPTY:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append((self.open[-1] if self.open else "", data))

    def visible(self) -> str:
        return " ".join(text for tag, text in self.texts if tag not in ("script", "style"))

    def data(self) -> dict:
        scripts = [text for tag, text in self.texts if tag == "script"]
        return json.loads(scripts[0])


def write(tmp_path, report: ClassificationReport) -> tuple[str, Page]:
    path = tmp_path / "new folder" / "page.html"
    write_report(path, report)
    text = path.read_text(encoding="utf-8")
    return text, Page(text)


def test_page_shows_the_numbers(tmp_path):
    _, page = write(tmp_path, make_report(tuple(make_frame(i) for i in (0, 1, 2, 5))))
    visible = page.visible()
    for words in ("flight 7", "drone", "91.2 %", "0.9123", "0.0124", "✓ correct", "12.34", "201.50", "213.84"):
        assert words in visible, words
    assert "too few cameras" in visible and "3, 4" in visible and "A remark." in visible
    assert [frame["frame"] for frame in page.data()["frames"]] == [0, 1, 2, 5]
    assert page.data()["frames"][3]["place"] == [6.0, 2.0, 8.0]


def test_wrong_and_unknown_truth(tmp_path):
    frames = (make_frame(0),)
    assert "✗ wrong · truth: bird" in write(tmp_path, make_report(frames, truth="bird"))[1].visible()
    unknown = write(tmp_path, make_report(frames, truth=None))[1].visible()
    assert "correct" not in unknown and "wrong" not in unknown


def test_an_unsure_answer_is_no_label(tmp_path):
    agreement = (
        CameraAgreement("cam_01", 0.31, 0.004, 1.2, 0.016, 0.02, suspect=False),
        CameraAgreement("cam_02", 9.04, 0.12, 11.5, 0.153, None, suspect=True),
    )
    report = make_report((make_frame(0),), sure=False, reasons=("camera cam_02 disagrees",), agreement=agreement)
    _, page = write(tmp_path, report)
    words = [text for _, text in page.texts]
    assert words.index("not sure") < words.index("camera cam_02 disagrees") < words.index("cam_01")
    assert "most likely drone" in page.visible() and "drone" not in words[: words.index("not sure")]
    assert words.count("disagrees") == 1 and words[words.index("disagrees") - 1].strip() == "cam_02"
    for figure in ("0.3 px, 0.004 m", "9.0 px, 0.120 m", "2 %", "–"):
        assert figure in words, figure
    assert "not sure" not in write(tmp_path, make_report((make_frame(0),)))[1].visible()


def test_page_needs_nothing_from_outside(tmp_path):
    text, page = write(tmp_path, make_report((make_frame(0), make_frame(1))))
    text = re.sub(r"base64,[A-Za-z0-9+/=]+", "", text)
    text = re.sub(r'"(xyz|rgb)":"[^"]*"', "", text)
    assert not re.search(r"https?:|//[a-z]|url\(|@import|\bfetch\(|XMLHttpRequest", text)
    assert not re.search(r"""\bsrc\s*=\s*["'](?!data:)""", text)
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        assert not {"src", "href", "srcset", "action"} & set(attributes)
    (policy,) = [a["content"] for t, a in page.elements if a.get("http-equiv") == "Content-Security-Policy"]
    assert "default-src 'none'" in policy and "img-src data:" in policy


def test_every_text_is_escaped(tmp_path):
    report = make_report(
        (make_frame(0, (HOSTILE, "b")),),
        title=HOSTILE,
        label=HOSTILE,
        truth=HOSTILE,
        probabilities={HOSTILE: 1.0, "b": 0.0, "c": 0.0, "d": 0.0},
        dropped={1: HOSTILE},
        latency_ms={HOSTILE: 1.0},
        notes=(HOSTILE,),
        sure=False,
        reasons=(HOSTILE,),
        agreement=(CameraAgreement(HOSTILE, None, None, None, None, None, suspect=True),),
    )
    text, page = write(tmp_path, report)
    assert "<script>alert" not in text
    assert [tag for tag, _ in page.elements].count("script") == 2
    assert page.visible().count(HOSTILE) == 12
    # Title twice; label, truth, bar, camera, legend, dropped frame's reason, stage, note, doubt, agreement.
    assert page.data()["cameras"] == [HOSTILE, "b"]


def test_frames_and_crops_survive_the_journey(tmp_path):
    frame = make_frame(4, ("cam_02",))
    data = write(tmp_path, make_report((frame,)))[1].data()
    crop = data["frames"][0]["crops"]["cam_02"]
    assert crop["box"] == [100.0, 50.0, 150.0, 90.0] and crop["full"] == [960, 540]
    assert crop["size"] == [50, 40] and crop["object"] == [5, 10, 25, 30]
    jpeg = np.frombuffer(base64.b64decode(crop["jpeg"].partition(",")[2]), np.uint8)
    image = cv2.cvtColor(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    np.testing.assert_allclose(image[20, 15].astype(int), (200, 40, 40), atol=12)


def test_camera_without_crop_in_some_frames(tmp_path):
    data = write(tmp_path, make_report((make_frame(0, ("a",)), make_frame(1, ("b",)))))[1].data()
    assert data["cameras"] == ["a", "b"]
    assert [list(frame["crops"]) for frame in data["frames"]] == [["a"], ["b"]]


def test_no_frame_at_all(tmp_path):
    _, page = write(tmp_path, make_report((), probabilities={}, latency_ms={}, dropped={}))
    assert "No frame was usable" in page.visible() and page.data()["frames"] == []


def test_numbers_that_are_none(tmp_path):
    frame = make_frame(0)
    points = frame.points.copy()
    points[::7] = np.nan
    lost = dataclasses.replace(frame, points=points, position=np.full(3, np.nan))
    text, page = write(tmp_path, make_report((lost, make_frame(1))))
    assert page.data()["frames"][0]["place"] == [None, None, None]
    assert "nan" not in re.sub(r'"[A-Za-z0-9+/=]{40,}"|base64,[A-Za-z0-9+/=]+', "", text.lower())


@pytest.mark.parametrize(("frames", "cameras"), [(60, 5), (420, 3), (2500, 0)])
def test_long_captures_stay_below_four_megabytes(tmp_path, frames, cameras):
    rng = np.random.default_rng(0)
    rgb, mask = rng.integers(0, 256, (80, 90, 3), dtype=np.uint8), rng.random((80, 90)) > 0.5
    crops = tuple(CameraCrop(f"c{i}", rgb, mask, (0.0, 0.0, 90.0, 80.0), (960, 540)) for i in range(cameras))
    first = dataclasses.replace(make_frame(0), crops=crops)
    report = make_report(tuple(dataclasses.replace(first, frame=i) for i in range(frames)), dropped={})
    text, page = write(tmp_path, report)
    assert len(text.encode()) < 4_000_000
    shown = page.data()["frames"]
    assert (f"shows {len(shown)} of {frames} frames" in page.visible()) == (len(shown) < frames)
    places = re.search(r'data-at="([^"]*)"', text)[1].split(" ")
    assert max(frame["index"] for frame in shown) < len(places)
