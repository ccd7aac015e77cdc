"""Describe data sets: composition, consistency of the annotations, coverage, motion, and leakage between splits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.evaluate.dataset_qa.survey import SurveyConfig, survey_datasets
from aerojax.view.dataset.files import write_description
from aerojax.view.dataset.summary import summary
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config(SurveyConfig):
    """What to describe.

    dataset: folders of generated data sets.
    """

    preset: str
    dataset: tuple[Path, ...]


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Read the data sets and write description.json, description.md, description.html and figures/."""
    with progress_bar() as bar:
        found = survey_datasets(config.dataset, config, shown_in(bar))
    page = write_description(found, run.directory)
    Console().print(summary(found), highlight=False, soft_wrap=True)
    Console().print(str(page), soft_wrap=True)


if __name__ == "__main__":
    main()
