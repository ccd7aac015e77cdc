"""The landscape: shadows where geometry says, relighting against a direct cast, occlusion, sky, and determinism."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from support.usd_examples import write_solid

from aerojax.capture.format import CaptureCamera
from aerojax.geometry.cameras import project_points
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.render.outdoors import OutdoorConfig, Outdoors
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from aerojax.simulate.world.landscape import LandscapeConfig, Terrain, build_landscape
from aerojax.simulate.world.sky import (
    SkyConfig,
    cloud_noise,
    daylight,
    sky_illuminance,
    sky_luminance,
    sun_direction,
    sun_illuminance,
)
from kernels.rays.landscape import PLAIN, LandscapeMesh

SMALL = LandscapeConfig(trees=6, woods=1, hedges=1, buildings=2)
CLEAR = SkyConfig(sun_azimuth=90.0, sun_elevation=45.0, cloud_cover=0.0, sun_azimuth_rate=0.0)


def looking_down(height: float = 30.0, focal: float = 300.0, size: int = 200) -> CaptureCamera:
    """Above the origin, u along +X, v along -Y."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = height
    K = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1.0]])
    return CaptureCamera("above", size, size, K, "none", (), pose, "rgb/{frame}.png", None, None, 0.0)


def looking_north(size: int = 160) -> CaptureCamera:
    """Level, 3 m high."""
    pose = np.array([[1, 0, 0, 0], [0, 0, 1, -20.0], [0, -1, 0, 3.0], [0, 0, 0, 1.0]])
    K = np.array([[150.0, 0, size / 2], [0, 150.0, size / 2], [0, 0, 1.0]])
    return CaptureCamera("north", size, size, K, "none", (), pose, "rgb/{frame}.png", None, None, 0.0)


def plain_land(wall: bool = False) -> LandscapeMesh:
    """A level square of one colour, and a wall at y = -10 that reaches up to 3 m."""
    vertices = np.array([(-90, -90, 0), (90, -90, 0), (90, 90, 0), (-90, 90, 0)], np.float32)
    faces = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
    if wall:
        board = np.array([(-90, -10, 0), (90, -10, 0), (90, -10, 3), (-90, -10, 3)], np.float32)
        vertices, faces = np.concatenate([vertices, board]), np.concatenate([faces, faces + 4])
    albedo = np.full((len(faces), 3), 0.3, np.float32)
    return LandscapeMesh(vertices, faces, albedo, np.full(len(faces), PLAIN, np.int32), np.zeros((1, 3), np.float32), 1)


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("box") / "box.usda"
    return load_animated_mesh(write_solid(path, trimesh.creation.box((1.0, 1.0, 1.0))))


def placed(box, environment, position, config=None) -> SceneRenderer:
    renderer = SceneRenderer((box,), environment, config or ImageConfig(samples=4, normals=True))
    pose = np.eye(4)[None].copy()
    pose[0, :3, 3] = position
    renderer.pose([0.0], pose)
    return renderer


def test_the_shadow_of_a_box_falls_where_geometry_says(box):
    environment = Outdoors(plain_land(), CLEAR)
    view = looking_down()
    image = placed(box, environment, (0.0, 0.0, 4.0)).image(view)
    lit = Outdoors(plain_land(), CLEAR).background
    empty = lit(view, 0.0, placed(box, environment, (500.0, 0.0, 4.0))._caster)
    darker = image.background.astype(int).sum(axis=2) < empty.astype(int).sum(axis=2) - 30
    # The sun stands at 45 degrees over +Y: a point at height h throws its shadow to y - h. The box's corners reach from
    # y + z = 0.5 + ... : y from -0.5 - 4.5 to 0.5 - 3.5, x from -0.5 to 0.5.
    rows, columns = np.nonzero(darker)
    low = project_points(np.array([[-0.5, -5.0, 0.0], [0.5, -3.0, 0.0]]), view)
    assert columns.min() == pytest.approx(low[0, 0], abs=1.0) and columns.max() + 1 == pytest.approx(low[1, 0], abs=1.0)
    assert rows.max() + 1 == pytest.approx(low[0, 1], abs=1.0) and rows.min() == pytest.approx(low[1, 1], abs=1.0)
    assert darker.sum() == pytest.approx(2.0 * 1.0 * (300 / 30) ** 2, rel=0.1)


def test_the_wall_hides_and_shades(box):
    environment = Outdoors(plain_land(wall=True), CLEAR)
    # The camera at height 3 looks level over the wall's upper edge, which projects to the image's middle row.
    image = placed(box, environment, (0.0, 0.0, 3.0)).image(looking_north())
    view = image.objects[0]
    assert view.visibility == pytest.approx(0.5, abs=0.03)
    assert view.box is not None and view.box[3] == 80.0
    hidden = placed(box, environment, (0.0, 0.0, 1.0)).image(looking_north())
    assert hidden.objects[0].visibility == 0.0 and not hidden.full("mask").any()


def test_light_of_the_land_is_albedo_times_irradiance_behind_haze(box):
    environment = Outdoors(plain_land(), CLEAR, OutdoorConfig(edge_samples=2))
    view = looking_down()
    image = placed(box, environment, (500.0, 0.0, 4.0)).image(view)
    light = daylight(CLEAR, 0.0)
    lighting = light.lighting
    level = np.array(lighting.sun_colour) * lighting.sun_direction[2] + np.array(lighting.sky_colour)
    clear = np.exp(-3.912 / CLEAR.visibility * 30.0)
    mean = clear * 0.3 * level + (1 - clear) * light.airlight
    encoded = 255 * (1.055 * np.clip(mean, 0, 1) ** (1 / 2.4) - 0.055)
    middle = image.full_rgb8()[60:140, 60:140].reshape(-1, 3)
    assert middle.mean(axis=0) == pytest.approx(encoded, rel=0.05)  # grain of 15 %, much less in the mean


def test_relighting_equals_a_cast_from_scratch(box):
    sky = SkyConfig(sun_azimuth=30.0, sun_elevation=35.0, sun_azimuth_rate=2.0)
    land = build_landscape(SMALL, np.zeros((1, 2)), seed=5)
    warm, fresh = Outdoors(land, sky), Outdoors(land, sky)
    view = looking_north()
    moving = placed(box, warm, (0.0, 0.0, 6.0))
    moving.image(view, time=0.0)
    rays = warm.rays
    moving.image(view, time=0.3)  # 0.6 degrees: lit again, shadows kept
    assert warm.rays == rays
    later = moving.image(view, time=2.0)  # 4 degrees: the sun's shadows are cast again
    assert warm.rays > rays
    again = placed(box, fresh, (0.0, 0.0, 6.0)).image(view, time=2.0)
    np.testing.assert_array_equal(later.full_rgb8(), again.full_rgb8())
    assert later.objects == again.objects


def test_sceneries_are_seeded_and_keep_clear():
    points = np.array([[60.0, 0.0], [0.0, -80.0]])
    one, two, other = (build_landscape(SMALL, points, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.vertices, two.vertices)
    assert one.vertices.shape != other.vertices.shape or not np.array_equal(one.vertices, other.vertices)
    assert one.faces.max() < len(one.vertices) and np.isfinite(one.vertices).all()
    tall = one.vertices[one.vertices[:, 2] > 1.0]
    for point in (*points, np.zeros(2)):
        assert np.hypot(*(tall[:, :2] - point).T).min() > 3.0
    terrain = Terrain(SMALL, np.random.default_rng(0))
    assert terrain.height(np.array([[50.0, 50.0]])) == pytest.approx(0.0)


def test_the_sky_has_the_published_zenith_and_colours():
    # Preetham 1999: Yz = (4.0453 T - 4.9710) tan((4/9 - T/120)(π - 2θ)) - 0.2155 T + 2.4192 kcd/m².
    to_sun = sun_direction(SkyConfig(sun_elevation=50.0), 0.0)
    zenith = sky_luminance(np.array([[0.0, 0.0, 1.0]]), to_sun, 3.0)[0]
    luminance = zenith @ [0.2126, 0.7152, 0.0722]
    angle = np.deg2rad(40.0)
    expected = (4.0453 * 3 - 4.9710) * np.tan((4 / 9 - 3 / 120) * (np.pi - 2 * angle)) - 0.2155 * 3 + 2.4192
    assert luminance == pytest.approx(expected, rel=2e-3)
    assert zenith[2] > 1.5 * zenith[0]  # blue
    low, high = (sun_illuminance(sun_direction(SkyConfig(sun_elevation=e), 0.0), 3.0) for e in (5.0, 60.0))
    assert high.sum() > 2 * low.sum() and low[0] / low[2] > high[0] / high[2]  # dim and red at the horizon
    assert 5.0 < sky_illuminance(to_sun, 3.0).mean() < 40.0  # klux of a clear sky


def test_sun_moves_and_clouds_are_periodic():
    start, end = (sun_direction(SkyConfig(sun_azimuth_rate=1.0), t) for t in (0.0, 90.0))
    assert start[:2] @ end[:2] == pytest.approx(0.0, abs=1e-9)
    noise = cloud_noise(3, 64)
    assert noise.mean() == pytest.approx(0.5, abs=0.01)
    inside, across = np.abs(np.diff(noise, axis=0)).mean(), np.abs(noise[0] - noise[-1]).mean()
    assert across < 2 * inside
