"""What is needed to make a result again: versions of packages, commit of the code, machine."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[2]
"""Folder of the package: that of the checkout, or site-packages."""
_PACKAGES = ("jax", "jaxlib", "flax", "optax", "warp-lang", "usd-core", "opencv-python-headless", "numpy")


def provenance(overrides: tuple[str, ...] = ()) -> dict[str, Any]:
    """Overrides of the configuration, versions, commit and machine, as results hold them."""
    return {
        "overrides": list(overrides),
        "versions": package_versions(),
        "commit": commit(),
        "machine": {"system": platform.platform(), "cpus": os.cpu_count()},
    }


def command_line(act: str, overrides: Sequence[str]) -> str:
    """What a shell takes to do it again: the act's name and its overrides, in quotes where they need some."""
    return shlex.join(["python", "-m", f"experiments.{act}", *overrides])


def command_of_result(values: Mapping[str, Any]) -> str | None:
    """The command that a result names; of older ones, which have blanks without quotes, made of its overrides.

    Args:
        values: content of the result.
    """
    command, overrides = values.get("command"), values.get("overrides", [])
    if command is None or not any(" " in word for word in overrides) or "'" in command:
        return command
    return command_line(command.split()[2].removeprefix("experiments."), overrides)


def package_versions() -> dict[str, str]:
    """Versions of the packages that decide results, and of Python."""
    return {p: importlib.metadata.version(p) for p in _PACKAGES} | {"python": platform.python_version()}


def commit(root: Path = _ROOT) -> str | None:
    """Commit of aerojax's own checkout, with `+changes` where tracked files differ from it.

    Args:
        root: folder that holds the package.

    Returns:
        None where `root` is no checkout, which is so for an installed package, also where it lies within another
        project's checkout.
    """
    try:
        if Path(_git(root, "rev-parse", "--show-toplevel")).resolve() != root.resolve():
            return None
        head = _git(root, "rev-parse", "HEAD")
        return head + ("+changes" if _git(root, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, check=True, capture_output=True, text=True)
    return done.stdout.strip()
