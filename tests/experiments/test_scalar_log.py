"""Curves for TensorBoard: what was written can be read, and a missing package is named with its remedy."""

from __future__ import annotations

import importlib.util

import pytest

from aerojax.core.errors import UserError
from experiments._launch.scalar_log import ScalarLog


def test_a_missing_package_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"tensorboard=true needs tensorboardX.*extra `log`.*tensorboard=false"):
        ScalarLog(tmp_path / "curves")


def test_nothing_written_leaves_no_folder(tmp_path):
    pytest.importorskip("tensorboardX", reason="tensorboardX is not installed; it comes with the extra `log`")
    ScalarLog(tmp_path / "curves").close()
    assert list(tmp_path.iterdir()) == []


def test_scalars_can_be_read_back(tmp_path):
    pytest.importorskip("tensorboardX", reason="tensorboardX is not installed; it comes with the extra `log`")
    from tensorboardX.proto.event_pb2 import Event

    log = ScalarLog(tmp_path / "curves")
    log.write(7, {"training/loss": 1.5, "training/learning_rate": 0.25})
    log.write(8, {"training/loss": 1.25})
    log.close()
    (path,) = (tmp_path / "curves").iterdir()
    events, data = [], path.read_bytes()
    while data:  # a record: length, its checksum, the event, its checksum
        length = int.from_bytes(data[:8], "little")
        events.append(Event.FromString(data[12 : 12 + length]))
        data = data[16 + length :]
    points = [(event.step, value.tag, value.simple_value) for event in events for value in event.summary.value]
    assert points == [(7, "training/loss", 1.5), (7, "training/learning_rate", 0.25), (8, "training/loss", 1.25)]
    assert any(event.session_log.status == event.session_log.START and event.step == 7 for event in events)
