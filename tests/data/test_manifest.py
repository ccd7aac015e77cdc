"""The manifest of a data set: read as it was written, and refused where it does not serve."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.files import json_text
from aerojax.data.manifest import (
    FORMAT,
    VERSION,
    IdentityEntry,
    Manifest,
    RigRecord,
    SequenceEntry,
    TrueCamera,
    manifest_to_json,
    read_datasets,
    read_manifest,
    read_sequence_entry,
    write_manifest,
    write_sequence_entry,
)


def _manifest(folder: Path) -> Manifest:
    rig = RigRecord({"fps": 30.0, "radii": [16.0]}, {"jax": "0.10"}, None)
    owl = IdentityEntry("owl_00", "bird", "owl", "train", folder / "assets/owl_00.usdc", "CC-BY-4.0", "aerojax")
    path, first = folder / "train/sim1_owl_00", ("sim1_owl_00", "bird", "owl_00", "train", "sim1")
    plain = SequenceEntry(path, *first, 12, 30.0, ("owl_00", "owl_01"), 4, 16.125)
    moved = (TrueCamera("cam_01", np.eye(3), np.eye(4)),)
    wrong = SequenceEntry(path, *first, 12, 30.0, ("owl_00",), 4, 16.125, (3, 4), 16.0, -20.0, moved)
    return Manifest(7, "CC-BY-4.0", {"sim1": rig}, {"sim1": {"sequences": 2}}, (owl,), (plain, wrong))


def test_a_manifest_is_read_as_it_was_written(tmp_path):
    manifest = _manifest(tmp_path)
    write_manifest(manifest, tmp_path)
    text = (tmp_path / "dataset.json").read_text()
    again = read_manifest(tmp_path)
    assert json_text(manifest_to_json(again, tmp_path)) == text
    assert again.identities == manifest.identities and again.sequences[0] == manifest.sequences[0]
    assert again.sequences[1].true_cameras[0].world_from_cam.shape == (4, 4)
    raw = json.loads(text)
    assert raw["sequences"][0]["folder"] == "train/sim1_owl_00" and "radius_m" not in raw["sequences"][0]
    assert raw["sequences"][0]["objects"][1] == {"id": 2, "identity": "owl_01"}
    assert raw["identities"][0]["asset"] == "assets/owl_00.usdc"
    both = read_datasets([tmp_path, tmp_path])
    assert len(both.sequences) == 4 and both.rigs == ("sim1",)


def test_a_sequence_holds_its_entry_while_it_is_elsewhere(tmp_path):
    entry = _manifest(tmp_path).sequences[0]
    write_sequence_entry(entry, tmp_path, tmp_path / "train/sim1_owl_00.partial")
    assert read_sequence_entry(tmp_path, tmp_path / "train/sim1_owl_00.partial") == entry


@pytest.mark.parametrize(
    ("content", "code", "message"),
    [
        (None, "missing", "does not exist"),
        ("{", "unreadable", "not valid JSON"),
        ("[]", "unreadable", "format is not aerojax-dataset"),
        ({"format": "coco"}, "unreadable", "format is not aerojax-dataset"),
        ({"version": 2}, "unreadable", "version is 2, known is 1"),
        ({"sequences": [{}]}, "missing", "folder is missing"),
        ({"sequences": [3]}, "unreadable", "entries of another form"),
        ({"sequences": []}, "missing", "lists no sequences"),
    ],
)
def test_manifests_that_do_not_serve(tmp_path, content, code, message):
    if isinstance(content, dict):
        whole = {"format": FORMAT, "version": VERSION, "seed": 0, "licence": "x", "rigs": {}, "counts": {}}
        content = json.dumps(whole | {"identities": [], "sequences": []} | content)
    if content is not None:
        (tmp_path / "dataset.json").write_text(content)
    with pytest.raises(UserError, match=message) as error:
        read_datasets([tmp_path])
    assert error.value.code == code


def test_no_folder():
    with pytest.raises(UserError, match="dataset=DIR"):
        read_datasets([])


@pytest.mark.parametrize("path", ["/etc", "../other", "a/../../b", "C:\\x", "..\\x"])
@pytest.mark.parametrize(("part", "field"), [("sequences", "folder"), ("identities", "asset")])
def test_paths_that_leave_the_folder_are_refused(tmp_path, part, field, path):
    write_manifest(_manifest(tmp_path), tmp_path)
    raw = json.loads((tmp_path / "dataset.json").read_text())
    raw[part][0][field] = path
    (tmp_path / "dataset.json").write_text(json.dumps(raw))
    with pytest.raises(UserError, match=r"dataset\.json: has entries of another form .*leaves the data set's folder"):
        read_manifest(tmp_path)


def test_nesting_without_end_is_refused(tmp_path):
    (tmp_path / "dataset.json").write_text("[" * 100_000)
    with pytest.raises(UserError, match=r"dataset\.json: is not valid JSON"):
        read_manifest(tmp_path)
