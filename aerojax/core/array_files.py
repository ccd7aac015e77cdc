"""Arrays as `.npy` files."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from aerojax.core.files import write_bytes


def write_array(path: Path, array: np.ndarray) -> None:
    """Write a `.npy` file whole or not at all.

    Raises:
        OSError: it cannot be written; with a number, which NumPy's own writer leaves out for a full disk.
    """
    content = io.BytesIO()
    np.save(content, array, allow_pickle=False)
    write_bytes(path, content.getvalue())
