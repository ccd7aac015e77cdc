"""Boxes in space as COCO and Replicator have them: by hand, and back through the importer."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.export_examples import BALLS, moved, write_balls

from aerojax.capture.format import write_capture_json
from aerojax.capture.imports.replicator import ReplicatorImport, import_replicator
from aerojax.data.exports.export import export_dataset
from aerojax.data.exports.sources import ExportOptions, find_sequences
from aerojax.geometry.boxes_3d import AlignedBox, OrientedBox, box_corners
from aerojax.geometry.cameras import project_points

TURN = Rotation.from_euler("zyx", [0.7, -0.3, 0.4])
OFFSET = (0.1, 0.0, -0.05)
"""Of a box's middle from the body's origin, metres, body frame."""


def boxed(capture):
    """The capture with bodies that are turned, each in a box of its own radius by 1, 1.5 and 2 along its axes."""
    x, y, z, w = TURN.as_quat().tolist()

    def state_of(item, state):
        radius, position = BALLS[item.object_id][2], np.array(state.position)
        box = OrientedBox(tuple((position + TURN.apply(OFFSET)).tolist()), (radius, 1.5 * radius, 2 * radius))
        corners = {c.name: project_points(box_corners(box, TURN.as_matrix()), c) for c in capture.cameras}
        return dataclasses.replace(
            state,
            orientation_wxyz=(w, x, y, z),
            oriented_box=box,
            aligned_box=AlignedBox(tuple((position - 1).tolist()), tuple((position + 1).tolist())),
            projected_corners={name: tuple(map(tuple, pixels.tolist())) for name, pixels in corners.items()},
        )

    objects = tuple(
        dataclasses.replace(item, frames=tuple(state_of(item, state) for state in item.frames))
        for item in capture.truth.objects
    )
    return dataclasses.replace(capture, truth=dataclasses.replace(capture.truth, objects=objects))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("boxes")
    write_capture_json(boxed(write_balls(folder / "balls")), overwrite=True)
    for name in ("coco", "replicator"):
        export_dataset(find_sequences(folder / "balls"), name, folder / "out", ExportOptions())
    return folder / "out"


def test_coco_says_where_an_object_is_in_space(made):
    coco = json.loads((made / "coco/annotations/instances_all.json").read_text())
    image = next(i for i in coco["images"] if (i["camera"], i["frame"]) == ("cam_02", 1))
    (found,) = [a for a in coco["annotations"] if (a["image_id"], a["instance_id"]) == (image["id"], 2)]
    place = np.array(moved(2, 1, 0.0))
    np.testing.assert_allclose(found["bbox_3d"]["centre"], place + TURN.apply(OFFSET), atol=1e-12)
    assert found["bbox_3d"]["size"] == pytest.approx([0.6, 0.9, 1.2])
    turn = Rotation.from_quat(found["bbox_3d"]["orientation_wxyz"], scalar_first=True)
    assert (turn.inv() * TURN).magnitude() < 1e-12
    np.testing.assert_allclose(found["bbox_3d_aligned"]["high"], place + 1, atol=1e-12)
    # The last corner is the highest along all three of the body's axes; seen with the image's own K and pose.
    corner = place + TURN.apply(np.array(OFFSET) + np.array([0.3, 0.45, 0.6]))
    pose = np.array(image["world_from_cam"])
    u, v, depth = np.array(image["K"]) @ (pose[:3, :3].T @ (corner - pose[:3, 3]))
    np.testing.assert_allclose(found["bbox_3d_corners"][7], [u / depth, v / depth], atol=1e-9)


def test_replicator_boxes_in_space(made, tmp_path):
    (folder,) = made.glob("replicator/*/*/cam_02/bounding_box_3d")
    rows = np.load(folder / "bounding_box_3d_0001.npy")
    names = json.loads((folder / "bounding_box_3d_prim_paths_0001.json").read_text())
    row = rows[names.index("/World/object_00002_bird")]
    low, high = (np.array([row[f"{axis}_{end}"] for axis in "xyz"]) for end in ("min", "max"))
    np.testing.assert_allclose((low + high) / 2, OFFSET, atol=1e-6)
    np.testing.assert_allclose(high - low, [0.6, 0.9, 1.2], atol=1e-6)
    corner = np.append(high, 1.0) @ row["transform"]  # row vectors
    np.testing.assert_allclose(corner[:3], np.array(moved(2, 1, 0.0)) + TURN.apply(high), atol=1e-5)
    back = import_replicator(folder.parents[1], tmp_path / "back", ReplicatorImport(30.0))
    for item in back.truth.objects:
        for state in item.frames:
            np.testing.assert_allclose(state.position, moved(item.object_id, state.frame, 0.0), atol=1e-5)
            found = Rotation.from_quat(state.orientation_wxyz, scalar_first=True)
            assert (found.inv() * TURN).magnitude() < 1e-6
