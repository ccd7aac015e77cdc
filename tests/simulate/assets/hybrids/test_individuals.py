"""Training individuals beyond the published split: stable, sound, of their class's size, like their files."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.splits import SPLITS
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import build_identity, identities, training_individual
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

each_class = pytest.mark.parametrize("label", CLASSES)


def test_names_and_seeds_are_stable_and_of_no_published_identity():
    one = training_individual("bird", 7, seed=2)
    assert one == training_individual("bird", 7, seed=2)
    assert (one.name, one.family, one.split) == ("bird_hybrid_2_000007", "hybrid", "train")
    many = [training_individual(label, i, seed=s) for label in CLASSES for i in range(50) for s in (0, 1)]
    published = [i for split in SPLITS for i in identities(split)]
    assert len({i.name for i in many + published}) == len(many) + len(published)
    assert len({i.seed for i in many + published}) == len(many) + len(published)


@each_class
def test_individuals_are_sound_and_of_their_size(label):
    for index in range(24):
        mesh = build_animated(training_individual(label, index))
        assert 100 <= len(mesh.faces) <= 8000
        assert mesh.cycle_seconds > 0 and 0 <= mesh.albedo.min() <= mesh.albedo.max() <= 1
        assert mesh.faces.min() >= 0
        for seconds in (0.0, 0.37):
            vertices = mesh.vertices_at(seconds)
            assert np.isfinite(vertices).all() and mesh.faces.max() < len(vertices)
            extent = np.ptp(vertices, axis=0).max()
            assert 0.25 < extent < 2.6, (index, extent)


@each_class
def test_the_same_seed_gives_the_same_shape_and_another_one_not(label):
    mesh, again = (build_animated(training_individual(label, 3)) for _ in range(2))
    other = build_animated(training_individual(label, 4))
    assert np.array_equal(mesh.vertices_at(0.2), again.vertices_at(0.2)) and np.array_equal(mesh.albedo, again.albedo)
    assert len(mesh.faces) != len(other.faces) or not np.allclose(mesh.vertices_at(0.2), other.vertices_at(0.2))


@each_class
def test_the_file_has_the_geometry_of_the_mesh_in_memory(label, tmp_path):
    for index in (0, 1):
        identity = training_individual(label, index)
        file, memory = load_animated_mesh(build_identity(identity, tmp_path)), build_animated(identity)
        assert np.array_equal(file.faces, memory.faces) and file.part_names == memory.part_names
        for seconds in (0.0, 0.31):
            assert memory.vertices_at(seconds) == pytest.approx(file.vertices_at(seconds), abs=3e-5)


@pytest.mark.parametrize(("label", "index", "seed", "word"), [("kite", 0, 0, "kite"), ("bird", -1, 0, "-1")])
def test_mistakes_are_named(label, index, seed, word):
    with pytest.raises(UserError, match=word):
        training_individual(label, index, seed=seed)
