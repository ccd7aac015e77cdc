"""The figure of accuracy against faults: a panel a factor, points where they belong, valid XML."""

from __future__ import annotations

from xml.etree import ElementTree

from aerojax.view.robustness import COLUMNS, PANEL, TALL, robustness_svg

SVG = "{http://www.w3.org/2000/svg}"


def row(value: float, accuracy: float, undrawn: float = 0.0) -> dict:
    return {"value": value, "what": "", "accuracy": accuracy, "interval_95": [0.0, 1.0], "undrawn": undrawn}


def test_points_lie_at_their_accuracy():
    curves = {f"fault {i}": [row(0.0, 1.0), row(5.0, 0.5, 0.25)] for i in range(COLUMNS + 1)}
    drawn = ElementTree.fromstring(robustness_svg(curves, {"fault 0": "a < b"}))
    assert (int(drawn.get("width")), int(drawn.get("height"))) == (COLUMNS * PANEL, 2 * TALL)
    panels = drawn.findall(f"{SVG}g")
    assert len(panels) == COLUMNS + 1 and panels[0][0].text == "a < b" and panels[1][0].text == "fault 1"
    best, half = (float(c.get("cy")) for c in panels[0].findall(f"{SVG}circle"))
    ticks = {t.text: float(t.get("y")) - 4 for t in panels[0].findall(f"{SVG}text") if "%" in t.text}
    assert abs(best - ticks["100 %"]) < 0.11 and abs(half - ticks["50 %"]) < 0.11
    columns = [float(r.get("height")) for r in panels[0].findall(f"{SVG}rect")]
    assert columns[0] == 0.0 and abs(columns[1] - (ticks["0 %"] - ticks["25 %"])) < 0.11
