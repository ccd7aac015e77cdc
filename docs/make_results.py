"""Write docs/results.md, docs/limits.md and the results in README.md: templates filled with figures of results/*.json.

    make docs

A template holds `{{file path format}}`: a file of results/ (or docs/published.json) without its end, a path into it and
how the value is written; `{{table name}}` is one of `TABLES`. Paths are those of `aerojax.evaluate.result_paths`.
Formats are those of Python; `.1%` puts a space before the sign and `.1e` writes a power of ten.
"""

from __future__ import annotations

import functools
import json
import re
import textwrap
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from aerojax.evaluate.result_paths import lookup
from aerojax.view.comparison import comparison_svg
from aerojax.view.temporal import temporal_plots

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
TEMPLATES = DOCS / "templates"
PAGES = "results.md", "limits.md"
README = ROOT / "README.md"
BEGIN, END = "<!-- results: made by `make docs` from docs/templates/readme.md -->", "<!-- end of results -->"
WIDTH = 120
"""Characters of a line of prose."""
PLACE = re.compile(r"\{\{(.+?)\}\}")
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@functools.cache
def load(name: str) -> Any:
    """The content of results/<name>.json, or of docs/<name>.json."""
    path = next(p for p in (ROOT / "results" / f"{name}.json", DOCS / f"{name}.json") if p.is_file())
    return json.loads(path.read_text(encoding="utf-8"))


def formatted(value: Any, how: str) -> str:
    """A value as the page has it."""
    if how.endswith("%"):
        return f"{100 * value:{how[:-1]}f} %"
    if how.endswith("e"):
        number, power = f"{value:{how}}".split("e")
        return f"{number}·10{str(int(power)).translate(_RAISED)}"
    return f"{value:{how}}"


def filled(template: str) -> str:
    """A template with its figures."""

    def figure(place: re.Match[str]) -> str:
        name, path, *how = place[1].split()
        return TABLES[path]() if name == "table" else formatted(lookup(load(name), path), how[0] if how else "")

    return PLACE.sub(figure, template)


def made(name: str) -> str:
    """A template filled, with even lines."""
    blocks = filled((TEMPLATES / name).read_text(encoding="utf-8")).strip().split("\n\n")
    return "\n\n".join(block if block.startswith(("#", "|", "- ")) else _even(block) for block in blocks) + "\n"


def _even(paragraph: str) -> str:
    return textwrap.fill(" ".join(paragraph.split()), WIDTH, break_long_words=False, break_on_hyphens=False)


def readme(text: str) -> str:
    """README.md with its results made again."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{made('readme.md')}{END}{after}"


def markdown(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def percent(share: float, digits: int = 1) -> str:
    """A share as the tables have it."""
    return formatted(share, f".{digits}%")


def accuracy() -> str:
    """Accuracy of the two trained classifiers by test set."""
    answered, views, splat = (
        load(f"{name}") for name in ("measure_accuracy_small", "train_classifier_small", "train_classifier_mambasplat")
    )
    folders = {name.rpartition("/")[2]: row for name, row in answered["folders"].items()}
    far = answered["distance_64_to_280_m"][0]
    rows = [("Sim-1, Sim-2 and random networks", answered["all"], splat["tests"]["all"]["accuracy"])]
    rows += [(name, folders[name], splat["tests"][name]["accuracy"]) for name in ("sim1", "sim2", "random")]
    alone = {"clips": views["tests"]["sim3"]["clips"], "accuracy": views["tests"]["sim3"]["accuracy"]}
    rows.append(("sim3, of the clips that there are", alone, splat["tests"]["sim3"]["accuracy"]))
    right = splat["tests"]["sim3"]["accuracy"] * splat["tests"]["sim3"]["clips"]
    rows.append(("sim3, of all sequences", folders["sim3"], right / folders["sim3"]["clips"]))
    rows.append((f"{far['low']:g} to {far['high']:g} m, of all rigs", far, None))

    def line(name: str, row: dict[str, Any], other: float | None) -> list[object]:
        low, high = row.get("interval_95", (None, None))
        interval = "" if low is None else f"{100 * low:.0f} to {100 * high:.0f}"
        return [name, row["clips"], percent(row["accuracy"]), interval, "" if other is None else percent(other)]

    return markdown(["test set", "clips", "views", "95 %", "mambasplat"], (line(*row) for row in rows))


def confusion() -> str:
    """Answers of the default weights by class."""
    found = load("train_classifier_small")
    names, test = found["classes"], found["test"]
    rows = [
        [f"**{name}**", *row, percent(recall)]
        for name, row, recall in zip(names, test["confusion"], test["recall"], strict=True)
    ]
    return markdown(["truth, answer", *names, "recall"], rows)


def _spread(figure: dict[str, float | None]) -> str:
    """Mean and deviation over seeds, in %."""
    mean, std = figure["mean"], figure["std"]
    return "" if mean is None else f"{100 * mean:.1f}" + ("" if std is None else f" ± {100 * std:.1f}")


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
        rows.append([span, row["clips"], row["missing"], percent(row["accuracy"]), _between(*row["interval_95"])])
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
        protocols = {_spread(figure) for figure in row["protocols"].values()}
        cells = [_spread(row[key]) for key in ("last_frame", "gain")]
        rows.append([f"`{row['classifier']}`", f"{row['parameters']:,}", " / ".join(sorted(protocols)), *cells])
    return markdown(["classifier", "parameters", "whole window, all protocols", "last frame alone", "gain"], rows)


def _between(low: float, high: float, how: str = ".0f") -> str:
    return f"({100 * low:{how}} to {100 * high:{how}})"


def steps() -> str:
    """The ablation, one network at a time."""
    rows = []
    for row in load("compare_classifiers_steps")["rows"]:
        tests, gap = row["tests"], row["difference"]
        less = "" if gap is None else f"{100 * gap['accuracy']:+.1f} {_between(gap['low'], gap['high'], '+.1f')}"
        whole = f"{_spread(tests['all']['accuracy'])} {_between(*tests['all']['interval_95'])}"
        clips = f"{row['training_clips']:,} of {row['training_identities']:,}"
        against = f"`{row['against']}`" if row["against"] else ""
        far = [_spread(tests[name]["accuracy"]) for name in ("sim1", "sim2", "random", "sim3")]
        rows.append([f"`{row['classifier']}`", against, row["change"], clips, len(row["seeds"]), whole, less, *far])
    head = ["row", "against", "what changes", "clips of individuals", "seeds", "all, %", "difference"]
    return markdown([*head, "sim1", "sim2", "random", "sim3"], rows)


def networks() -> str:
    """MambaSplat-4D beside other networks: turned windows, and whole clips less those of E(X)."""
    rows = []
    for row in load("compare_classifiers_baselines")["rows"]:
        turned = [_spread(row["turned"][kind]) for kind in ("none", "z", "so3", "so3_per_frame")]
        whole, gap = row["tests"]["all"], row["difference"]
        clips = f"{_spread(whole['accuracy'])} {_between(*whole['interval_95'])}"
        less = "" if gap is None else f"{100 * gap['accuracy']:+.1f} {_between(gap['low'], gap['high'], '+.1f')}"
        about = row["label"], f"{row['parameters']:,}", row["trained"], len(row["seeds"])
        rows.append([f"`{row['classifier']}`", *about, *turned, clips, less])
    head = ["row", "network", "parameters", "trained", "seeds", "none", "z", "SO(3)", "SO(3) a frame", "whole clips, %"]
    return markdown([*head, "less `E_X`"], rows)


def ensembles() -> str:
    """The ablation's networks averaged over their seeds, and calibration with and without a temperature."""
    rows = []
    for row in load("compare_classifiers_steps")["rows"]:
        one, several = row["tests"]["all"], row["averaged"]["tests"]
        cells = [f"{100 * one['accuracy']['mean']:.1f}", row["averaged"]["networks"]]
        cells += [f"{100 * several['all']['accuracy']:.1f} {_between(*several['all']['interval_95'])}"]
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
            shares = [f"{100 * row['accuracy']:.1f} {_between(row['low'], row['high'])}" for row in (first, whole)]
            cost = f"{100 * lost['accuracy']:+.1f} {_between(lost['low'], lost['high'], '+.1f')}"
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


def reconstructors() -> str:
    """Reconstructors by the views that they were not given: each figure of the hull, then of the refined hull."""
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for row in load("eval_reconstructor_small")["rows"]:
        found.setdefault((row["factor"], row["value"]), {})[row["member"]] = row
    figures = {
        "psnr_db": ".1f",
        "surround_psnr_db": ".1f",
        "full_psnr_db": ".1f",
        "iou": ".2f",
        "chamfer_percent": ".1f",
    }
    rows = []
    for (factor, value), members in found.items():
        pairs = [" → ".join(f"{members[who][key]:{how}}" for who in ("hull", "refine")) for key, how in figures.items()]
        what = value if value.startswith(("test", factor)) else f"{factor}: {value}"
        rows.append([what, members["hull"]["scenes"], *pairs, f"{members['constant']['psnr_db']:.1f}"])
    head = ["condition", "scenes", "PSNR on the object, dB", "and around it", "whole image", "IoU", "Chamfer, %"]
    return markdown([*head, "constant depth, dB"], rows)


def consistency() -> str:
    """Agreement of annotations by rig, beside the published figures."""
    thesis, rows = load("published")["annotations"], []
    for row in load("describe_dataset_small")["consistency"]:
        best, iou = row["iou_subpixel"], f"{row['iou']['median']:.3f}"
        known = thesis.get(row["rig"], {"iou": "", "residual_px": ""})
        spread = f"{best['median']:.3f} ({best['p5']:.3f} to {best['p95']:.3f})"
        grid, residual = f"{row['iou_grid']['median']:.3f}", f"{row['residual']['median']:.3f}"
        rows.append([row["rig"], row["views"], spread, iou, grid, known["iou"], residual, known["residual_px"]])
    head = ["rig", "views", "IoU of visible and projected box, median (p5 to p95)", "of the mask's whole pixels"]
    return markdown([*head, "best that whole pixels allow", "thesis", "centroid residual, px", "thesis"], rows)


def generator() -> str:
    """Speed of the generator."""
    found, rows = load("benchmark_simulator")["simulator"], []
    two = {(row["rig"], row["preset"]): row["two_images_per_s"] for row in found["two_workers"]}
    for row in found["throughput"]:
        cost = row["cpu_ms_an_image"]
        costs = (cost["cast"], cost.get("landscape", 0), cost["encode"] + cost["write"])
        pair = two.get((row["rig"], row["preset"]))
        rates = (f"{row['images_per_s']:.1f}", "" if pair is None else f"{pair:.1f}")
        rows.append([row["rig"], row["preset"], *rates, ", ".join(f"{part:.0f}" for part in costs)])
    return markdown(["rig", "preset", "images/s", "two processes", "ms an image: rays, landscape, files"], rows)


def blender() -> str:
    """Times of the renderer beside Cycles by distance."""
    rows = load("benchmark_blender")["blender"]["rows"]
    table = []
    for radius in sorted({row["radius_m"] for row in rows}):
        some = [row for row in rows if row["radius_m"] == radius]
        ious = [row["agreement"]["mask_iou"] for row in some]
        for name in ("times_faster", "times_faster_than_cycles_of_4_samples"):
            times = [row[name] for row in some]
            label = "16 samples" if name == "times_faster" else "4 samples"
            table.append([f"{radius} m", label, f"{min(times):.1f} to {max(times):.1f}", f"{min(ious):.3f}"])
    return markdown(["distance", "Cycles with", "times faster", "least IoU of the masks"], table)


def fits() -> str:
    """Held-out views of fitted Gaussians and of the hull that the fit starts from: every capture that was tried."""
    rows = []
    for row in load("fit_gaussians")["fits"]:
        fitted, hull = (row[f"{name}_held_out_view"]["foreground_psnr_db"] for name in ("fitted", "hull"))
        change = f"{fitted - hull:+.1f}"
        rows.append([row["capture"], row["fitting_views"], row["matte"], f"{fitted:.1f}", f"{hull:.1f}", change])
    return markdown(["capture", "fitted views", "matte", "fit, dB", "hull, dB", "change"], rows)


def torch() -> str:
    """The classifier beside PyTorch: the exact variant, and the published one, which has PyTorch's sizes."""
    table = []
    for row in load("benchmark_classifier")["classifier"]["rows"]:
        call = f"{'training step' if row['act'] == 'step' else row['act']}, {row['frames']} × {row['tokens']}"
        for name in ("published", "exact"):
            for other, label in (("torch", "eager"), ("torch_flash", "fused attention")):
                times = f"{row[f'{name}_over_{other}']['times_faster']:.2f}"
                seconds = [f"{row[key]['wall_s']:.3g} s" for key in (name, other)]
                memory = [f"{row[key]['call_mb']:,.0f} ({row[key]['process_mb']:,.0f})" for key in (name, other)]
                table.append([call, f"`{name}`", label, *seconds, times, *memory])
    head = ["call, frames × tokens", "ours", "PyTorch", "ours", "PyTorch", "times faster", "ours, MB", "PyTorch, MB"]
    return markdown(head, table)


def endurance() -> str:
    """What was killed, soaked and fuzzed, as far as there are results."""
    there, rows = {path.stem for path in (ROOT / "results").glob("*.json")}, []
    if "measure_kills" in there:
        found = load("measure_kills")
        for row in found["acts"]:
            said = f"{row['byte_equal']} of {row['kills']} ended with the same bytes; {len(row['failures'])} failures"
            rows.append([f"`{row['act']}`: SIGKILL at random moments, a full disk, a read-only folder", said])
    if "measure_soak" in there:
        found = load("measure_soak")
        windows, growth = found["windows"], found["growth_in_10000_frames"]
        said = f"{windows[1]['step_ms']:.1f} ms a step at the begin, {windows[-1]['step_ms']:.1f} at the end; "
        said += f"{windows[-1]['resident_mb']:,.0f} MB, {growth['resident_mb']:+.2f} MB in 10,000 frames; "
        said += f"{windows[-1]['handles']} handles, {windows[1]['handles']} at the begin; "
        said += f"a probability at the same frame of the loop moves by at most {formatted(found['drift'], '.0e')}"
        rows.append([f"a stream of {found['frames']:,} frames, {found['cameras']} small cameras", said])
    if "fuzz" in there:
        found = load("fuzz")
        said = f"{len(found['findings'])} findings"
        rows.append([f"{found['inputs']:,} damaged files of {len(found['read'])} formats, seed {found['seed']}", said])
    return markdown(["what", "result"], rows) if rows else "Not measured yet."


def live() -> str:
    """What `serve` takes from a frame's pictures to its tracks."""
    if not (ROOT / "results/benchmark_live.json").exists():
        return "Not measured yet."
    rows = []
    for row in load("benchmark_live")["live"]["rows"]:
        asked, spent = row["asked_per_s"], row["frame_to_track_ms"]
        played = f"{asked:g} a second" if asked else "as fast as it goes"
        times = ["-", "-"] if spent is None else [f"{spent[key]:.0f}" for key in ("p50", "p95")]
        rows.append([row["name"], played, f"{row['frames_per_s']:.1f}", *times, row["dropped"], row["resident_mb"]])
    head = ["segment", "played", "frames a second", "ms, median", "ms, 95 %", "dropped", "MB"]
    return markdown(head, rows)


TRACKED = {
    "tracks": "detections, one clock",
    "stagger": "detections, a phase for each camera",
    "clocks": "detections, wrong clocks, as found",
    "masks": "masks of captures, frame by frame",
}
"""Rows of measure_tracking with figures of tracks."""


def _tracked() -> dict[str, Any]:
    """Summaries by kind, of detections and of masks, as far as there are results."""
    there = {path.stem for path in (ROOT / "results").glob("*.json")}
    names = [name for name in ("measure_tracking", "measure_tracking_masks") if name in there]
    return {kind: row for name in names for kind, row in load(name)["summary"].items()}


def several() -> str:
    """Tracks of several objects: the middle scene, and the worst one in brackets."""
    found = _tracked()

    def cell(row: dict[str, Any], key: str, how: str) -> str:
        return f"{row[key]['median']:{how}} ({row[key]['worst']:{how}})"

    figures = {"idf1": ".3f", "gospa": ".2f", "rmse": ".3f", "ghosts": ".1f", "switches": ".0f"}
    rows = [
        [name, found[kind]["scenes"], *(cell(found[kind], key, how) for key, how in figures.items())]
        for kind, name in TRACKED.items()
        if kind in found
    ]
    head = ["tracks of", "scenes", "IDF1", "GOSPA, m", "RMSE, m", "ghosts in 100", "changed numbers"]
    return markdown(head, rows) if rows else "Not measured yet."


def corrected() -> str:
    """What is found of wrong clocks and poses."""
    found, rows = _tracked(), []
    names = {
        "offset_error_ms": "clock of the worst camera off by, ms",
        "offset_error_ends_ms": "the same at the recording's ends, ms",
        "rmse_ratio": "RMSE over that of perfect clocks",
        "rotation_error_deg": "rotation of the worst camera off by, °",
        "position_error_m": "position of the worst camera off by, m",
        "off_px": "sights of the worst camera off by, as given, pixels",
        "then_px": "and as found, pixels",
    }
    scenes = {"clocks": "wrong clocks", "poses": "a wrong pose", "masks_poses": "a wrong pose, by masks"}
    for kind, name in scenes.items():
        some = found.get(kind, {})
        for key in (key for key in names if key in some):
            rows.append([name, names[key], f"{some[key]['median']:.3g}", f"{some[key]['worst']:.3g}"])
    return markdown(["scenes", "figure", "median", "worst"], rows) if rows else "Not measured yet."


def track_labels() -> str:
    """Answers of tracks: as they are, and with a camera that is wrong and corrected."""
    found, rows = _tracked(), []
    sets = {"tracks of all captures": found.get("masks", {}).get("answers")}
    wrong = found.get("masks_poses", {}).get("answers", {})
    for key, name in (("true", "of some, cameras right"), ("given", "one is wrong"), ("found", "and is corrected")):
        sets[name] = wrong.get(key)
    for name, row in sets.items():
        if row is not None:
            cells = [row[key] for key in ("tracks", "answered", "right", "sure", "sure_right", "unknown")]
            rows.append([name, *cells])
    head = ["", "tracks", "with a likeliest class", "right", "with a class as answer", "right", "called unknown"]
    return markdown(head, rows) if rows else "Not measured yet."


def _tree(commit: str) -> str:
    """What is known of the tree: acts write whole names of commits, hands wrote short ones."""
    if "+" in commit:
        return "with changes"
    return "clean" if len(commit) == 40 else "not recorded"


def origins() -> str:
    """What made each file of results/, and whether its tree was clean."""
    rows = []
    for path in sorted((ROOT / "results").glob("*.json")):
        found = load(path.stem)
        commits = [str(c) for c in found.get("commits", [found.get("commit")])]
        commands = found.get("commands", [found.get("command")])
        known = ", ".join(c.partition("+")[0][:7] for c in dict.fromkeys(commits) if c != "None")
        note = str(found.get("note", "")).replace("|", "/")
        said = "; ".join(f"`{command}`" for command in commands)
        rows.append(
            [
                f"`{path.name}`",
                said,
                str(found.get("date", ""))[:10],
                known,
                " and ".join(sorted(set(map(_tree, commits)))),
                note,
            ]
        )
    return markdown(["file", "command", "date", "commit", "tree", "note"], rows)


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
        shares = [percent(row[key]) for key in ("accuracy", "accuracy_of_answered", "known_called_unknown")]
        rows.append(["factory" if name == "all" else name, row["clips"], *areas, *shares])
    head = [
        "clips of the classes",
        "number",
        "AUROC",
        "of the probability alone",
        "ECE",
        "right",
        "right of the others",
    ]
    return markdown([*head, "called unknown"], rows)


def plots() -> dict[str, str]:
    """Plots of the figures, by their places in docs/."""
    found = load("measure_frames_small")
    tables = {"steps": "compare_classifiers_steps", "networks": "compare_classifiers_baselines"}
    drawn = {f"plots/{name}.svg": comparison_svg(load(table)["rows"]) for name, table in tables.items()}
    for model in found["models"]:
        every = temporal_plots(model["name"], model, found["classes"])
        drawn |= {f"plots/{name}_{model['name']}.svg": every[name] for name in ("frames", "shuffled")}
    return drawn


TABLES: dict[str, Callable[[], str]] = {
    function.__name__: function
    for function in (
        accuracy,
        confusion,
        tolerances,
        widths,
        ranges,
        features,
        steps,
        networks,
        ensembles,
        rotations,
        frames,
        moving,
        attributes,
        reconstructors,
        consistency,
        generator,
        blender,
        fits,
        torch,
        endurance,
        live,
        several,
        corrected,
        track_labels,
        unknown,
        unknown_by_set,
        origins,
    )
}


if __name__ == "__main__":
    for name in PAGES:
        (DOCS / name).write_text(made(name), encoding="utf-8")
    for place, text in plots().items():
        (DOCS / place).write_text(text, encoding="utf-8")
    README.write_text(readme(README.read_text(encoding="utf-8")), encoding="utf-8")
    print(*(DOCS / name for name in PAGES), README, sep="\n")
