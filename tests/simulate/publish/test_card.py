"""Card and metadata of a data set of two sequences."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerojax.core.files import sha256_of_file
from aerojax.data.manifest import IdentityEntry, Manifest, RigRecord, SequenceEntry, write_manifest
from aerojax.simulate.publish.card import readme_text, size_category
from aerojax.simulate.publish.croissant import croissant_mapping


def manifest_in(folder: Path) -> Manifest:
    licences = {"gull": "Apache-2.0", "mavic": "CC-BY-4.0"}
    identities = tuple(
        IdentityEntry(name, label, name, "test", folder / f"assets/{name}.usdc", licences[name], "aerojax")
        for name, label in (("gull", "bird"), ("mavic", "drone"))
    )
    sequences = tuple(
        SequenceEntry(folder / f"test/{i.name}", i.name, i.label, i.name, "test", "sim1", 3, 30.0, (i.name,), 4, 16.0)
        for i in identities
    )
    rigs = {"sim1": RigRecord({"frames": 3}, {"numpy": "2.0"}, None)}
    return Manifest(5, "CC-BY-4.0", rigs, {"sim1": {"sequences": 2}}, identities, sequences)


def test_the_card_counts_what_the_manifest_lists(tmp_path):
    card = readme_text(manifest_in(tmp_path))
    assert card.startswith("---\nlicense: cc-by-4.0\n") and "- n<1K" in card
    assert "2 identities, 2 sequences, 24 images, seed 5" in card
    assert "| sim1 | test | 1 | 1 | 0 | 0 | 2 | 6 |" in card
    assert "- sim1: commit unknown, numpy 2.0" in card and "Apache-2.0 (1), CC-BY-4.0 (1)" in card


@pytest.mark.parametrize(
    ("images", "words"), [(999, "n<1K"), (1000, "1K<n<10K"), (99_999, "10K<n<100K"), (10**6, "1M<n<10M")]
)
def test_size_categories(images, words):
    assert size_category(images) == words


def test_metadata_refer_to_the_manifest_by_its_hash(tmp_path):
    manifest = manifest_in(tmp_path)
    (listing,) = croissant_mapping(manifest, tmp_path)["distribution"]
    write_manifest(manifest, tmp_path)
    assert listing["sha256"] == sha256_of_file(tmp_path / "dataset.json")
