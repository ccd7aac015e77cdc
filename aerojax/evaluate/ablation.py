"""The rows of an ablation, from what each run of each row answered: one network alone, and all seeds averaged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aerojax.core.types import CLASSES
from aerojax.evaluate.bootstrap import accuracy, paired_interval
from aerojax.evaluate.calibration import calibration_error, fit_temperature, with_temperature
from aerojax.evaluate.groups import (
    WIDTH_EDGES,
    AnsweredClips,
    answer_figures,
    confusions,
    figures_by_number,
    join_answers,
)
from aerojax.evaluate.markdown import mean_cell, table_lines

VALIDATION = "val"
"""Name of the validation clips' answers; test clips go by the name of their folder."""
HEAD = ("change", "against", "member", "label", "parameters", "frames", "tokens", "training_clips")
HEAD += ("training_identities", "steps")
"""What the runs of a row have in common."""

Parts = Mapping[str, AnsweredClips]


def answers_to_json(answers: AnsweredClips) -> dict[str, Any]:
    """Everything, six digits of the log-probabilities."""
    return {
        "label": answers.label.tolist(),
        "identity": list(answers.identity),
        "facts": [dict(facts) for facts in answers.facts],
        "exists": answers.exists.tolist(),
        "log_probabilities": np.round(answers.log_probabilities, 6).tolist(),
    }


def answers_from_json(raw: Mapping[str, Any]) -> AnsweredClips:
    """Inverse of `answers_to_json`."""
    return AnsweredClips(
        np.array(raw["label"], np.int64),
        tuple(raw["identity"]),
        tuple(raw["facts"]),
        np.array(raw["log_probabilities"], np.float64).reshape(-1, len(CLASSES)),
        np.array(raw["exists"], bool),
    )


def averaged(parts: Sequence[AnsweredClips]) -> AnsweredClips:
    """The mean of several classifiers' probabilities of the same clips."""
    mean = np.mean([np.exp(part.log_probabilities) for part in parts], axis=0)
    return replace(parts[0], log_probabilities=np.log(mean))


def ablation_rows(runs: Sequence[Mapping[str, Any]], *, seed: int = 0, draws: int = 2000) -> list[dict[str, Any]]:
    """One row a classifier, each behind the row that it is held against.

    Args:
        runs: contents of `comparison.json` of the rows `steps`, each of another classifier or seed.
        seed, draws: of the bootstrap over individuals.

    Returns:
        JSON-ready rows: `tests` of one network by folder and of all `counted` together, `difference` to the row that a
        row is held against on the same individuals, and `averaged`, the figures of all seeds' averaged answers.
    """
    groups = {name: [run for run in runs if run["classifier"] == name] for name in _in_order(runs)}
    answers = {name: [_parts(run) for run in group] for name, group in groups.items()}
    rows = []
    for name, group in groups.items():
        first, other = group[0], answers.get(group[0]["against"])
        rows.append(
            {
                "classifier": name,
                **{key: first[key] for key in HEAD},
                "seeds": sorted(run["seed"] for run in group),
                "minutes": float(np.mean([run["minutes"] for run in group])),
                "tests": _single_figures(answers[name], seed, draws),
                "averaged": _averaged_figures(answers[name], seed, draws),
                "difference": None if other is None else _difference(answers[name], other, seed, draws),
            }
        )
    return rows


def _in_order(runs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Names of rows: those held against nothing that is there, and behind each those that are held against it."""
    against = {run["classifier"]: run["against"] for run in runs}

    def behind(name: str) -> list[str]:
        return [name, *(one for other, held in against.items() if held == name for one in behind(other))]

    return [one for name, held in against.items() if held not in against for one in behind(name)]


def _parts(run: Mapping[str, Any]) -> dict[str, AnsweredClips]:
    found = {name: answers_from_json(raw) for name, raw in run["answers"].items()}
    return {"all": join_answers([found[name] for name in run["counted"]]), **found}


def _calibration(parts: Parts, name: str) -> dict[str, float | None]:
    """Calibration error of the clips that exist, as answered and with the temperature of the validation clips."""
    val, asked = parts[VALIDATION], parts[name]
    if not asked.exists.any():
        return {"ece": None, "ece_with_temperature": None}
    temperature = fit_temperature(val.log_probabilities, val.label)
    rows, label = asked.log_probabilities[asked.exists], asked.label[asked.exists]
    mended = calibration_error(with_temperature(rows, temperature), label)
    return {"ece": calibration_error(rows, label), "ece_with_temperature": mended}


def _single_figures(seeds: Sequence[Parts], seed: int, draws: int) -> dict[str, dict[str, Any]]:
    """Of one network: means and sample deviations over the seeds; the interval is of the mean, over individuals."""
    rows = {}
    for name in seeds[0]:
        whole = answer_figures(join_answers([parts[name] for parts in seeds]), seed=seed, draws=draws)
        each = [float(np.mean(parts[name].predicted == parts[name].label)) for parts in seeds]
        errors = [_calibration(parts, name) for parts in seeds]
        rows[name] = {
            "clips": len(seeds[0][name].label),
            **{key: whole[key] for key in ("identities", "interval_95", "recall")},
            "accuracy": over_seeds(each),
            **{key: over_seeds([row[key] for row in errors]) for key in ("ece", "ece_with_temperature")},
        }
    return rows


def _averaged_figures(seeds: Sequence[Parts], seed: int, draws: int) -> dict[str, Any]:
    together = {name: averaged([parts[name] for parts in seeds]) for name in seeds[0]}
    val, ask = together[VALIDATION], {"seed": seed, "draws": draws}
    return {
        "networks": len(seeds),
        "temperature": fit_temperature(val.log_probabilities, val.label),
        "tests": {name: answer_figures(one, **ask) | _calibration(together, name) for name, one in together.items()},
        "width_px": figures_by_number(together["all"], "width_px", WIDTH_EDGES, **ask),
    }


def _difference(ours: Sequence[Parts], theirs: Sequence[Parts], seed: int, draws: int) -> dict[str, float]:
    """Accuracy of one network on all counted clips less that of the other row, with the paired interval."""
    first, second = (np.sum([confusions(parts["all"]) for parts in seeds], axis=0) for seeds in (ours, theirs))
    low, high = paired_interval(first, second, accuracy, seed=seed, draws=draws)
    return {"accuracy": float(accuracy(first.sum(0)) - accuracy(second.sum(0))), "low": low, "high": high}


def over_seeds(values: Sequence[float | None]) -> dict[str, float | None]:
    """Mean and standard deviation of what is known; None where there is too little for it."""
    known = [value for value in values if value is not None]
    if not known:
        return {"mean": None, "std": None}
    return {"mean": float(np.mean(known)), "std": float(np.std(known, ddof=1)) if len(known) > 1 else None}


def ablation_markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows as two Markdown tables: one network, and all seeds averaged. Figures in % of clips or sequences."""
    folders = [name for name in rows[0]["tests"] if name not in ("all", VALIDATION)]
    lines = [
        "One network; mean ± standard deviation over seeds; in brackets the 95 % interval over individuals, of a",
        "difference on the same ones. ECE: calibration error, and with the temperature of the validation clips.",
        "",
        *table_lines(
            ["row", "what changes", "clips of individuals", "all, %", "less the row before", *folders], map(_one, rows)
        ),
        "",
        "The same networks' answers averaged over the seeds:",
        "",
        *table_lines(["row", "networks", "all, %", *folders, "ECE of one", "ECE averaged"], map(_several, rows)),
    ]
    return "\n".join(lines) + "\n"


def _one(row: Mapping[str, Any]) -> list[str]:
    tests, gap = row["tests"], row["difference"]
    low, high = tests["all"]["interval_95"]
    folders = [mean_cell(one["accuracy"]) for name, one in tests.items() if name not in ("all", VALIDATION)]
    change = (
        "" if gap is None else f"{100 * gap['accuracy']:+.1f} ({100 * gap['low']:+.1f} to {100 * gap['high']:+.1f})"
    )
    return [
        row["classifier"],
        row["change"],
        f"{row['training_clips']:,} of {row['training_identities']:,}",
        f"{mean_cell(tests['all']['accuracy'])} ({100 * low:.0f} to {100 * high:.0f})",
        change + (f" than {row['against']}" if change else ""),
        *folders,
    ]


def _several(row: Mapping[str, Any]) -> list[str]:
    tests, single = row["averaged"]["tests"], row["tests"]["all"]
    low, high = tests["all"]["interval_95"]
    return [
        row["classifier"],
        str(row["averaged"]["networks"]),
        f"{100 * tests['all']['accuracy']:.1f} ({100 * low:.0f} to {100 * high:.0f})",
        *(f"{100 * one['accuracy']:.1f}" for name, one in tests.items() if name not in ("all", VALIDATION)),
        f"{single['ece']['mean']:.3f}, {single['ece_with_temperature']['mean']:.3f}",
        f"{tests['all']['ece']:.3f}, {tests['all']['ece_with_temperature']:.3f}",
    ]
