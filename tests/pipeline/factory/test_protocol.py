"""The protocol's scenes: cameras where the thesis has them, images that show the whole object, models of a folder."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from aerojax.core.errors import UserError
from aerojax.evaluate.reconstruction import true_surface
from aerojax.pipeline.factory.protocol import ProtocolConfig, circle_directions, protocol_scenes
from aerojax.pipeline.factory.subjects import model_subjects

CONFIG = ProtocolConfig(size=48, targets=4, rays_across=128)


@pytest.fixture(scope="module")
def boxes(tmp_path_factory):
    """Scenes of a box of two metres and of one ten times as large, converted from files."""
    folder = tmp_path_factory.mktemp("models")
    for name, size in (("large", 10.0), ("small", 1.0)):
        mesh = trimesh.creation.box((2.0 * size, size, 0.5 * size))
        (folder / f"{name}.stl").write_bytes(mesh.export(file_type="stl"))
    return protocol_scenes(model_subjects(folder, folder / "assets"), CONFIG)


def test_context_views_stand_on_a_circle():
    away = circle_directions(4, 20.0)
    np.testing.assert_allclose(np.rad2deg(np.arcsin(away[:, 2])), 20.0)
    np.testing.assert_allclose(np.diff(np.rad2deg(np.unwrap(np.arctan2(away[:, 1], away[:, 0])))), 90.0)


def test_objects_of_any_size_fill_the_images_alike(boxes):
    assert boxes.name == ("large", "small") and boxes.valid.sum(axis=1).tolist() == [4, 4]
    np.testing.assert_allclose(boxes.mask[0].astype(float), boxes.mask[1], atol=2)
    distance = np.linalg.norm(boxes.world_from_cam[:, 0, :3, 3], axis=-1)
    assert distance[0] == pytest.approx(10 * distance[1], rel=1e-4)
    for masks in (boxes.mask, boxes.target_mask):
        assert not masks[..., [0, -1], :].any() and not masks[..., :, [0, -1]].any()
        assert (masks > 127).mean() > 0.05
    # The frame has the first camera's axes.
    np.testing.assert_allclose(boxes.world_from_cam[:, 0, :3, :3], np.broadcast_to(np.eye(3), (2, 3, 3)), atol=1e-6)


def test_depth_finds_the_surface(boxes):
    points = true_surface(boxes, 1)
    # The box's middle is the origin; its faces are 1, 0.5 and 0.25 metres away, in axes that are turned.
    distance = np.linalg.norm(points, axis=1)
    assert distance.min() > 0.22 and distance.max() < np.sqrt(1 + 0.25 + 0.0625) + 0.05


def test_a_folder_without_models_is_refused(tmp_path):
    with pytest.raises(UserError, match="holds no model"):
        model_subjects(tmp_path, tmp_path)
