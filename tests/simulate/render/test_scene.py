"""Pictures of simple solids against closed forms: texture, coverage, depth, normals, flow, occlusion, cost."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from pxr import UsdShade
from support.usd_examples import define_quad, define_textured_material, open_stage, write_picture, write_solid

from aerojax.capture.format import CaptureCamera
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import MOST_SAMPLES, ImageConfig
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from kernels.rays.raytrace import Lighting

FLAT = Lighting(sun=0.0, sky=1.0, ground=1.0)
EVERYTHING = ImageConfig(samples=4, rays_across=0, normals=True, flow=True)
LOOK_ALONG_X = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])


def camera(distance: float = 10.0, focal: float = 400.0, width: int = 200, height: int = 160) -> CaptureCamera:
    """At (-distance, 0, 0), looking along +X with +Z up in the image: u runs along -Y."""
    pose = LOOK_ALONG_X.copy()
    pose[0, 3] = -distance
    K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    return CaptureCamera("cam", width, height, K, "none", (), pose, "rgb/{frame}.png", None, None, 0.0)


def at(*positions: tuple[float, float, float]) -> np.ndarray:
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, 3] = positions
    return poses


@pytest.fixture(scope="module")
def solids(tmp_path_factory):
    folder = tmp_path_factory.mktemp("solids")
    box = write_solid(folder / "box.usda", trimesh.creation.box((1.0, 1.0, 1.0)), (0.2, 0.4, 0.6))
    ball = write_solid(folder / "ball.usda", trimesh.creation.icosphere(5, 0.5))
    return load_animated_mesh(box), load_animated_mesh(ball)


def rendered(meshes, positions, config=EVERYTHING, moved=None, view=None):
    renderer = SceneRenderer(meshes, Dome(FLAT), config)
    zero = [0.0] * len(meshes)
    if moved is None:
        renderer.pose(zero, at(*positions))
    else:
        renderer.pose(zero, at(*positions), next_seconds=zero, next_world_from_body=at(*moved))
    return renderer.image(view or camera())


def test_a_box_has_its_exact_box_depth_colour_and_flow(solids):
    image = rendered(solids[:1], [(0.0, 0.0, 0.0)], moved=[(0.0, -0.1, 0.05)])
    # The near face, at depth 9.5, spans ±0.5·400/9.5 = ±21.05 pixels about (100, 80).
    half = 0.5 * 400 / 9.5
    view = image.objects[0]
    assert view.projected_box == pytest.approx((100 - half, 80 - half, 100 + half, 80 + half), abs=1e-9)
    assert view.box == (79.0, 59.0, 121.0, 101.0) and not view.truncated and view.visibility == 1.0
    assert view.surface_centroid == pytest.approx((-0.5, 0.0, 0.0), abs=2e-3)
    mask, depth = image.full("mask"), image.full("depth")
    assert depth[mask > 0] == pytest.approx(9.5, abs=1e-5) and (mask > 0).sum() == 42 * 42
    assert image.full("normal")[80, 100] == pytest.approx([-1, 0, 0], abs=1e-6)
    assert image.full("flow")[80, 100] == pytest.approx([0.1 * 400 / 9.5, -0.05 * 400 / 9.5], abs=1e-4)
    assert image.full_rgb()[80, 100] == pytest.approx(1.055 * np.array([0.2, 0.4, 0.6]) ** (1 / 2.4) - 0.055, abs=1e-5)
    assert image.full_rgb8()[0, 0].tolist() == [255, 255, 255]


def test_coverage_is_exact_to_a_sample(solids):
    image = rendered(solids[:1], [(0.0, 0.013, 0.021)])
    coverage, step = image.full("coverage"), (np.arange(4) + 0.5) / 4

    def covered(size: int, low: float, high: float) -> np.ndarray:
        samples = np.arange(size)[:, None] + step
        return ((samples > low) & (samples < high)).mean(axis=1)

    scale = 400 / 9.5
    across = covered(200, 100 - (0.5 + 0.013) * scale, 100 + (0.5 - 0.013) * scale)
    down = covered(160, 80 - (0.5 + 0.021) * scale, 80 + (0.5 - 0.021) * scale)
    np.testing.assert_allclose(coverage, np.outer(down, across), atol=1e-6)


@pytest.mark.parametrize("distance", [20.0, 80.0, 180.0])
def test_what_is_visible_has_a_box_to_a_fraction_of_a_pixel(solids, distance):
    # Of cubes from 20 to 2 pixels, away from the axis; the box of whole pixels is off by up to one.
    place = (0.0, 0.03 * distance, 0.01 * distance)
    view = rendered(solids[:1], [place], ImageConfig(), view=camera(distance)).objects[0]
    np.testing.assert_allclose(view.visible_box, view.projected_box, atol=0.5 / MOST_SAMPLES + 1e-3)
    coarse = rendered(solids[:1], [place], ImageConfig(samples=1, rays_across=0), view=camera(distance)).objects[0]
    assert coarse.visible_box == coarse.box


def test_the_visible_box_ends_where_another_object_begins(solids):
    hidden, near = rendered((solids[0],) * 2, [(10.0, 0.0, 0.0), (0.0, -0.5, 0.0)], ImageConfig()).objects
    assert hidden.visible_box[2] == pytest.approx(100.0, abs=0.2) and hidden.projected_box[2] > 110
    assert near.visible_box == pytest.approx(near.projected_box, abs=0.2)


def test_a_sphere_has_its_outline_depth_and_normals(solids):
    image = rendered((solids[1],), [(0.0, 0.0, 0.0)], ImageConfig(samples=4, normals=True))
    # Silhouette cone: tan = r / sqrt(d² - r²).
    radius = 400 * 0.5 / np.sqrt(100 - 0.25)
    assert image.full("coverage").sum() == pytest.approx(np.pi * radius**2, rel=4e-3)
    rows, columns = np.nonzero(image.full("depth") > 0)
    local = np.stack([(columns + 0.5 - 100) / 400, (rows + 0.5 - 80) / 400], axis=1)
    square = 1.0 + (local**2).sum(axis=1)
    exact = (10 - np.sqrt(np.maximum(100 - square * (100 - 0.25), 0.0))) / square
    inner = (local**2).sum(axis=1) < (0.8 * radius / 400) ** 2
    assert image.full("depth")[rows, columns][inner] == pytest.approx(exact[inner], abs=2e-3)
    point = np.stack([exact - 10, -local[:, 0] * exact, -local[:, 1] * exact], axis=1) / 0.5
    agreement = (image.full("normal")[rows, columns] * point).sum(axis=1)
    assert agreement[inner].min() > 0.99


def test_every_mask_pixel_has_a_depth_and_thin_parts_too(solids):
    image = rendered(solids, [(0, 0.3, 0.2), (1.0, -0.4, 0.0)], ImageConfig(samples=3), view=camera(80.0))
    assert (image.mask > 0).any() and (image.depth[image.mask > 0] > 0).all()


def test_the_nearer_object_hides_the_other(solids):
    # Both cubes' faces: the far one at depth 19.5 is covered on the half that the near one reaches over.
    box = solids[0]
    config = ImageConfig(samples=4)
    alone = rendered((box,), [(10.0, 0.0, 0.0)], config)
    both = rendered((box, box), [(10.0, 0.0, 0.0), (0.0, -0.5, 0.0)], config)
    hidden, near = both.objects
    # The near cube covers u from 100 to 142, the right half of the far face; 0.5 of it stays.
    assert hidden.visibility == pytest.approx(0.5, abs=0.01) and near.visibility == 1.0
    assert alone.objects[0].visibility == 1.0
    mask = both.full("mask")
    assert mask[80, 95] == 1 and mask[80, 105] == 2
    assert both.full("depth")[80, 95] == pytest.approx(19.5, abs=1e-4)
    assert both.objects[0].box == (89.0, 69.0, 100.0, 91.0)  # its edges at 89.74 cover a quarter of a pixel


def test_truncation_is_flagged_and_objects_behind_are_absent(solids):
    image = rendered((solids[0], solids[0]), [(0.0, 2.4, 0.0), (-20.0, 0.0, 0.0)])
    cut, behind = image.objects
    assert cut.truncated and cut.projected_box[0] < 0 and cut.box[0] == 0
    assert cut.visibility == 1.0  # of what lies inside the image
    assert behind.projected_box is None and behind.box is None and behind.truncated


def test_an_object_around_the_camera_is_seen_from_inside(solids):
    image = rendered(solids[:1], [(-10.2, 0.0, 0.0)])
    assert (image.full("mask") == 1).all() and image.objects[0].projected_box is None
    assert image.full("depth")[80, 100] == pytest.approx(0.3, abs=1e-6)


def test_rays_grow_with_the_object_and_not_with_the_image(solids):
    small = rendered(solids[:1], [(0.0, 0.0, 0.0)])
    large = rendered(solids[:1], [(0.0, 0.0, 0.0)], view=camera(width=1200, height=1000))
    assert small.rays == large.rays
    assert small.rays < 44 * 44 * 5 + 4 * 44 * 2 * 17  # four rays and a centre inside, sixteen along the outline
    apart = rendered((solids[0], solids[0]), [(0.0, 1.5, 1.0), (0.0, -1.5, -1.0)])
    assert apart.rays < 2.2 * small.rays


def test_the_same_scene_gives_the_same_bits(solids):
    first, again = (rendered(solids, [(0, 0.3, 0.2), (1.0, -0.4, 0.0)]) for _ in range(2))
    for name in ("rgb", "mask", "coverage", "depth", "normal", "flow"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert first.objects == again.objects


def test_objects_shade_each_other(solids):
    pose = np.array([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 10.0], [0, 0, 0, 1]], float)  # from above, u along +Y
    view = camera()
    view = CaptureCamera(**{**vars(view), "world_from_cam": pose})
    tilted = Lighting((0.0, 0.6, 0.8), sun=1.0, sky=0.0, ground=0.0, shadows=True)
    slanted = SceneRenderer((solids[0], solids[0]), Dome(tilted), ImageConfig(samples=1))
    slanted.pose([0.0, 0.0], at((0.0, 0.0, 0.0), (0.0, 1.9, 2.0)))
    image = slanted.image(view).full_rgb()
    # A ray from the lower cube's top rises 2 m to the upper one's top and moves 1.5 m aside on the way: those from
    # y < -0.1 pass below y = 1.4, the upper cube's side, and those from -0.1 to 0.5 meet it.
    scale = 400 / 9.5
    assert image[80, int(100 - 0.3 * scale)].max() > 0.3
    assert image[80, int(100 + 0.2 * scale)].max() == 0.0


def test_a_texture_shows_its_texels(tmp_path):
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0, 0], picture[0, 1], picture[1, 0], picture[1, 1] = (255, 0, 0), (0, 255, 0), (0, 0, 255), (90, 90, 90)
    write_picture(tmp_path / "skin.png", picture)
    stage = open_stage(tmp_path / "quad.usda")
    quad = define_quad(stage, "/quad")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).Bind(define_textured_material(stage, "/look", "./skin.png"))
    stage.Save()
    mesh = load_animated_mesh(tmp_path / "quad.usda")
    image = rendered((mesh,), [(0.0, 0.0, 0.0)], ImageConfig(samples=1)).full_rgb8()
    # Half a unit from the middle are 20 pixels; texel centres are at a quarter. Seen along +X, u runs to the left.
    assert image[70, 109].tolist() == pytest.approx([255, 0, 0], abs=50)
    assert image[70, 90].tolist() == pytest.approx([0, 255, 0], abs=50)
    assert image[89, 109].tolist() == pytest.approx([0, 0, 255], abs=50)
    assert image[89, 90].tolist() == pytest.approx([90, 90, 90], abs=20)
    # The middle is the mean of four in linear light: red (1 + 0.102)/4.
    mean = (np.array([1.0, 1.0, 1.0]) + 0.1022) / 4
    assert image[79:81, 99:101].mean(axis=(0, 1)) == pytest.approx(255 * (1.055 * mean ** (1 / 2.4) - 0.055), abs=4)


def test_moving_frames_are_rigid_and_turn(tmp_path):
    stage = open_stage(tmp_path / "a.usda")
    stage.SetTimeCodesPerSecond(10)
    stage.SetEndTimeCode(10)
    quad = define_quad(stage, "/quad")
    quad.AddTranslateOp().Set((0.0, 0.0, 2.0))
    turn = quad.AddRotateZOp()
    turn.Set(0.0, 0)
    turn.Set(360.0, 10)
    quad.AddScaleOp().Set((3.0, 3.0, 3.0))
    stage.Save()
    pose = load_animated_mesh(tmp_path / "a.usda").joints_at(0.25)["/quad"]
    expected = [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]
    np.testing.assert_allclose(pose, expected, atol=1e-6)
