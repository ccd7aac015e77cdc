"""The code of docs/recipes.md runs as it stands there, in a folder with what the page says."""

from __future__ import annotations

import re
import sys
import types

import jax
import pytest
from support.clip_examples import random_clip
from support.pages import DOCS, fenced

import aerojax
from aerojax.classify import members

LOOSE = {"jax_numpy_rank_promotion": "allow", "jax_numpy_dtype_promotion": "standard"}
"""As JAX is for those who read the recipes."""
RECIPES = DOCS / "recipes.md"
HEADINGS = re.findall(r"^## (.*?)$(?=[^#]*?^```python$)", RECIPES.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.fixture
def plys(tmp_path, monkeypatch):
    """A folder with what docs/recipes.md takes: a clip of three frames as PLYs."""
    for number in range(3):
        gaussians = aerojax.Gaussians.from_columns(random_clip(number, time=1, tokens=300)[0])
        aerojax.write_ply(tmp_path / "plys" / f"frame_{number:06d}.ply", gaussians)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("code", fenced(RECIPES, "python"), ids=HEADINGS)
def test_recipes_run(code, plys, monkeypatch, capsys):
    known = dict(members.MEMBERS)
    for name, value in LOOSE.items():
        jax.config.update(name, value)
    module = types.ModuleType("recipe")  # where dataclasses look for the names in annotations
    monkeypatch.setitem(sys.modules, "recipe", module)
    try:
        exec(compile(code, "docs/recipes.md", "exec"), module.__dict__)
    finally:  # a recipe adds a member, and other rooms hold this very mapping
        members.MEMBERS.clear()
        members.MEMBERS.update(known)
    written = sorted(path.name for path in plys.iterdir())
    assert capsys.readouterr().out or written != ["plys"]
