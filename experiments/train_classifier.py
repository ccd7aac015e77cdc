"""Train a classifier on simulated identities and measure it on identities that training never saw."""

from __future__ import annotations

from experiments._launch.classifier_training import ClassifierTraining, train_and_keep
from experiments._launch.command import Run, experiment


@experiment(ClassifierTraining, finished_by="metrics.json")
def main(config: ClassifierTraining, run: Run) -> None:
    """Train, test, and write weights with their card."""
    train_and_keep(config, run)


if __name__ == "__main__":
    main()
