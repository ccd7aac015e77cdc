"""Solids: the same from the same name, about a metre, closed pieces, faces small enough for their patterns."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.simulate.assets.mesh.shapes import Mesh, box
from aerojax.simulate.assets.solids.asset import EDGE, build_solid, refined, solid_name
from aerojax.simulate.assets.solids.pieces import PIECES


def edges(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corner = points[faces]
    return np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)


def test_a_name_is_a_solid():
    first, again, other = (build_solid(solid_name(n)) for n in (3, 3, 4))
    np.testing.assert_array_equal(first.vertices_at(0.0), again.vertices_at(7.0))
    np.testing.assert_array_equal(first.albedo, again.albedo)
    assert first.faces.shape != other.faces.shape or not np.array_equal(first.vertices_at(0.0), other.vertices_at(0.0))


@pytest.mark.parametrize("number", range(8))
def test_solids_are_about_a_metre_and_finely_painted(number):
    mesh = build_solid(solid_name(number, seed=1))
    points = mesh.vertices_at(0.0)
    assert np.isfinite(points).all() and np.isfinite(mesh.albedo).all()
    assert 0.3 < np.linalg.norm(points, axis=1).max() < 1.0
    assert np.median(edges(points, mesh.faces)) < EDGE
    assert ((mesh.albedo >= 0) & (mesh.albedo <= 1)).all()


@pytest.mark.parametrize("piece", PIECES[:-1], ids=lambda piece: piece.__name__)
def test_pieces_are_closed_and_wound_outward(piece):
    for seed in range(5):
        mesh = piece(np.random.default_rng(seed))
        directed = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
        forth = {tuple(edge) for edge in directed.tolist()}
        assert len(forth) == len(directed) and all((b, a) in forth for a, b in forth)
        a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


def test_refining_keeps_the_surface():
    mesh = box((0.0, 0.0, 0.0), (1.0, 0.5, 0.25))
    fine = refined(mesh, 0.1)
    assert edges(fine.points, fine.faces).max() <= 0.1

    def area_and_volume(one: Mesh) -> tuple[float, float]:
        a, b, c = (one.points[one.faces[:, i]] for i in range(3))
        return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2, np.einsum("ij,ij->", a, np.cross(b, c)) / 6

    np.testing.assert_allclose(area_and_volume(fine), area_and_volume(mesh), rtol=1e-12)
