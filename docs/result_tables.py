"""Tables of what classifiers answer: accuracy, tolerances, comparisons, what is unknown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from result_cells import load, markdown, percent, spread

from aerojax.evaluate.markdown import interval_cell


def accuracy() -> str:
    """Accuracy of the two shipped classifiers by test set."""
    both = [load(f"measure_accuracy_{name}") for name in ("small", "mambasplat")]
    sets = {"Sim-1, Sim-2 and random networks": [found["all"] for found in both]}
    for name in ("sim1", "sim2", "random", "sim3"):
        sets[name] = [found["folders"][f"data/clips_small/{name}"] for found in both]
    far = [found["distance_64_to_280_m"][0] for found in both]
    sets[f"{far[0]['low']:g} to {far[0]['high']:g} m, of all rigs"] = far

    def cell(row: dict[str, Any]) -> str:
        return f"{percent(row['accuracy'])} {interval_cell(*row['interval_95'], how='.0f')}"

    return markdown(
        ["test set", "sequences", "views, 95 %", "mambasplat, 95 %"],
        ([name, rows[0]["clips"], *map(cell, rows)] for name, rows in sets.items()),
    )


def confusion() -> str:
    """Answers of the default weights by class."""
    found = load("measure_accuracy_small")
    names, test = found["classes"], found["all"]
    rows = [
        [f"**{name}**", *row[: len(names)], percent(recall)]
        for name, row, recall in zip(names, test["confusion"], test["recall"], strict=True)
    ]
    return markdown(["truth, answer", *names, "recall"], rows)


FAULTS = {
    "calibration_deg": ("cameras turned, °", "more"),
    "clock_ms": ("clocks apart, ms", "more"),
    "mask_growth": ("masks dilated, pixels", "more"),
    "mask_erosion": ("masks eroded, pixels", "more"),
    "cameras": ("cameras", "fewer"),
    "width_px": ("width of the object, pixels", "fewer"),
    "distance_m": ("distance at the same width, m", "more"),
}
"""Names of the faults that measure_robustness varies, and which way is worse."""
LOSS = 0.05
"""Accuracy that a tolerated level may lose: one clip in twenty."""


def _levels(fault: str) -> list[dict[str, Any]]:
    """Rows of a fault from its mildest level on; erosion is growth below zero."""
    rows, factor = load("measure_robustness_small")["rows"], fault.replace("erosion", "growth")
    found = [{**row, "value": abs(row["value"])} for row in rows if row["factor"] == factor and _side(fault, row)]
    return sorted(found, key=lambda row: row["value"], reverse=FAULTS[fault][1] == "fewer")


def _side(fault: str, row: dict[str, Any]) -> bool:
    return {"mask_growth": row["value"] >= 0, "mask_erosion": row["value"] <= 0}.get(fault, True)


def tolerances() -> str:
    """The last level of each fault that costs little, and the first that costs more."""
    rows = []
    for fault, (name, _) in FAULTS.items():
        levels = _levels(fault)
        beyond = next((i for i, row in enumerate(levels) if row["difference"] < -LOSS), len(levels))

        def said(place: int, levels: list[dict[str, Any]] = levels) -> str:
            row = levels[place]
            return f"{row['value']:g} ({percent(row['accuracy'])})"

        tried = f"{levels[0]['value']:g} to {levels[-1]['value']:g}"
        rows.append([name, tried, said(beyond - 1), said(beyond) if beyond < len(levels) else "none tried"])
    return markdown(["what", "tried", "little is lost up to", "more is lost at"], rows)


def _groups(key: str, unit: str) -> str:
    """Accuracy on rendered sequences by how large or far the object is."""
    rows = []
    for row in load("measure_accuracy_small")[key]:
        span = f"above {row['low']:g} {unit}" if row["high"] is None else f"{row['low']:g} to {row['high']:g} {unit}"
        interval = interval_cell(*row["interval_95"], how=".0f")
        rows.append([span, row["clips"], row["missing"], percent(row["accuracy"]), interval])
    return markdown(["width" if unit == "pixels" else "distance", "sequences", "without a clip", "right", "95 %"], rows)


def widths() -> str:
    """By width in pixels."""
    return _groups("width_px", "pixels")


def ranges() -> str:
    """By distance."""
    return _groups("distance_m", "m")


def features() -> str:
    """Features and bridges, one column for the five protocols where they are one figure."""
    found = load("compare_classifiers_small")
    rows = []
    for row in found["rows"]:
        protocols = {spread(figure) for figure in row["protocols"].values()}
        cells = [spread(row[key]) for key in ("last_frame", "gain")]
        rows.append([f"`{row['classifier']}`", f"{row['parameters']:,}", " / ".join(sorted(protocols)), *cells])
    return markdown(["classifier", "parameters", "whole window, all protocols", "last frame alone", "gain"], rows)


def steps() -> str:
    """The ablation, one network at a time."""
    return _compared("compare_classifiers_steps")


def on_hulls_and_refined() -> str:
    """The same network on hulls and on refined hulls."""
    return _compared("compare_classifiers_reconstructors")


def studies() -> str:
    """MambaSplat-4D by its parts and sizes."""
    return _compared("compare_classifiers_studies")


def sizes() -> str:
    """MambaSplat-4D by its depth, its width, and without time."""
    return _compared("compare_classifiers_sizes")


def _compared(name: str) -> str:
    """Rows of a comparison, each with its difference from the row that it is held against."""
    rows = []
    for row in load(name)["rows"]:
        tests = row["tests"]
        clips = f"{row['training_clips']:,} of {row['training_identities']:,}"
        against = f"`{row['against']}`" if row["against"] else ""
        far = [spread(tests[name]["accuracy"]) for name in ("sim1", "sim2", "random", "sim3")]
        about = against, row["change"], clips, len(row["seeds"])
        rows.append([f"`{row['classifier']}`", *about, _whole(row), _less(row), *far])
    head = ["row", "against", "what changes", "clips of individuals", "seeds", "all, %", "difference"]
    return markdown([*head, "sim1", "sim2", "random", "sim3"], rows)


def networks() -> str:
    """MambaSplat-4D beside other networks: turned windows, and whole clips less those of E(X)."""
    rows = []
    for row in load("compare_classifiers_baselines")["rows"]:
        turned = [spread(row["turned"][kind]) for kind in ("none", "z", "so3", "so3_per_frame")]
        about = row["label"], f"{row['parameters']:,}", row["trained"], len(row["seeds"])
        rows.append([f"`{row['classifier']}`", *about, *turned, _whole(row), _less(row)])
    head = ["row", "network", "parameters", "trained", "seeds", "none", "z", "SO(3)", "SO(3) a frame", "whole clips, %"]
    return markdown([*head, "less `E_X`"], rows)


def networks_by_folder() -> str:
    """The same networks on whole clips that are not turned, by folder."""
    rows = []
    for row in load("compare_classifiers_baselines")["rows"]:
        folders = [spread(row["tests"][folder]["accuracy"]) for folder in ("sim1", "sim2", "random", "sim3")]
        about = row["label"], f"{row['parameters']:,}", len(row["seeds"])
        rows.append([f"`{row['classifier']}`", *about, _whole(row), *folders])
    return markdown(["row", "network", "parameters", "seeds", "all, %", "sim1", "sim2", "random", "sim3"], rows)


def _whole(row: dict[str, Any]) -> str:
    """Accuracy of whole clips of all counted folders, with its interval over individuals."""
    whole = row["tests"]["all"]
    return f"{spread(whole['accuracy'])} {interval_cell(*whole['interval_95'], how='.0f')}"


def _less(row: dict[str, Any]) -> str:
    """How far it is from the row that it is held against, on the same clips; empty where it is that row."""
    gap = row["difference"]
    return "" if gap is None else f"{100 * gap['accuracy']:+.1f} {interval_cell(gap['low'], gap['high'], '+.1f')}"


def ensembles() -> str:
    """The ablation's networks averaged over their seeds, and calibration with and without a temperature."""
    rows = []
    for row in load("compare_classifiers_steps")["rows"]:
        one, several = row["tests"]["all"], row["averaged"]["tests"]
        cells = [f"{100 * one['accuracy']['mean']:.1f}", row["averaged"]["networks"]]
        cells += [f"{100 * several['all']['accuracy']:.1f} {interval_cell(*several['all']['interval_95'], how='.0f')}"]
        cells += [f"{100 * several['sim3']['accuracy']:.1f}"]
        cells += [f"{one[key]['mean']:.3f}" for key in ("ece", "ece_with_temperature")]
        cells += [f"{several['all'][key]:.3f}" for key in ("ece", "ece_with_temperature")]
        rows.append([f"`{row['classifier']}`", *cells])
    head = ["row", "one, %", "networks", "averaged, %", "sim3, %", "ECE of one", "with T", "ECE averaged", "with T"]
    return markdown(head, rows)


def rotations() -> str:
    """Accuracy of windows under the five protocols: the shipped weights, and a pair that differs by its training."""
    shipped, pair = load("eval_rotation_mambasplat"), load("eval_rotation_turned")
    rows = []
    for name, found in (("shipped", shipped), ("`frames`", pair), ("`turned`", pair["against"])):
        tests = [found["rotations"][kind] for kind in found["protocols"].values()]
        cells = [f"{100 * test['clip_accuracy']['mean']:.2f}" for test in tests]
        rows.append([name, found["trained"], *cells, sum(test["answers_changed"] for test in tests)])
    return markdown(["weights", "trained under", *shipped["protocols"], "answers changed"], rows)


def frames() -> str:
    """One frame and all of them by class, and what shuffled frames cost, of both shipped classifiers."""
    rows = []
    for model in load("measure_frames_small")["models"]:
        for first, whole, lost in zip(model["first"], model["whole"], model["shuffled"], strict=True):
            shares = [
                f"{100 * row['accuracy']:.1f} {interval_cell(row['low'], row['high'], '.0f')}" for row in (first, whole)
            ]
            cost = f"{100 * lost['accuracy']:+.1f} {interval_cell(lost['low'], lost['high'], '+.1f')}"
            rows.append([f"`{model['name']}`", whole["class"], whole["clips"], *shares, cost])
    return markdown(["weights", "class", "clips", "one frame, %", "all frames, %", "shuffled costs, points"], rows)


def moving() -> str:
    """How reconstructed shapes move, by class and by the pixels that an object spans."""
    rows = []
    for row in load("describe_clips_small")["by_width"]:
        ends = f"{row['from']:g} to {row['to']:g}" if row["to"] < 1000 else f"above {row['from']:g}"
        figures = f"{row['amplitude']:.3f}", row["strongest_bin"], percent(row["periodic"], 0)
        rows.append([row["class"], ends, row["clips"], *figures])
    return markdown(["class", "pixels", "clips", "amplitude, radii", "strongest bin", "shape returns"], rows)


def attributes() -> str:
    """Attributes of reconstructed Gaussians by class: median, 5th and 95th percentile."""
    found = load("describe_clips_small")
    by_class: dict[str, list[str]] = {row["class"]: [row["class"]] for row in found["gaussians"]}
    for row in found["attributes"]:
        low, _, middle, _, high = row["quantiles"]
        by_class[row["class"]].append(f"{middle:.3g} ({low:.3g} to {high:.3g})")
    head = ["scale, radii", "largest over smallest", "opacity", "turned, °", "red", "green", "blue"]
    return markdown(["class", *head], by_class.values())


def unknown() -> str:
    """Shares that are called unknown: kinds of outliers, then classes."""
    found = load("measure_unknown")
    every, counts = found["all"], found["outliers"]
    rows: list[Sequence[object]] = [
        [kind, counts[kind], percent(share)] for kind, share in every["strange_by_group"].items()
    ]
    rows += [["**all outliers**", sum(counts.values()), percent(every["strange_called_unknown"])]]
    rows += [[name, "", percent(share)] for name, share in every["known_by_class"].items()]
    rows += [["**all known objects**", every["clips"], percent(every["known_called_unknown"])]]
    return markdown(["clips of", "number", "called unknown"], rows)


def unknown_by_set() -> str:
    """The same for every set of clips of the classes."""
    found, rows = load("measure_unknown"), []
    for name in ("all", "sim1", "sim2", "random", "sim3"):
        row = found[name]
        areas = [f"{row[key]:.3f}" for key in ("auroc", "auroc_of_probability", "ece")]
        areas[-1] += f" ({row['ece_by_chance']['mean']:.3f}, {row['ece_by_chance']['upper_95']:.3f})"
        shares = [percent(row[key]) for key in ("accuracy", "accuracy_of_answered", "known_called_unknown")]
        sets = [percent(row["sets"]["coverage"]), f"{row['sets']['mean_size']:.2f}"]
        rows.append(["factory" if name == "all" else name, row["clips"], *areas, *shares, *sets])
    head = [
        "clips of the classes",
        "number",
        "AUROC",
        "of the probability alone",
        "ECE (by chance)",
        "right",
        "right of the others",
        "called unknown",
        "class in its set",
        "classes a set",
    ]
    return markdown(head, rows)
