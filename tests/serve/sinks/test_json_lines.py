"""Lines are whole: after a kill in the middle of one, after a full disk, and where nobody reads any more."""

from __future__ import annotations

import io
import json
import os
import sys

import pytest

from aerojax.serve.sinks.json_lines import JsonLines, LineFile


@pytest.mark.parametrize(
    ("before", "kept"),
    [(b"", b""), (b'{"a": 1}\n', b'{"a": 1}\n'), (b'{"a": 1}\n{"b": ', b'{"a": 1}\n'), (b'{"b": ', b"")],
)
def test_what_a_kill_left_of_a_line_is_cut_off(tmp_path, before, kept):
    path = tmp_path / "made/out.jsonl"
    path.parent.mkdir()
    path.write_bytes(before)
    sink = JsonLines(path)
    sink.send({"type": "lost", "track": "ü"}, None)
    sink.close()
    assert path.read_bytes() == kept + '{"type": "lost", "track": "ü"}\n'.encode()


def test_a_line_that_a_full_disk_cut_does_not_spoil_the_next(tmp_path):
    file = LineFile(tmp_path / "out.jsonl")
    real, full = file._file, [True]

    class Disk:
        def write(self, line: bytes) -> int:
            return real.write(line[:3] if full.pop() else line)

        def flush(self) -> None:
            real.flush()

    file._file = Disk()  # pyrefly: ignore
    with pytest.raises(OSError, match="No space"):
        file.write('{"one": 1}')
    full.append(False)
    file.write('{"two": 2}')
    real.close()
    lines = (tmp_path / "out.jsonl").read_text().splitlines()
    assert lines[0] == '{"o' and json.loads(lines[1]) == {"two": 2}


def test_a_reader_that_is_gone_is_told_once(monkeypatch):
    read, write = os.pipe()
    os.close(read)
    with io.TextIOWrapper(os.fdopen(write, "wb")) as output:
        monkeypatch.setattr(sys, "stdout", output)
        file = LineFile(None)
        with pytest.raises(BrokenPipeError):
            file.write("x")
        output.flush()  # as Python does when it ends
