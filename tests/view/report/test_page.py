"""The report page: one file, no request, nothing unescaped, the right numbers, a bounded size."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import html.parser
import json
import re

import cv2
import numpy as np
import pytest
from support.report_examples import make_camera, make_frame, make_report

from aerojax.view.report.content import CameraAgreement, ClassificationReport
from aerojax.view.report.page import write_report

HOSTILE = '<script>alert("1")</script>&\'[[data]]'


class Page(html.parser.HTMLParser):
    """Collects elements and texts of a page and checks that the elements nest."""

    EMPTY = frozenset({"meta", "img", "input", "line", "circle", "rect", "path", "polyline", "br"})
    STILL = "data:image/webp;base64,"

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
    words = ["flight 7", "drone", "91.2 %", "0.9123", "0.0124", "✓ ok", "✓ correct", "12.34", "201.50", "213.84"]
    words += [
        "3 of 7 frames were dropped",
        "frames 3, 4: too few cameras",
        "frame 9: too small",
        "so far",
        "A remark.",
    ]
    for text in [*words, "1.2.3", "views"]:
        assert text in visible, text
    steps = page.data()["steps"]
    assert [step["frame"] for step in steps] == [0, 1, 2, 3, 4, 5, 9]
    assert [step["dropped"] for step in steps][2:5] == [None, "too few cameras", "too few cameras"]
    assert [step["index"] for step in steps] == [0, 1, 2, 2, 2, 3, 3]
    assert steps[5]["place"] == [6.0, 2.0, 8.0] and page.data()["scene"]["track"][3] is None


def test_what_matters_first_comes_first(tmp_path):
    _, page = write(tmp_path, make_report((make_frame(0),), warnings=("a warning",)))
    words = [text.strip() for _, text in page.texts]
    order = ["✓ ok", "3 of 4 frames were dropped.", "a warning", "Probability so far", "Latency"]
    assert sorted(order, key=words.index) == order


def test_the_first_frame_needs_no_script(tmp_path):
    text, page = write(tmp_path, make_report((make_frame(5), make_frame(6))))
    before = text.partition('<script type="application/json"')[0]
    images = re.findall(r'<img [^>]*src="(data:image/[^"]*)"', before)
    assert len(images) == 4 and images[0].startswith(Page.STILL)
    bytes_ = np.frombuffer(base64.b64decode(images[0].partition(",")[2]), np.uint8)
    alpha = cv2.imdecode(bytes_, cv2.IMREAD_UNCHANGED)[..., 3]
    height, width = alpha.shape
    assert alpha[height // 2, width // 2] > 200 and alpha[:5, :5].max() == 0, "the object is in the middle"
    assert 'class="outline" d="M' in before and "frame 5" in page.visible()


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
    report = make_report((make_frame(0),), status="unsure", reasons=("camera cam_02 disagrees",), agreement=agreement)
    _, page = write(tmp_path, report)
    words = [text for _, text in page.texts]
    assert words.index("not sure") < words.index("camera cam_02 disagrees") < words.index("cam_01")
    assert "Camera cam_02 disagrees with the others: its outlines are off by 9.0 pixels." in words
    assert "most likely drone" in page.visible() and "drone" not in words[: words.index("not sure")]
    assert words.count("disagrees") == 1 and words[words.index("disagrees") - 1].strip() == "cam_02"
    for figure in ("0.3 px, 0.004 m", "9.0 px, 0.120 m", "2 %", "–"):
        assert figure in words, figure
    assert "not sure" not in write(tmp_path, make_report((make_frame(0),)))[1].visible()


def test_page_needs_nothing_from_outside(tmp_path):
    text, page = write(tmp_path, make_report((make_frame(0), make_frame(1))))
    policed = text
    text = re.sub(r"base64,[A-Za-z0-9+/=]+", "", text)
    text = re.sub(r'"splats":"[^"]*"', "", text)
    assert not re.search(r"https?:|//[a-z]|url\(|@import|\bfetch\(|XMLHttpRequest", text)
    assert not re.search(r"""\bsrc\s*=\s*["'](?!data:)""", text)
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        assert not {"href", "srcset", "action"} & set(attributes)
    (policy,) = [a["content"] for t, a in page.elements if a.get("http-equiv") == "Content-Security-Policy"]
    assert "default-src 'none'" in policy and "img-src data:" in policy
    script = policed.rpartition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy


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
        status="unsure",
        reasons=(HOSTILE,),
        warnings=(HOSTILE,),
        made_by={HOSTILE: HOSTILE},
        rig=(make_camera(0, HOSTILE),),
        agreement=(CameraAgreement(HOSTILE, None, None, None, None, None, suspect=True),),
    )
    text, page = write(tmp_path, report)
    assert "<script>alert" not in text
    assert [tag for tag, _ in page.elements].count("script") == 2
    # Title twice; most likely class, doubt, truth, bar, dropped frame's reason, suspect, warning, legend, camera twice,
    # stage, agreement, note, what made it twice.
    assert page.visible().count(HOSTILE) == 17
    assert page.data()["cameras"] == [HOSTILE, "b"]


def test_frames_and_crops_survive_the_journey(tmp_path):
    frame = make_frame(4, ("cam_02",))
    data = write(tmp_path, make_report((frame,), dropped={}))[1].data()
    crop = data["steps"][0]["crops"]["cam_02"]
    assert crop["box"] == [100.0, 50.0, 150.0, 90.0] and crop["full"] == [960, 540]
    assert crop["size"] == [50, 40] and crop["object"] == [5, 10, 25, 30]
    jpeg = np.frombuffer(base64.b64decode(crop["jpeg"].partition(",")[2]), np.uint8)
    image = cv2.cvtColor(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    np.testing.assert_allclose(image[20, 15].astype(int), (200, 40, 40), atol=12)


def test_camera_without_crop_in_some_frames(tmp_path):
    frames = make_frame(0, ("a",)), make_frame(1, ("b",))
    data = write(tmp_path, make_report(frames, dropped={}, rig=()))[1].data()
    assert data["cameras"] == ["a", "b"]
    assert [list(step["crops"]) for step in data["steps"]] == [["a"], ["b"]]


def test_no_frame_at_all(tmp_path):
    _, page = write(tmp_path, make_report((), probabilities={}, latency_ms={}, dropped={}))
    assert "No frame gives a place" in page.visible() and page.data()["steps"] == []


def test_numbers_that_are_none(tmp_path):
    frame = make_frame(0)
    mean = frame.splats.mean.copy()
    mean[::7] = np.nan
    splats = dataclasses.replace(frame.splats, mean=mean)
    lost = dataclasses.replace(frame, splats=splats, position=np.full(3, np.nan))
    text, page = write(tmp_path, make_report((lost, make_frame(1))))
    assert page.data()["steps"][0]["place"] == [None, None, None] and page.data()["scene"]["track"][0] is None
    assert "nan" not in re.sub(r'"[A-Za-z0-9+/=]{40,}"|base64,[A-Za-z0-9+/=]+', "", text.lower())


@pytest.mark.parametrize(("frames", "cameras"), [(60, 5), (420, 3), (2500, 0)])
def test_long_captures_stay_below_four_megabytes(tmp_path, frames, cameras):
    rng = np.random.default_rng(0)
    rgb, mask = rng.integers(0, 256, (80, 90, 3), dtype=np.uint8), rng.random((80, 90)) > 0.5
    one = make_frame(0).crops[0]
    crops = tuple(dataclasses.replace(one, camera=f"c{i}", rgb=rgb, mask=mask) for i in range(cameras))
    first = dataclasses.replace(make_frame(0), crops=crops)
    report = make_report(tuple(dataclasses.replace(first, frame=i) for i in range(frames)), dropped={}, rig=())
    text, page = write(tmp_path, report)
    assert len(text.encode()) < 4_000_000
    shown = page.data()["steps"]
    assert (f"shows {len(shown)} of {frames} frames" in page.visible()) == (len(shown) < frames)
    places = re.search(r'data-at="([^"]*)"', text)[1].split(" ")
    assert max(step["index"] for step in shown) < len(places)


def test_an_explanation_is_shown_where_it_was_asked_for(tmp_path):
    found = {"label": 1, "probability": 0.9, "frames": [1.0, 3.0], "without_frames": [0.9, 0.4]}
    frames = (make_frame(0), make_frame(1), make_frame(4))
    text, page = write(tmp_path, make_report(frames, explanation=found))
    assert "Frames that it stands on" in page.visible() and "Gaussians that it stands on" not in page.visible()
    assert "saliency of frames" in text
    curves = {"shares": [0.0, 0.5], "deletion": [0.9, 0.1], "insertion": [0.2, 0.9], "random": [0.9, 0.7]}
    _, page = write(tmp_path, make_report(frames, explanation={**found, **curves}))
    assert "Gaussians that it stands on" in page.visible() and "salient gone" in page.visible()
    assert "stands on" not in write(tmp_path, make_report(frames))[1].visible()
