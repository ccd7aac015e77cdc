"""The command `aerojax ACT [key=value …]`, which is `python -m experiments.ACT [key=value …]`.

The list of acts is read from their sources: help must not wait until JAX is loaded.
"""

from __future__ import annotations

import ast
import difflib
import importlib
import sys
from pathlib import Path

ACTS = Path(__file__).resolve().parents[1]
PACKAGE = __name__.removesuffix("._launch.console")
"""Where acts are imported from: `experiments`, or where an installed wheel has it."""


def acts() -> dict[str, str]:
    """First line of every act's docstring, by the act's name."""
    found = {}
    for path in sorted(ACTS.glob("[!_]*.py")):
        about = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        found[path.stem] = about.partition("\n")[0]
    return found


def help_text() -> str:
    """What `aerojax --help` prints."""
    known = acts()
    width = max(map(len, known))
    lines = [f"  {name:{width}}  {about}" for name, about in known.items()]
    closing = "`aerojax ACT --help` shows an act's configuration; files go to runs/ in the working directory."
    return "\n".join(["aerojax ACT [key=value ...]", "", "Acts:", *lines, "", closing])


def main(arguments: list[str] | None = None) -> None:
    """Run the act that the first argument names with the others as its command line.

    Ends the process with code 2 where there is no such act.

    Args:
        arguments: `sys.argv[1:]` if None.
    """
    name, *others = (sys.argv[1:] if arguments is None else arguments) or ["--help"]
    if name in ("--help", "-h", "help"):
        return print(help_text())
    known = acts()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.65)
        remedy = f"did you mean {near[0]}?" if near else "aerojax --help lists them"
        print(f"error: there is no act {name!r}; {remedy}", file=sys.stderr)
        sys.exit(2)
    from experiments._launch.front import answer  # not for the list of acts

    answer(f"{PACKAGE}.{name}", others)
    sys.argv = [str(ACTS / f"{name}.py"), *others]
    importlib.import_module(f"{PACKAGE}.{name}").main()
