"""Gaussians of a surface: where they lie, how large they are, and that they show what the object shows."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
import trimesh
from pxr import UsdShade
from support.usd_examples import define_quad, define_textured_material, open_stage, write_picture, write_solid

from aerojax.capture.format import CaptureCamera, Truth, read_capture
from aerojax.capture.paths import frame_path
from aerojax.capture.truth import rotate_truth
from aerojax.core.errors import UserError
from aerojax.core.types import SH_C0, Camera
from aerojax.gaussians.io.ply import read_ply, write_ply
from aerojax.gaussians.render import render
from aerojax.geometry.cameras import look_at
from aerojax.geometry.rotations import rotation_from_quaternion
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.plan.planner import SequenceConfig, plan_sample
from aerojax.simulate.record import record_scene
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.surface import SurfaceConfig, draw_surface_points, surface_gaussians
from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from aerojax.simulate.world.random_rigs import RandomRigConfig

WIDTH = 320


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    """A ball of radius 0.5 m, linear grey 0.5 0.25 0.125."""
    file = tmp_path_factory.mktemp("ball") / "ball.usda"
    return load_animated_mesh(write_solid(file, trimesh.creation.icosphere(4, 0.5), (0.5, 0.25, 0.125)))


def gaussians_of(mesh, count, *, seed=0, seconds=0.0, thickness=0.1):
    points = draw_surface_points(mesh, count, seed)
    return surface_gaussians(mesh.vertices_at(seconds), mesh.faces, points, thickness=thickness)


def test_covariances_are_those_of_equal_shares_of_the_area(ball):
    found = gaussians_of(ball, 2000, thickness=0.05)
    area = trimesh.Trimesh(ball.vertices_at(0.0), ball.faces, process=False).area
    trace = np.sum(found.columns[:, 7:10].astype(np.float64) ** 2, axis=1)
    # A disc of area a has variance a/4π along either direction.
    np.testing.assert_allclose(trace * 2000 / area, (2 + 0.05**2) / (4 * np.pi), rtol=1e-5)
    outwards = found.columns[:, :3] / np.linalg.norm(found.columns[:, :3], axis=1, keepdims=True)
    assert np.sum(outwards * found.normal, axis=1).min() > 0.99
    thin = np.asarray(rotation_from_quaternion(jnp.asarray(found.columns[:, 3:7])))[:, :, 2]
    np.testing.assert_allclose(thin, found.normal, atol=1e-5)
    linear = (0.5, 0.25, 0.125)
    encoded = [1.055 * x ** (1 / 2.4) - 0.055 for x in linear]
    np.testing.assert_allclose(found.columns[:, 11:] * SH_C0 + 0.5, np.tile(encoded, (2000, 1)), atol=1e-3)


def test_points_are_spread_evenly(ball):
    """Systematic sampling: octants of a ball have their eighth to within a few points, where chance alone gives ±20."""
    mean = gaussians_of(ball, 4096).columns[:, :3]
    octant = (mean > 0) @ np.array([1, 2, 4])
    assert np.abs(np.bincount(octant, minlength=8) - 512).max() <= 12
    np.testing.assert_allclose(mean.mean(axis=0), 0.0, atol=5e-3)


def test_the_seed_decides(ball):
    first, again, other = (gaussians_of(ball, 50, seed=seed).columns for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.1


def test_points_move_with_the_surface():
    """Rotors turn about their hubs, and each point keeps its distance from the axis and its size."""
    mesh = build_animated(next(i for i in identities("test", 1) if i.label == "drone"))
    points = draw_surface_points(mesh, 400, 0)
    before, after = (surface_gaussians(mesh.vertices_at(t), mesh.faces, points).columns for t in (0.0, 0.01))
    moved = np.linalg.norm(after[:, :3] - before[:, :3], axis=1)
    turning = np.isin(mesh.part[points.face], [i for i, name in enumerate(mesh.part_names) if name.endswith("/mesh")])
    assert turning.any() and moved[turning].max() > 0.01 and moved[~turning].max() < 1e-6
    np.testing.assert_allclose(after[:, 7:10], before[:, 7:10], rtol=2e-3)


def test_colours_come_from_the_texture(tmp_path):
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0, 0], picture[0, 1], picture[1, 0], picture[1, 1] = (255, 0, 0), (0, 255, 0), (0, 0, 255), (90, 90, 90)
    stage = open_stage(tmp_path / "quad.usda")
    quad = define_quad(stage, "/quad")
    write_picture(tmp_path / "picture.png", picture)
    material = define_textured_material(stage, "/look", "picture.png")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).Bind(material)
    stage.Save()
    columns = gaussians_of(load_animated_mesh(tmp_path / "quad.usda"), 64).columns
    colour = np.round((columns[:, 11:] * SH_C0 + 0.5) * 255).astype(int)
    # u runs along +Y and v along +Z; the picture's first row is the top.
    wanted = picture[(columns[:, 2] < 0).astype(int), (columns[:, 1] > 0).astype(int)]
    np.testing.assert_array_equal(colour, wanted)


def test_silhouettes_agree_with_the_masks():
    mesh, config = build_animated(next(i for i in identities("test", 1) if i.label == "airplane")), ImageConfig()
    K = np.array([[600.0, 0, WIDTH / 2], [0, 600.0, WIDTH / 2], [0, 0, 1.0]])
    pose = look_at(np.array([1.6, -1.2, 0.9]), np.zeros(3))
    camera = CaptureCamera("cam", WIDTH, WIDTH, K, "none", (), pose, "rgb/{frame}.png", None, None, 0.0)
    renderer = SceneRenderer((mesh,), Dome(), config)
    renderer.pose([0.0], np.eye(4)[None])
    mask = renderer.image(camera).full("mask") == 1
    seen = Camera(jnp.asarray(K, jnp.float32), jnp.asarray(pose, jnp.float32), WIDTH, WIDTH)
    # Discs of the shares' own size leave gaps between them: a quarter is what masks ask for, too.
    alpha = np.asarray(render(gaussians_of(mesh, 16384).gaussians(), seen, antialias=True).alpha)
    alpha = alpha > config.mask_threshold
    overlap = np.sum(alpha & mask) / np.sum(alpha | mask)
    print(f"IoU of {mask.sum()} pixels: {overlap:.3f}")
    assert mask.sum() > 10_000 and overlap > 0.9


def test_files_hold_normals(ball, tmp_path):
    found = gaussians_of(ball, 20)
    write_ply(tmp_path / "a.ply", found.gaussians(), normal=found.normal)
    raw = (tmp_path / "a.ply").read_bytes().split(b"end_header\n", 1)[1]
    np.testing.assert_array_equal(np.frombuffer(raw, "<f4").reshape(20, 17)[:, 3:6], found.normal)
    np.testing.assert_allclose(read_ply(tmp_path / "a.ply").mean, found.columns[:, :3], atol=1e-6)


def test_a_recorded_scene_keeps_the_gaussians_of_every_frame(tmp_path):
    """On the surface that the masks and boxes show, in the world's frame, named by the truth."""
    drone = next(i for i in identities("test", 1) if i.label == "drone")
    rig = RandomRigConfig(cameras=3, width=64, height=48, span_px=(30.0, 30.0), distance=(10.0, 10.0))
    plan = plan_sample(drone, SequenceConfig(rigs=(rig,), frames=2), seed=2, assets=tmp_path / "assets")
    record_scene(dataclasses.replace(plan, surface=SurfaceConfig(count=300)), tmp_path / "capture")
    (flown,) = read_capture(tmp_path / "capture").truth.objects
    assert flown.gaussians == "gaussians/object_1/{frame:06d}.ply"
    for state in flown.frames:
        mean = np.asarray(read_ply(tmp_path / "capture" / frame_path(flown.gaussians, state.frame)).mean)
        low, high = np.array(state.aligned_box.low), np.array(state.aligned_box.high)
        assert mean.shape == (300, 3) and np.all(mean >= low - 1e-5) and np.all(mean <= high + 1e-5)
        assert np.all(np.ptp(mean, axis=0) > 0.7 * (high - low))
    assert rotate_truth(Truth((flown,)), np.eye(3)).objects[0].gaussians is None


def test_what_makes_no_sense_is_refused():
    with pytest.raises(UserError, match="count is -1"):
        SurfaceConfig(count=-1)
    with pytest.raises(UserError, match="thickness is 0"):
        dataclasses.replace(SurfaceConfig(), thickness=0.0)
