"""Texture images on disk."""

from __future__ import annotations

import pytest
from support.painted_assets import PLANE

from aerojax.core.errors import UserError
from aerojax.simulate.usd.authoring import write_asset


def test_an_unwritable_folder_is_named(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(UserError, match=r"plane\.png"):
        write_asset(blocked / "plane.usdc", PLANE, 1)
