"""Several devices and several processes train as one: the same losses, one set of files, resumable after a kill."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

TESTS = Path(__file__).resolve().parents[1]


def begin(folder: Path, process: int = 0, count: int = 1, *, port: int = 0, die: int = 0, devices: int = 1):
    flags = f"--xla_force_host_platform_device_count={devices}"
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "XLA_FLAGS": flags, "PYTHONPATH": str(TESTS.parent)}
    arguments = [str(folder), str(die), f"127.0.0.1:{port}", str(process), str(count)]
    command = [sys.executable, str(TESTS / "support" / "training_process.py"), *arguments]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def lines(process: subprocess.Popen) -> list[dict]:
    said, complaints = process.communicate(timeout=300)
    assert process.returncode == 0, complaints[-3000:]
    return [json.loads(line) for line in said.splitlines() if line.startswith("{")]


def curve(said: list[dict]) -> np.ndarray:
    return np.array([[row["step"], row["loss"], row["gradient_norm"]] for row in said if "step" in row])


def begin_pair(folder: Path, *, die: int = 0) -> list[subprocess.Popen]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    return [begin(folder / str(index), index, 2, port=port, die=die) for index in range(2)]


@pytest.fixture(scope="module")
def alone(tmp_path_factory) -> list[dict]:
    """What one process with one device says: every step, then the best model."""
    return lines(begin(tmp_path_factory.mktemp("alone")))


def assert_same_training(said: list[dict], alone: list[dict]) -> None:
    np.testing.assert_allclose(curve(said), curve(alone), rtol=1e-4)
    for name, values in alone[-1].items():
        np.testing.assert_allclose(said[-1][name], values, rtol=1e-3, atol=1e-5)


@pytest.mark.slow
def test_two_devices_train_as_one(alone, tmp_path):
    assert len(curve(alone)) == 15 and curve(alone)[-5:, 1].mean() < 0.9 * curve(alone)[:5, 1].mean()
    said = lines(begin(tmp_path, devices=2))
    assert_same_training(said, alone)


@pytest.mark.slow
def test_two_processes_train_as_one_and_the_first_one_writes(alone, tmp_path):
    first, second = map(lines, begin_pair(tmp_path))
    assert_same_training(first, alone)
    assert second == [first[-1]]  # the same model to the bit, and nothing said on the way
    assert sorted(path.name for path in (tmp_path / "0").iterdir()) == ["checkpoints", "history.jsonl"]
    assert not (tmp_path / "1").exists()


@pytest.mark.slow
def test_two_killed_processes_go_on_from_the_first_ones_checkpoint(alone, tmp_path):
    killed = begin_pair(tmp_path, die=9)
    assert killed[0].wait(timeout=300) == -signal.SIGKILL
    killed[1].kill()  # it may have died of the other's silence before it came so far
    for process in killed:
        process.communicate()
    first, second = map(lines, begin_pair(tmp_path))
    assert curve(first)[0, 0] == 7  # checkpoints after steps 3, 5 and 6
    np.testing.assert_allclose(curve(first), curve(alone)[6:], rtol=1e-4)
    assert second == [first[-1]]
    rows = [json.loads(line) for line in (tmp_path / "0/history.jsonl").read_text().splitlines()]
    assert [row["epoch"] for row in rows] == [1, 2, 3]
