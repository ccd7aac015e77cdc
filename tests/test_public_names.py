"""`import aerojax`: every public name is there, described, and imported only when it is used."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import aerojax

SOURCE = Path(aerojax.__file__)


@pytest.mark.parametrize("name", [n for n in aerojax.__all__ if n != "__version__"])
def test_a_public_name_is_there_and_described(name):
    value = getattr(aerojax, name)
    assert name in dir(aerojax)
    if callable(value):
        assert value.__doc__ and not value.__doc__.startswith(f"{name}("), f"{name} has no docstring"


def test_other_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'rendr'"):
        _ = aerojax.rendr


def test_type_checkers_are_told_the_same():
    told = {
        node.module: tuple(alias.name for alias in node.names)
        for node in ast.walk(ast.parse(SOURCE.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("aerojax.")
    }
    assert told == aerojax._HOMES


def test_import_is_light():
    heavy = "{'jax', 'warp', 'numpy', 'hydra', 'rich'}"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys, aerojax; print({heavy} & set(sys.modules), aerojax.__version__)"],
        cwd=SOURCE.parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == f"set() {aerojax.__version__}\n"
