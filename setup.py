"""How the wheel is built: in it `kernels`, `experiments` and `conf` lie inside `aerojax`.

The repository has four top-level folders, and an editable install shows them as they are. An installed wheel brings one
name, `aerojax`: setuptools maps the other three to `aerojax.kernels`, `aerojax.experiments` and `aerojax.conf`, and
the copies' own absolute imports are rewritten to match. Nothing is left to do when they are imported.
"""

from __future__ import annotations

import ast
import re
import shutil
from pathlib import Path
from typing import Any

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py
from setuptools.command.editable_wheel import editable_wheel

MOVED = ("conf", "experiments", "kernels")
_MODULE = re.compile(rf"\b({'|'.join(MOVED)})\b")
_TARGET = re.compile(rf"(_target_:\s*[\"']?)({'|'.join(MOVED)})\.")
_COMMAND = "python -m experiments."


def rewritten_source(source: str) -> str:
    """A Python file as the wheel has it: moved packages are imported from `aerojax`, and commands say `aerojax`.

    Raises:
        ValueError: `import kernels.x` without `as` binds the top-level name, which the wheel does not have.
    """
    lines = source.splitlines(keepends=True)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and _is_moved(node.module or "") and node.level == 0:
            _move(lines, node.lineno, node.col_offset)
        elif isinstance(node, ast.Import):
            for name in node.names:
                if _is_moved(name.name):
                    if name.asname is None:
                        raise ValueError(f"line {node.lineno}: import {name.name} needs `as`, or `from … import`")
                    _move(lines, name.lineno, name.col_offset)
    return "".join(lines).replace(_COMMAND, "aerojax ")


def rewritten_config(text: str) -> str:
    """A YAML file as the wheel has it: `_target_` and commands are followed."""
    return _TARGET.sub(r"\1aerojax.\2.", text).replace(_COMMAND, "aerojax ")


def _is_moved(module: str) -> bool:
    return module.split(".")[0] in MOVED


def _move(lines: list[str], number: int, column: int) -> None:
    """Put `aerojax.` before the first moved name from a place on; columns of `ast` count UTF-8 bytes."""
    line = lines[number - 1].encode()
    head, tail = line[:column].decode(), line[column:].decode()
    lines[number - 1] = head + _MODULE.sub(r"aerojax.\1", tail, count=1)


class BuildWheelFiles(build_py):
    """Copies that are rewritten, into a folder without remains of an earlier build."""

    def run(self) -> None:
        """Build everything anew: a module that was renamed must not stay in the wheel."""
        if not self.editable_mode:
            shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()

    def copy_file(self, infile: str, outfile: str, *args: Any, **kwargs: Any) -> Any:
        """Copy one file, then rewrite the copy."""
        copied, done = super().copy_file(infile, outfile, *args, **kwargs)
        rewrite = {".py": rewritten_source, ".yaml": rewritten_config}.get(Path(copied).suffix)
        if rewrite is not None and not self.editable_mode:
            path = Path(copied)
            path.write_text(rewrite(path.read_text(encoding="utf-8")), encoding="utf-8")
        return copied, done


class EditableFolders(editable_wheel):
    """An editable install shows the repository's folders where they are."""

    def initialize_options(self) -> None:
        """Undo the mapping of the wheel."""
        self.distribution.packages = find_packages(include=["aerojax*", *(f"{name}*" for name in MOVED)])
        self.distribution.package_dir = {}
        super().initialize_options()


if __name__ == "__main__":
    moved = find_packages(include=[f"{name}*" for name in MOVED])
    setup(
        packages=[*find_packages(include=["aerojax*"]), *(f"aerojax.{name}" for name in moved)],
        package_dir={f"aerojax.{name}": name for name in MOVED},
        cmdclass={"build_py": BuildWheelFiles, "editable_wheel": EditableFolders},
    )
