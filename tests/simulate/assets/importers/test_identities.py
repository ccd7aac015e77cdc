"""Users' models as identities of the catalogue."""

from __future__ import annotations

import pytest
from support.gltf_files import triangle
from support.model_imports import write_list

from aerojax.core.errors import UserError
from aerojax.simulate.assets.catalogue import families_of
from aerojax.simulate.assets.importers.identities import imported_identities


def test_identity_carries_its_model(tmp_path):
    triangle().write(tmp_path / "a.glb")
    fields = "forward: +X, up: +Y, split: val, licence: MIT, source: mine"
    (one,) = imported_identities(write_list(tmp_path, "a.glb", fields, name="my_bird"))
    assert (one.name, one.label, one.family, one.split) == ("my_bird", "bird", "imported", "val")
    assert one.model is not None and (one.model.licence, one.model.source, one.model.scale) == ("MIT", "mine", "auto")


def test_names_of_the_catalogue_are_refused(tmp_path):
    triangle().write(tmp_path / "a.glb")
    name = f"bird_{next(iter(families_of('bird')))}_00"
    (tmp_path / "models.yaml").write_text(f"models:\n  - {{name: {name}, file: a.glb, class: bird}}\n")
    with pytest.raises(UserError, match=f"name {name} belongs to the procedural catalogue"):
        imported_identities(tmp_path / "models.yaml")
