"""Writers that go on where they were stopped, and writers that do not, are told apart."""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path

import pytest

from aerojax.evaluate.kills.trials import KillTarget, try_target

WRITER = """
    import json, os, sys, time
    from pathlib import Path
    out = Path(sys.argv[1])
    try:
        out.mkdir(parents=True, exist_ok=True)
        for number in range(8):
            path = out / f"{number}.bin"
            if not path.exists():
                write(path, bytes([number]) * 20000)
        began = {"seconds": time.time(), "commit": str(os.getpid()), "files": 8}
        write(out / "done.json", json.dumps(began).encode())
    except OSError as error:
        print("error:", error.strerror, file=sys.stderr)
        sys.exit(2)
"""
WHOLE = """
    def write(path, content):
        time.sleep(0.02)
        hidden = path.with_name("." + path.name)
        try:
            hidden.write_bytes(content)
            hidden.rename(path)
        except OSError:
            hidden.unlink(missing_ok=True)
            raise
"""
IN_PLACE = """
    def write(path, content):
        with path.open("wb") as file:
            for part in range(4):
                file.write(content[part::4])
                file.flush()
                time.sleep(0.01)
"""


@pytest.fixture
def trial(tmp_path):
    def run(write: str, *, kills: int = 4):
        script = tmp_path / "writer.py"
        source = textwrap.dedent(WRITER).replace("out = Path", textwrap.dedent(write) + "\nout = Path")
        script.write_text(source)
        target = KillTarget(lambda out: (sys.executable, "-S", str(script), str(out / "made")))
        how = {"root": Path(__file__).parent, "environment": {}, "kills": kills, "seed": 0}
        return try_target(target, "writer", tmp_path / "place", **how, progress=lambda done, total, what: None)

    return run


def test_a_writer_of_whole_files_goes_on(trial):
    row = trial(WHOLE)
    assert row.failures == [] and row.kills == row.byte_equal == 4 and row.runs >= 1
    assert len(row.moments) == 4 and all(0 <= moment <= row.seconds for moment in row.moments)
    if not row.disk_full.startswith("not tried"):
        assert row.disk_full == "error: No space left on device" and row.read_only == "error: Read-only file system"


def test_a_writer_in_place_leaves_half_files(trial):
    row = trial(IN_PLACE, kills=6)
    assert any("half a file in made/" in failure for failure in row.failures)
    assert row.byte_equal < row.kills == 6


def test_a_command_that_fails_is_a_failure(tmp_path):
    target = KillTarget(lambda out: (sys.executable, "-S", "-c", "raise SystemExit(3)"))
    how = {"root": tmp_path, "environment": {}, "kills": 2, "seed": 0}
    row = try_target(target, "wrong", tmp_path / "place", **how, progress=lambda done, total, what: None)
    assert row.kills == 0 and "failed" in row.failures[0]
