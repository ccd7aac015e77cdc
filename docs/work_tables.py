"""Tables of everything else: the simulator, reconstructors, tracks, cost, and where each result comes from."""

from __future__ import annotations

from typing import Any

from result_cells import ABSENT, ROOT, formatted, load, markdown, measured

from aerojax.core.provenance import command_of_result


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
    rows = []
    if measured("measure_kills"):
        found = load("measure_kills")
        for row in found["acts"]:
            said = f"{row['byte_equal']} of {row['kills']} ended with the same bytes; {len(row['failures'])} failures"
            rows.append([f"`{row['act']}`: SIGKILL at random moments, a full disk, a read-only folder", said])
    if measured("measure_soak"):
        found = load("measure_soak")
        windows, growth = found["windows"], found["growth_in_10000_frames"]
        said = f"{windows[1]['step_ms']:.1f} ms a step at the begin, {windows[-1]['step_ms']:.1f} at the end; "
        said += f"{windows[-1]['resident_mb']:,.0f} MB, {growth['resident_mb']:+.2f} MB in 10,000 frames; "
        said += f"{windows[-1]['handles']} handles, {windows[1]['handles']} at the begin; "
        said += f"a probability at the same frame of the loop moves by at most {formatted(found['drift'], '.0e')}"
        rows.append([f"a stream of {found['frames']:,} frames, {found['cameras']} small cameras", said])
    if measured("measure_soak_serve"):
        rows.append(_served(load("measure_soak_serve")))
    if measured("fuzz"):
        found = load("fuzz")
        said = f"{len(found['findings'])} findings"
        rows.append([f"{found['inputs']:,} damaged files of {len(found['read'])} formats, seed {found['seed']}", said])
    return markdown(["what", "result"], rows) if rows else ABSENT


def _served(found: dict[str, Any]) -> list[str]:
    first, last, grown = found["windows"][1], found["windows"][-1], found["growth_in_10000_frames"]["resident_mb"]
    said = f"{first['processor_ms']:.1f} ms of processor time a frame at the begin, {last['processor_ms']:.1f} at the "
    said += f"end; {last['resident_mb']:,.0f} MB, {grown:+.2f} MB in 10,000 frames; {last['handles']} handles, "
    said += (
        f"{first['handles']} at the begin; {last['begun']:,} tracks that came and went; {found['dropped']} frames and "
    )
    said += f"{sum(found['failed_sends'].values())} messages lost"
    return [f"`serve` over {found['frames']:,} frames, {found['cameras']} small cameras, without masks", said]


def live() -> str:
    """What `serve` takes from a frame's pictures to its tracks."""
    if not measured("benchmark_live"):
        return ABSENT
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
CORRECTED = (
    ("wrong clocks", "measure_tracking", "clocks"),
    ("a wrong pose, by detections", "measure_tracking", "poses"),
    ("a wrong pose, by masks of two seconds", "measure_tracking_masks", "masks_poses"),
    ("a wrong pose, by masks of six seconds", "measure_tracking_masks_long", "masks_poses"),
)
"""Scenes with something wrong, the result that has them, and the kind of its rows."""


def _tracked() -> dict[str, Any]:
    """Summaries by kind, of detections and of masks, as far as there are results."""
    names = filter(measured, ("measure_tracking", "measure_tracking_masks"))
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
    return markdown(head, rows) if rows else ABSENT


def corrected() -> str:
    """What is found of wrong clocks and poses."""
    rows: list[list[str]] = []
    names = {
        "offset_error_ms": "clock of the worst camera off by, ms",
        "offset_sigma_ms": "its standard deviation as reported, ms",
        "offset_bound_ms": "and at best, ms",
        "offset_over_sigma": "error over what is reported",
        "offset_error_ends_ms": "clock of the worst camera at the recording's ends, ms",
        "rmse_ratio": "RMSE over that of perfect clocks",
        "rotation_error_deg": "rotation of the worst camera off by, °",
        "position_error_m": "position of the worst camera off by, m",
        "changed": "cameras that are corrected",
        "pose_over_sigma": "error over what is reported",
        "off_px": "sights of the worst camera off by, as given, pixels",
        "then_px": "and as found, pixels",
    }
    for scenes, file, kind in (one for one in CORRECTED if measured(one[1])):
        found = load(file)
        some = found["summary"].get(kind, {})
        for key in (key for key in names if key in some):
            rows.append([scenes, names[key], f"{some[key]['median']:.3g}", f"{some[key]['worst']:.3g}"])
        if "rotation_error_deg" in some:
            errors = [(row["rotation_error_deg"], row["position_error_m"]) for row in found["rows"][kind]]
            within = [angle <= 0.05 and distance <= 0.03 for angle, distance in errors]
            rows.append([scenes, "scenes within 0.05° and 0.03 m", f"{sum(within)} of {len(within)}", ""])
    return markdown(["scenes", "figure", "median", "worst"], rows) if rows else ABSENT


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
    return markdown(head, rows) if rows else ABSENT


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
        commands = found.get("commands", [command_of_result(found)])
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
