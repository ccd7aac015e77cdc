"""The commit is aerojax's own, or none."""

from __future__ import annotations

import subprocess

from aerojax.core.provenance import command_line, command_of_result, commit, provenance


def git(folder, *arguments):
    identity = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    subprocess.run(["git", *identity, *arguments], cwd=folder, check=True, capture_output=True)


def test_the_commit_of_a_checkout_and_its_changes(tmp_path):
    assert commit(tmp_path) is None
    git(tmp_path, "init", "-q")
    assert commit(tmp_path) is None  # nothing is committed yet
    (tmp_path / "a.py").write_text("1\n")
    git(tmp_path, "add", "a.py")
    git(tmp_path, "commit", "-q", "-m", "first")
    clean = commit(tmp_path)
    assert clean is not None and len(clean) == 40
    (tmp_path / "b.py").write_text("2\n")
    assert commit(tmp_path) == clean  # untracked files are no part of it
    (tmp_path / "a.py").write_text("2\n")
    assert commit(tmp_path) == clean + "+changes"


def test_a_package_within_another_projects_checkout_has_no_commit(tmp_path):
    git(tmp_path, "init", "-q")
    (tmp_path / "a.py").write_text("1\n")
    git(tmp_path, "add", "a.py")
    git(tmp_path, "commit", "-q", "-m", "first")
    installed = tmp_path / "venv/lib/site-packages"
    installed.mkdir(parents=True)
    assert commit(installed) is None and commit(tmp_path) is not None


def test_provenance_names_overrides_and_versions():
    found = provenance(("a=1",))
    assert found["overrides"] == ["a=1"] and {"jax", "numpy", "python"} <= set(found["versions"])
    assert set(found) == {"overrides", "versions", "commit", "machine"}


def test_commands_have_the_quotes_that_a_shell_wants():
    words = ["preset=full", "rigs=[{cameras: 3, span: [20, 20]}]"]
    line = "python -m experiments.act preset=full 'rigs=[{cameras: 3, span: [20, 20]}]'"
    assert command_line("act", words) == line
    assert command_of_result({"command": line, "overrides": words}) == line
    before = {"command": line.replace("'", ""), "overrides": words}
    assert command_of_result(before) == line
    plain = {"command": "python -m experiments.act a=[1,2]", "overrides": ["a=[1,2]"]}
    assert command_of_result(plain) == plain["command"] and command_of_result({}) is None
