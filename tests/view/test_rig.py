"""The picture of a network: well-formed, every camera named and drawn where it stands."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from support.broken_captures import make_camera

from aerojax.view.rig import rig_picture

SVG = "{http://www.w3.org/2000/svg}"


def test_cameras_and_track_are_drawn():
    cameras = [make_camera(index, name=f"<cam> {index}") for index in range(3)]
    track = np.array([[0.0, 0.0, 1.0], [0.5, 0.2, 1.1], [np.nan, 0.0, 0.0]])
    root = ET.fromstring(rig_picture(cameras, track, "flight & more"))
    texts = [text.text for text in root.iter(f"{SVG}text")]
    assert texts[0] == "flight & more" and texts.count("<cam> 1") == 2
    assert len(root.findall(f"{SVG}circle[@class='camera']")) == 6
    assert len(root.findall(f"{SVG}circle[@class='spot']")) == 4
    assert len(root.findall(f"{SVG}polygon")) == 24
    seen = [(float(c.get("cx", "nan")), float(c.get("cy", "nan"))) for c in root.findall(f"{SVG}circle")]
    assert all(0 <= x <= 720 and 0 <= y <= 950 for x, y in seen)
    above = root.findall(f"{SVG}circle[@class='camera']")[:3]
    xs = [float(c.get("cx", "nan")) for c in above]
    order = np.argsort([camera.world_from_cam[0, 3] for camera in cameras])
    assert np.argsort(xs).tolist() == order.tolist()


def test_without_an_object_and_far_from_the_origin():
    cameras = [make_camera(index) for index in range(3)]
    for camera in cameras:
        camera.world_from_cam[:3, 3] += 1e4
    ET.fromstring(rig_picture(cameras))
