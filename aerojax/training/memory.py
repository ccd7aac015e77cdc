"""Memory of a process that runs one program many times: what a call frees is kept for the next one."""

from __future__ import annotations

import ctypes
import gc
import sys

_TRIM_THRESHOLD, _MMAP_MAX, _ARENA_MAX = -1, -4, -8
"""Parameters of `mallopt` in glibc (malloc.h)."""


def keep_freed_memory() -> bool:
    """Let the C library keep large blocks that are freed instead of giving them back to the system; whether it does.

    XLA allocates a program's working memory anew in every call. By default glibc maps such blocks and unmaps them
    again, so that every call pays for the system's zeroing of each page: a third of the processor time of a training
    step on a CPU. Kept, they cost it once. The process stays at its largest size, which is what a training run does
    anyhow; do not call this where memory is measured. What is free by now is given back first: the clips of a sweep's
    next run seldom fit into the place of those of the last, and would be added to it.

    Call it before the first JAX computation: later threads have pools of their own already. Nothing happens where the C
    library is not glibc.
    """
    if not sys.platform.startswith("linux"):
        return False
    library = ctypes.CDLL(None)
    if not hasattr(library, "mallopt") or not hasattr(library, "gnu_get_libc_version"):
        return False
    # One pool for all threads, none of it mapped apart, and nothing of its end given back.
    wanted = ((_ARENA_MAX, 1), (_MMAP_MAX, 0), (_TRIM_THRESHOLD, -1))
    gc.collect()
    library.malloc_trim(0)
    return all(library.mallopt(parameter, value) == 1 for parameter, value in wanted)
