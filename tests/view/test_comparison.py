"""Dots and intervals of a comparison's rows."""

from __future__ import annotations

from xml.etree import ElementTree

from aerojax.view.comparison import comparison_svg


def row(name: str, mean: float, low: float, high: float) -> dict:
    return {"classifier": name, "tests": {"all": {"accuracy": {"mean": mean}, "interval_95": [low, high]}}}


def test_dots_stand_within_their_intervals():
    root = ElementTree.fromstring(comparison_svg([row("a<b", 0.5, 0.25, 0.75), row("c", 1.0, 1.0, 1.0)]))
    space = "{http://www.w3.org/2000/svg}"
    first, second = root.iter(f"{space}circle")
    lines = [line for line in root.iter(f"{space}line") if line.get("class") == "s0"]
    assert float(lines[0].get("x1")) < float(first.get("cx")) < float(lines[0].get("x2"))
    ends = float(lines[0].get("x1")) + float(lines[0].get("x2"))
    assert abs(float(first.get("cx")) - ends / 2) < 0.2
    assert float(second.get("cx")) == float(lines[1].get("x1")) > float(first.get("cx"))
    assert "a<b" in {text.text for text in root.iter(f"{space}text")}
