"""Readers of untrusted files under limits: processes that stay, read one changed file after the other, and are watched.

A reader may return or raise `UserError`. A finding is everything else: another exception, a crash of the process, more
time or memory than allowed, a file written or a folder made, an address contacted, a program started, a name looked up
by a pickle.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import jax
import numpy as np

from aerojax.core.errors import UserError
from aerojax.core.usd_copies import PREFIX, is_flattening
from aerojax.evaluate.fuzz.mutation import mutate_file

Files = Mapping[str, bytes]
"""One input: contents by path from its folder."""
FORBIDDEN = (
    *(
        "socket.connect",
        "socket.bind",
        "subprocess.Popen",
        "os.system",
        "os.exec",
        "os.posix_spawn",
        "pickle.find_class",
    ),
    *("os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.symlink", "os.link", "os.truncate", "shutil.rmtree"),
)
"""What Python reports to audit hooks that no reader of data may do."""
_COPIES = str(Path(tempfile.gettempdir()) / PREFIX)
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


@dataclass(frozen=True)
class Target:
    """One format: inputs that are right, the reader, and how often it is drawn.

    seeds: each is read without complaint; cases are changed copies of them.
    read: gets the folder with the input's files; a function of a module, since it goes to other processes.
    weight: relative share of cases.
    """

    seeds: tuple[Files, ...]
    read: Callable[[Path], object]
    weight: float = 1.0


@dataclass(frozen=True)
class Limits:
    """Bounds on one case.

    seconds: wall time, ten times what the slowest reader takes on a busy machine.
    megabytes: of address space beyond what the process holds when it begins.
    """

    seconds: float = 20.0
    megabytes: int = 1024


@dataclass(frozen=True)
class Finding:
    """What a reader did that none may: `kind`, the case that repeats it, and where."""

    format: str
    case: int
    kind: str
    where: str


@dataclass
class Tally:
    """Counts by format, and findings: the first of each kind, place and format."""

    read: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    found: Counter[str] = field(default_factory=Counter)
    findings: dict[tuple[str, str, str], Finding] = field(default_factory=dict)

    @property
    def inputs(self) -> int:
        """Cases that were tried."""
        return sum(self.read.values()) + sum(self.refused.values()) + sum(self.found.values())

    def add(self, name: str, case: int, outcome: tuple[str, str]) -> None:
        """Count one case."""
        kind, where = outcome
        if kind in ("read", "refused"):
            getattr(self, kind)[name] += 1
            return
        self.found[name] += 1
        self.findings.setdefault(
            (name, kind, where.splitlines()[-1] if where else ""), Finding(name, case, kind, where)
        )


def changed_files(target: Target, name: str, seed: int, case: int) -> dict[str, bytes]:
    """The input of one case; equal arguments give equal bytes."""
    rng = np.random.default_rng([seed, case, *name.encode()])
    files = dict(target.seeds[int(rng.integers(len(target.seeds)))])
    chosen = sorted(files)[int(rng.integers(len(files)))]
    if rng.random() < 0.5:  # the file that is read first, where an input has several
        chosen = min(files, key=lambda path: (path.count("/"), path))
    return {**files, chosen: mutate_file(chosen, files[chosen], rng)}


def run_case(target: Target, files: Files, folder: Path) -> tuple[str, str]:
    """Write an input, read it, and say how that ended: (kind, where)."""
    shutil.rmtree(folder, ignore_errors=True)
    for path, content in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)
    with _watched() as seen:
        outcome = _ended(target, folder)
    left = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()} - files.keys()
    if seen or left:
        return "forbidden", "; ".join(sorted({*seen, *(f"left {path}" for path in left)}))
    return outcome


def _ended(target: Target, folder: Path) -> tuple[str, str]:
    try:
        target.read(folder)
    except UserError as error:
        return ("refused", str(error)[:300]) if error.problem.strip() else ("silent", "UserError without words")
    except MemoryError:
        return "memory", _last_lines()
    except BaseException as error:  # a finding, whatever it is
        return type(error).__name__, _last_lines()
    return "read", ""


def _last_lines() -> str:
    """The frames of our own code, innermost last."""
    frames = [f for f in traceback.extract_tb(sys.exc_info()[2]) if "site-packages" not in f.filename]
    lines = [f"{Path(*Path(f.filename).parts[-3:])}:{f.lineno} {f.name}" for f in frames]
    text = traceback.format_exception_only(*sys.exc_info()[:2])[-1].strip()[:300]
    return "\n".join([text.replace("\n", " "), *lines[-6:]])


def _copies_usd(event: str, arguments: tuple[object, ...]) -> bool:
    """Whether this is part of `usd_copy`: it starts that one program, and has a temporary file of its own."""
    if event == "subprocess.Popen":
        command = arguments[1]
        return isinstance(command, list | tuple) and is_flattening(command)
    path = str(arguments[0])
    return path == os.devnull or (event in ("open", "os.remove") and path.startswith(_COPIES))


class _Watch:
    """Notes forbidden events while it is open; audit hooks cannot be taken off, so there is one a process."""

    def __init__(self) -> None:
        self.open, self.seen = False, list[str]()
        sys.addaudithook(self._note)

    def _note(self, event: str, arguments: tuple[object, ...]) -> None:
        if not self.open:
            return
        writes = event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & _WRITING)
        if (writes or event in FORBIDDEN) and not _copies_usd(event, arguments):
            self.seen.append(f"{event} {arguments[0]!r}"[:200])

    def __enter__(self) -> list[str]:
        self.open, self.seen = True, []
        return self.seen

    def __exit__(self, *_: object) -> None:
        self.open = False


_WATCH: list[_Watch] = []


def _watched() -> _Watch:
    if not _WATCH:
        _WATCH.append(_Watch())
    return _WATCH[0]


def _work(connection: Connection, targets: Mapping[str, Target], folder: Path, seed: int, megabytes: int) -> None:
    """The process: read each seed once, then answer case after case."""
    sink = os.open(os.devnull, os.O_WRONLY)  # libraries in C complain on standard error
    for stream in (1, 2):
        os.dup2(sink, stream)
    sys.dont_write_bytecode = True
    jax.config.update("jax_compilation_cache_dir", None)  # a cache would be a file that is written
    for name, target in targets.items():
        for number, files in enumerate(target.seeds):
            outcome = run_case(target, files, folder)
            if outcome[0] != "read":
                connection.send(RuntimeError(f"seed {number} of {name} is not read: {outcome}"))
                return
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    bound = held + megabytes * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (bound, bound))
    connection.send("ready")
    while (asked := connection.recv()) is not None:
        name, case = asked
        connection.send(run_case(targets[name], changed_files(targets[name], name, seed, case), folder))


class Worker:
    """A process that reads cases, as its parent sees it; `idle` when it waits for one."""

    def __init__(self, targets: Mapping[str, Target], folder: Path, seed: int, limits: Limits):
        self._arguments = (targets, folder, seed, limits.megabytes)
        self.limits, self.case, self.since = limits, ("", -1), 0.0
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_work, args=(other, *self._arguments), daemon=True)
        self.process.start()
        other.close()
        self.ready = self.idle = False

    def ask(self, name: str, case: int) -> None:
        """Begin a case."""
        self.case, self.since, self.idle = (name, case), time.monotonic(), False
        self.connection.send(self.case)

    def outcome(self) -> tuple[str, str] | None:
        """How the case ended; None while there is none or it runs. A process that hangs or has died is replaced.

        Raises:
            RuntimeError: a seed is not read, or the process died before its first case.
        """
        try:
            if self.connection.poll():
                return self._received(self.connection.recv())
        except (EOFError, ConnectionResetError):
            if not self.ready:
                raise RuntimeError("a worker died while it read its seeds") from None
            self.process.join()
            code = self.process.exitcode
            self._start()
            return "crash", f"the process ended with {code}"
        if self.ready and not self.idle and time.monotonic() - self.since > self.limits.seconds:
            self.stop()
            self._start()
            return "hang", f"no answer after {self.limits.seconds:g} s"
        return None

    def _received(self, answer: object) -> tuple[str, str] | None:
        if isinstance(answer, Exception):
            raise answer
        self.ready = self.idle = True
        return answer if isinstance(answer, tuple) else None

    def stop(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.join()
        self.connection.close()
