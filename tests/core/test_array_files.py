"""Arrays read back, and a full disk has its number."""

from __future__ import annotations

import errno

import numpy as np
import pytest

from aerojax.core.array_files import write_array
from aerojax.evaluate.kills.small_disk import small_disk


def test_an_array_reads_back(tmp_path):
    boxes = np.array([(1, 2.5)], dtype=[("id", "<u4"), ("share", "<f4")])
    write_array(tmp_path / "a/b.npy", boxes)
    np.testing.assert_array_equal(np.load(tmp_path / "a/b.npy"), boxes)


def test_a_full_disk_has_its_number(tmp_path):
    with small_disk(tmp_path / "disk", 65536) as disk:
        if disk is None:
            pytest.skip("this process may not mount")
        with pytest.raises(OSError) as told:
            write_array(tmp_path / "disk/a.npy", np.zeros(100_000))
        assert told.value.errno == errno.ENOSPC and list((tmp_path / "disk").iterdir()) == []
