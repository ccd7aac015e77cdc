"""Tables of a data set's description: the thesis' Tables 6.3 and 6.4, causes, motion and leakage."""

from __future__ import annotations

from aerojax.core.types import CLASSES
from aerojax.evaluate.dataset_qa.consistency import IOU_LIMIT, RESIDUAL_LIMIT, Cause, Consistency, Spread
from aerojax.evaluate.dataset_qa.description import Description
from aerojax.evaluate.dataset_qa.leakage import Leakage, verdict
from aerojax.view.dataset.tables import Table, number

PUBLISHED = {
    "sim1": ("0.739 (0.273–1.000)", "3.34 (0.53–105.49)", "2.62 (1.85–4.13)"),
    "sim2": ("0.768 (0.349–0.967)", "2.92 (0.60–11.78)", "1.07 (1.01–1.47)"),
    "sim3": ("0.500 (0.000–1.000)", "1.38 (0.37–27.61)", "1.01 (1.01–1.05)"),
}
"""Table 6.4 of the thesis, on its own data."""


def tables_of(description: Description) -> tuple[Table, ...]:
    """All tables, in the order of the thesis."""
    found = [_composition(description), _agreement(description), _other_residuals(description)]
    for row in description.consistency:
        found += [_causes(row), _sides(row)]
    return (*found, _motion(description), *_leakage(description.leakage))


def _spread(spread: Spread, digits: int = 3) -> str:
    if not spread.count:
        return "–"
    return f"{spread.median:.{digits}f} ({spread.p5:.{digits}f}–{spread.p95:.{digits}f})"


def _composition(description: Description) -> Table:
    header = ("rig", "split", "identities", "sequences", "frames", *CLASSES, "H/Hmax", "Gini-Simpson")
    rows = tuple(
        (
            row.rig,
            row.split,
            *(str(n) for n in (row.identities, row.sequences, row.frames, *row.frames_by_class)),
            number(row.entropy_ratio),
            number(row.gini),
        )
        for row in description.compositions
    )
    note = (
        "Frames are moments, not images. 1 and 0.75 are the values of equal classes. The Gini-Simpson index 1 − Σp² is "
        "what the thesis prints as Gini coefficient (Table 6.3: 0.722 to 0.735); it grows with balance."
    )
    return Table("Composition", note, header, rows)


def _agreement(description: Description) -> Table:
    header = ("rig", "views", "truncated", "faint", "missed", "IoU of boxes", "residual, px", "smoothness", "at rest")
    rows = []
    for row in description.consistency:
        counts = tuple(str(n) for n in (row.views, row.truncated, row.faint, row.missed))
        figures = (_spread(row.iou), _spread(row.residual), _spread(row.smoothness, 2))
        rows.append((row.rig, *counts, *figures, str(row.at_rest)))
        if row.rig in PUBLISHED:
            rows.append((f"{row.rig}, thesis", "", "", "", "", *PUBLISHED[row.rig], ""))
    note = (
        "Median (5th–95th percentile). IoU: tight box of the mask on disk against the box of the projected vertices. "
        "Residual: projected centroid of the visible surface against the centroid of the silhouette. Views cut by the "
        "edge of the image are counted and left out here. Faint: only the coverage image shows the object. Missed: "
        "neither that nor the mask does. The thesis' own figures are of other data and of a box around the projected "
        "centre."
    )
    return Table("Consistency of annotations", note, header, tuple(rows))


def _other_residuals(description: Description) -> Table:
    header = (
        "rig",
        "IoU, whole pixels at best",
        "IoU, sub-pixel box",
        "residual by depth, px",
        "origin, px",
        "origin, m",
        "IoU, truncated",
        "residual, truncated, px",
    )
    rows = tuple(
        (
            row.rig,
            _spread(row.iou_grid),
            _spread(row.iou_subpixel),
            _spread(row.residual_depth),
            _spread(row.origin, 2),
            _spread(row.origin_body),
            _spread(row.iou_truncated),
            _spread(row.residual_truncated, 2),
        )
        for row in description.consistency
    )
    note = (
        "Whole pixels at best: the projected box against the pixels that it touches, the limit of a box of pixels at "
        "the objects' sizes. The sub-pixel box is that of the coverage images. Weighting pixels by their depth takes "
        "the perspective out of the residual. The body's origin is not the centre of what a camera sees of the body, "
        "so its residual is a property of shapes, not an error."
    )
    return Table("Further residuals", note, header, rows)


def _causes(row: Consistency) -> Table:
    def rows(what: str, causes: tuple[Cause, ...]) -> list[tuple[str, ...]]:
        return [
            (what, c.name, str(c.views), f"{100 * c.share:.1f} %", number(c.median), c.meaning)
            for c in causes
            if c.views or c.name == "unexplained"
        ]

    boxes = rows(f"IoU < {IOU_LIMIT:g}", row.box_causes)
    residuals = rows(f"residual > {RESIDUAL_LIMIT:g} px", row.residual_causes)
    header = ("disagreement", "cause", "views", "share", "median", "meaning")
    return Table(f"Causes of disagreement, {row.rig}", "", header, (*boxes, *residuals))


def _sides(row: Consistency) -> Table:
    header = ("shorter side, px", "views", "IoU", "whole pixels at best", "IoU, sub-pixel box", "residual, px")
    rows = tuple(
        (
            f"{s.low:g} – {s.high:g}",
            str(s.views),
            _spread(s.iou),
            _spread(s.iou_grid),
            _spread(s.iou_subpixel),
            _spread(s.residual),
        )
        for s in row.by_side
    )
    return Table(f"Consistency by size in the image, {row.rig}", "", header, rows)


def _motion(description: Description) -> Table:
    header = ("class", "identities", "with a period", "period, frames", "quartiles", "strongest bin", "thesis")
    rows = tuple(
        (
            m.label,
            str(m.identities),
            str(m.periodic),
            number(m.period, 1),
            "–" if m.quartiles is None else f"{m.quartiles[0]:.1f}–{m.quartiles[1]:.1f}",
            number(m.peak, 1),
            number(m.published_period, 0),
        )
        for m in description.class_motions
    )
    note = (
        "Periods of the shape in its body's frame, from Chamfer distances between points on the posed mesh; rotors and "
        "fast wings show the alias of the frame rate. The thesis' periods are of its own models and reconstructions."
    )
    return Table("Motion", note, header, rows)


def _leakage(found: Leakage) -> tuple[Table, ...]:
    crossing = {
        "names are disjoint": found.shared_names,
        "families are disjoint": found.shared_families,
        "files are disjoint": tuple(" = ".join(names) for names in found.shared_files),
        "sequences keep to their split": found.out_of_split,
        "no held-out shape is a copy": tuple(f"{n.identity} ~ {n.nearest}" for n in found.copies),
    }
    checks = tuple((name, "yes" if ok else "NO", ", ".join(crossing[name])) for name, ok in verdict(found).items())
    distances = tuple(
        (
            row.label,
            *(number(v) for v in (*row.train_to_train, *row.test_to_train, *row.resampling, *row.ratio)),
        )
        for row in found.by_class
    )
    header = (
        "class", "train, least", "train, median", "held out, least", "held out, median", "one individual, median",
        "one individual, largest", "least ratio", "median ratio",
    )  # fmt: skip
    note = (
        "Distance of shape embeddings to the nearest training identity of the class: between different families of "
        "training, and from validation and test. One individual: two samplings of it, with other points at other "
        "phases of its motion. Ratio: a held-out identity's distance over the largest within "
        "those two individuals; at 1 or less they cannot be told apart, and the check fails."
    )
    return (
        Table("Leakage between splits", f"{found.identities} identities.", ("check", "passes", "crossing"), checks),
        Table("Shapes' nearest neighbours", note, header, distances),
    )


def summary(found: Description) -> str:
    """What matters most, in one paragraph."""
    parts = [
        f"{row.rig}: {row.views} views, IoU {row.iou.median:.3f}, residual {row.residual.median:.3f} px, "
        f"{row.box_causes[-1].views + row.residual_causes[-1].views + row.missed} unexplained"
        for row in found.consistency
    ]
    failed = [name for name, ok in verdict(found.leakage).items() if not ok]
    return "; ".join(parts) + f". Leakage: {'FAILED: ' + ', '.join(failed) if failed else 'none'}."
