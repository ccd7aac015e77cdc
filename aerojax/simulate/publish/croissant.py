"""Croissant 1.1 metadata (JSON-LD) of a data set: catalogues find it by them, loaders read its list of sequences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aerojax.core.files import json_text, sha256_of_text
from aerojax.data.manifest import VERSION, Manifest, manifest_to_json
from aerojax.simulate.publish.card import ABOUT, LICENCE_ADDRESS, NAME

_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "containedIn": "cr:containedIn",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileProperty": "cr:fileProperty",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
_TEXT, _WHOLE, _NUMBER = "sc:Text", "sc:Integer", "sc:Float"
_COLUMNS = (
    ("name", _TEXT, "Unique name of the sequence."),
    ("folder", _TEXT, "Its capture folder, relative to this file."),
    ("class", _TEXT, "bird, drone, airplane or helicopter."),
    ("identity", _TEXT, "The individual that flies."),
    ("split", _TEXT, "train, val or test; identities and families belong to one split."),
    ("rig", _TEXT, "Camera network."),
    ("frames", _WHOLE, "Moments in the sequence."),
    ("cameras", _WHOLE, "Cameras that saw each of them."),
    ("fps", _NUMBER, "Frames a second."),
    ("distance_m", _NUMBER, "Mean distance from the cameras to the object, metres."),
)


def croissant_mapping(manifest: Manifest, dataset: Path) -> dict[str, Any]:
    """The content of `croissant.json`.

    Args:
        manifest: the metadata refer to its file, `dataset.json`, with the SHA-256.
        dataset: folder of the data set.
    """
    listing = {"@id": "dataset.json"}
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": NAME,
        "description": ABOUT,
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        "license": LICENCE_ADDRESS,
        "version": f"{VERSION}.0.0",
        "citeAs": f"{NAME}, a synthetic multi-camera data set of flying objects, generated with aerojax.",
        "isLiveDataset": False,
        "distribution": [
            {
                "@type": "cr:FileObject",
                "@id": listing["@id"],
                "name": listing["@id"],
                "description": "Manifest: rigs, identities and sequences.",
                "contentUrl": listing["@id"],
                "encodingFormat": "application/json",
                "sha256": sha256_of_text(json_text(manifest_to_json(manifest, dataset))),
            },
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": "sequences",
                "name": "sequences",
                "description": "One record a sequence; its folder holds capture.json, truth.json and the images.",
                "key": {"@id": "sequences/name"},
                "field": [_field(*column, listing) for column in _COLUMNS],
            },
        ],
    }


def _field(name: str, kind: str, description: str, listing: dict[str, str]) -> dict[str, Any]:
    return {
        "@type": "cr:Field",
        "@id": f"sequences/{name}",
        "name": name,
        "description": description,
        "dataType": kind,
        "source": {"fileObject": listing, "extract": {"jsonPath": f"$.sequences[*].{name}"}},
    }
