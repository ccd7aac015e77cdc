"""A process that keeps what it frees does not ask the system for the same memory twice."""

from __future__ import annotations

import subprocess
import sys

import pytest

COUNT_FAULTS = """
import ctypes, resource
from aerojax.training.memory import keep_freed_memory
if {keep}: assert keep_freed_memory()
library = ctypes.CDLL(None)
library.malloc.restype, library.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
library.free.argtypes = [ctypes.c_void_p]
for round in range(4):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    blocks = [library.malloc(64 << 20) for _ in range(2)]
    for block in blocks: ctypes.memset(block, 1, 64 << 20)
    for block in blocks: library.free(block)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the allocator of glibc is set on Linux only")
def test_freed_memory_is_kept():
    faults = {}
    for keep in (True, False):
        command = [sys.executable, "-c", COUNT_FAULTS.format(keep=keep)]
        faults[keep] = int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    # 128 MiB are 32 768 pages of 4 KiB, or 64 of 2 MiB.
    assert faults[True] < 32 < faults[False]


GIVE_BACK = """
import ctypes, resource
from aerojax.training.memory import keep_freed_memory
def resident(): return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize() >> 20
keep_freed_memory()
library = ctypes.CDLL(None)
library.malloc.restype, library.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
library.free.argtypes = [ctypes.c_void_p]
start, block, above = resident(), library.malloc(256 << 20), library.malloc(1 << 20)
ctypes.memset(block, 1, 256 << 20)
library.free(block)
kept = resident() - start
keep_freed_memory()
print(kept, resident() - start)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the allocator of glibc is set on Linux only")
def test_the_next_run_of_a_sweep_does_not_add_to_what_the_last_one_freed():
    found = subprocess.run([sys.executable, "-c", GIVE_BACK], check=True, capture_output=True, text=True).stdout
    kept, left = map(int, found.split())
    assert kept >= 250 and left < 50
