"""Kills at random moments, a full disk and a folder that nobody may write to: for each the output is examined."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from aerojax.core.seeds import seed_of
from aerojax.evaluate.kills.outputs import differences, halves, marks
from aerojax.evaluate.kills.processes import Ended, run_command
from aerojax.evaluate.kills.small_disk import small_disk

Progress = Callable[[int, int, str], None]
REFUSED = 2
"""The code of an act that ends with one line."""


@dataclass(frozen=True)
class KillTarget:
    """A command that goes on where it was stopped.

    command: from the folder that it writes to, which does not exist before.
    growing: patterns of files that it replaces as it goes on. ignoring: of files that are no part of its output.
    """

    command: Callable[[Path], tuple[str, ...]]
    growing: tuple[str, ...] = ()
    ignoring: tuple[str, ...] = ()


@dataclass
class KillRow:
    """What became of one command.

    seconds: of a run that nothing disturbed.
    kills: that met it running. moments: of them, seconds after the start.
    runs: that were killed one or more times and then ended. byte_equal: kills whose run ended with the right bytes.
    failures: what was wrong, in words.
    disk_full, read_only: what the command said, or why it was not tried.
    """

    seconds: float = 0.0
    seed: int = 0
    kills: int = 0
    runs: int = 0
    byte_equal: int = 0
    moments: list[float] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    disk_full: str = ""
    read_only: str = ""


@dataclass(frozen=True)
class Trial:
    """One command under trial: where it runs, and what a run that nothing disturbed leaves.

    wanted: marks of that. seconds: it takes. size: bytes of it.
    """

    target: KillTarget
    place: Path
    root: Path
    environment: Mapping[str, str]
    wanted: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    size: int = 0

    def run(self, *, kill_after: float | None = None, whole_group: bool = False, within: str = "") -> Ended:
        """Run the command; `within` is a folder in `out` that it writes to instead."""
        command = self.target.command(self.out / within)
        how = {"kill_after": kill_after, "whole_group": whole_group}
        return run_command(command, folder=self.root, environment=self.environment, **how)  # type: ignore[arg-type]

    @property
    def out(self) -> Path:
        """Where every run writes, since outputs may name their place."""
        return self.place / "out"

    def marks(self) -> dict[str, str]:
        """What lies there."""
        return marks(self.out, ignoring=self.target.ignoring) if self.out.exists() else {}


def begin_trial(target: KillTarget, place: Path, root: Path, environment: Mapping[str, str]) -> Trial:
    """Run the command twice: once so that compiled code is kept, once to see what it leaves and how long it takes.

    Raises:
        RuntimeError: it fails by itself, or two runs that nothing disturbed differ.
    """
    trial = Trial(target, place, root, environment)
    found, ended, size = [], Ended(None, 0.0, ""), 0
    for _ in range(2):
        ended = trial.run()
        if ended.code != 0:
            raise RuntimeError(f"{' '.join(target.command(trial.out))} failed: {ended.said}")
        found.append(trial.marks())
        size = sum(path.stat().st_size for path in trial.out.rglob("*") if path.is_file())
        shutil.rmtree(trial.out)
    if wrong := differences(*found):
        raise RuntimeError(f"two runs that nothing disturbed differ: {', '.join(wrong[:5])}")
    return replace(trial, wanted=found[1], seconds=ended.seconds, size=size)


def kill_often(trial: Trial, row: KillRow, kills: int, progress: Progress) -> None:
    """Kill runs at moments that are uniform over the undisturbed duration, until they were met `kills` times.

    A run is killed, started again and killed again, until the moment that is drawn lies behind its end; then its output
    is compared. Every second kill takes the whole process group, the others the first process alone.
    """
    rng = np.random.default_rng(row.seed)
    while row.kills < kills:
        met = 0
        while row.kills < kills:
            moment = float(rng.uniform(0, trial.seconds))
            ended = trial.run(kill_after=moment, whole_group=bool(row.kills % 2))
            if ended.code is not None:
                break
            row.kills, met = row.kills + 1, met + 1
            row.moments.append(round(moment, 3))
            row.failures += [f"killed after {moment:.2f} s: {half}" for half in _halves(trial)]
            progress(row.kills, kills, "kills")
        ended = trial.run()
        wrong = _compared(ended, trial)
        row.runs += 1
        row.failures += [f"run {row.runs} after {met} kills: {one}" for one in wrong]
        row.byte_equal += 0 if wrong else met
        shutil.rmtree(trial.out, ignore_errors=True)


def fill_disk(trial: Trial, row: KillRow) -> None:
    """Run the command where half of its output fits, then where all of it does, then where nobody may write.

    The first and the last must end in one line, and the one between with the right bytes.
    """
    with small_disk(trial.out, trial.size // 2) as disk:
        if disk is None:
            row.disk_full = row.read_only = "not tried: this process may not mount"
            return
        row.disk_full = _refusal(trial.run(), "a full disk", row)
        row.failures += [f"a full disk: {half}" for half in _halves(trial)]
        disk.grow(64 * trial.size + 2**26)
        row.failures += [f"after a full disk: {wrong}" for wrong in _compared(trial.run(), trial)]
        disk.forbid_writing()
        before = trial.marks()
        row.read_only = _refusal(trial.run(within="other"), "a read-only folder", row)
        row.failures += ["a read-only folder was written to"] if trial.marks() != before else []


def _halves(trial: Trial) -> tuple[str, ...]:
    found = halves(trial.marks(), trial.wanted, trial.target.growing)
    return tuple(f"half a file in {name}" for name in found[:5])


def _compared(ended: Ended, trial: Trial) -> tuple[str, ...]:
    if ended.code:
        return (f"code {ended.code}: {ended.said}",)
    return differences(trial.marks(), trial.wanted)[:5]


def _refusal(ended: Ended, where: str, row: KillRow) -> str:
    lines = [line for line in ended.said.strip().splitlines() if line.strip()]
    last = lines[-1] if lines else ""
    if ended.code != REFUSED or "Traceback" in ended.said or not last.startswith("error: "):
        row.failures.append(f"{where}: code {ended.code}: {ended.said[-500:]}")
    return last


def try_target(
    target: KillTarget,
    name: str,
    place: Path,
    *,
    root: Path,
    environment: Mapping[str, str],
    kills: int,
    seed: int,
    progress: Progress,
) -> KillRow:
    """All trials of one command.

    Args:
        target: the command.
        name: decides the moments, together with `seed`.
        place: an empty folder.
        root: where the command runs.
        environment: added to its environment.
        kills: that must meet it running.
        progress: of (kills, of so many, what).
    """
    row = KillRow(seed=seed_of("kills", seed, name))
    try:
        trial = begin_trial(target, place, root, environment)
        row.seconds = round(trial.seconds, 3)
        kill_often(trial, row, kills, progress)
        fill_disk(trial, row)
    except (RuntimeError, TimeoutError) as error:
        row.failures.append(str(error))
    return row
