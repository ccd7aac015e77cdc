"""Identities in memory: the same geometry, motion and joints as their USD files, and nearly the same colours."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import Identity, build_identity, identities
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

ONE_EACH = {identity.label: identity for identity in reversed(identities("train"))}


@pytest.mark.parametrize("label", CLASSES)
def test_geometry_is_that_of_the_file(label, tmp_path):
    identity = ONE_EACH[label]
    file, memory = load_animated_mesh(build_identity(identity, tmp_path)), build_animated(identity)
    assert np.array_equal(file.faces, memory.faces) and np.array_equal(file.part, memory.part)
    assert file.part_names == memory.part_names
    assert memory.cycle_seconds == pytest.approx(file.cycle_seconds, rel=1e-9)
    for seconds in (0.0, 0.0413, 0.31, 1.77, -0.2):
        assert memory.vertices_at(seconds) == pytest.approx(file.vertices_at(seconds), abs=2e-5)
        expected, found = file.joints_at(seconds), memory.joints_at(seconds)
        assert list(expected) == list(found)
        for name, pose in expected.items():
            assert found[name] == pytest.approx(pose, abs=1e-5)


@pytest.mark.parametrize("label", CLASSES)
def test_colours_are_those_of_the_file_on_the_whole(label, tmp_path):
    identity = ONE_EACH[label]
    file, memory = load_animated_mesh(build_identity(identity, tmp_path)), build_animated(identity)
    picture = file.textures[0] / 255.0
    middle = file.uv.mean(axis=1)
    column = (middle[:, 0] * picture.shape[1]).astype(int).clip(0, picture.shape[1] - 1)
    row = ((1 - middle[:, 1]) * picture.shape[0]).astype(int).clip(0, picture.shape[0] - 1)
    assert np.abs(picture[row, column] - memory.albedo).mean() < 0.05
    assert np.abs(picture[row, column].mean(axis=0) - memory.albedo.mean(axis=0)).max() < 0.03
    assert memory.albedo.min() >= 0.0 and memory.albedo.max() <= 1.0


def test_unknown_families_are_named():
    with pytest.raises(UserError, match="dodo"):
        build_animated(Identity("x", "bird", "dodo", 1, "train"))
