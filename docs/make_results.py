"""Write docs/{results,limits,scale}.md and the results in README.md: templates filled with figures of results/*.json.

    make docs

A template holds `{{file path format}}`: a file of results/ (or docs/published.json) without its end, a path into it and
how the value is written; `{{table name}}` is one of `TABLES`. Paths are those of `aerojax.evaluate.result_paths`.
Formats are those of Python; `.1%` puts a space before the sign and `.1e` writes a power of ten.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable

from mask_tables import consensus, consensus_plots, found_masks
from result_cells import DOCS, ROOT, formatted, load
from result_tables import (
    accuracy,
    attributes,
    confusion,
    ensembles,
    features,
    frames,
    moving,
    networks,
    networks_by_folder,
    on_hulls_and_refined,
    ranges,
    rotations,
    sizes,
    steps,
    studies,
    tolerances,
    unknown,
    unknown_by_set,
    widths,
)
from scale_tables import scale_costs
from work_tables import (
    blender,
    consistency,
    corrected,
    endurance,
    fits,
    generator,
    live,
    origins,
    reconstructors,
    several,
    torch,
    track_labels,
)

from aerojax.evaluate.result_paths import lookup
from aerojax.view.comparison import comparison_svg
from aerojax.view.temporal import temporal_plots

TEMPLATES = DOCS / "templates"
PAGES = "results.md", "limits.md", "scale.md"
README = ROOT / "README.md"
BEGIN, END = "<!-- results: made by `make docs` from docs/templates/readme.md -->", "<!-- end of results -->"
WIDTH = 120
"""Characters of a line of prose."""
PLACE = re.compile(r"\{\{(.+?)\}\}")


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


def plots() -> dict[str, str]:
    """Plots of the figures, by their places in docs/."""
    found = load("measure_frames_small")
    tables = {
        "steps": "compare_classifiers_steps",
        "studies": "compare_classifiers_studies",
        "networks": "compare_classifiers_baselines",
    }
    drawn = {f"plots/{name}.svg": comparison_svg(load(table)["rows"]) for name, table in tables.items()}
    for model in found["models"]:
        every = temporal_plots(model["name"], model, found["classes"])
        drawn |= {f"plots/{name}_{model['name']}.svg": every[name] for name in ("frames", "shuffled")}
    return drawn | consensus_plots()


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
        studies,
        sizes,
        networks,
        networks_by_folder,
        ensembles,
        rotations,
        frames,
        moving,
        attributes,
        reconstructors,
        on_hulls_and_refined,
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
        found_masks,
        consensus,
        unknown,
        unknown_by_set,
        scale_costs,
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
