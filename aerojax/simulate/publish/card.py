"""What people and tools read about a data set: its card (README.md), Croissant metadata and the licence."""

from __future__ import annotations

from collections import Counter

from aerojax.core.types import CLASSES
from aerojax.data.manifest import Manifest, SequenceEntry
from aerojax.data.splits import SPLITS

NAME = "AeroSplat-4D"
LICENCE_ADDRESS = "https://creativecommons.org/licenses/by/4.0/"
ABOUT = (
    "Synchronised multi-camera video of flying objects (birds, drones, airplanes, helicopters) with "
    "calibration, instance masks, depth and 6-DoF truth, rendered from procedural animated 3D models."
)
LICENCE_TEXT = f"""The images, annotations and metadata in this folder were generated with aerojax and are offered under
the Creative Commons Attribution 4.0 International licence (CC BY 4.0): {LICENCE_ADDRESS}

You may share and adapt them for any purpose if you name the source ("{NAME}, generated with aerojax") and say whether
you changed anything. The models in assets/ that are not the generator's own keep the licences that dataset.json lists
under `identities`; sequences that show such models are subject to them too.
"""

_LAYOUT = """```
dataset.json            manifest: rigs with their configurations, identities with splits, all sequences
assets/                 the objects: animated USD stages and their textures
rigs/                   configuration of each camera network, versions and commit of the generator
train|val|test/<sequence>/
  capture.json          cameras: K (pixels), world_from_cam (metres, OpenCV axes), file patterns
  truth.json            by frame: position, orientation, joints; by camera: boxes, visibility, truncation
  scene.usda            the sequence as a USD stage (with scenery.usdc outdoors)
  sequence.json         the sequence's entry in dataset.json
  cam_NN/rgb|mask|coverage|normal/*.png, cam_NN/depth|flow/*.tiff
```"""

_FIELDS = """| file | content |
|---|---|
| `rgb` | 8-bit sRGB |
| `mask` | 16-bit instance ids, 0 = background; a pixel belongs to an object that covers a quarter of it or more |
| `coverage` | 8 bits, share of the pixel that objects cover, 255 = all |
| `depth` | float32 TIFF, metres along the optical axis (not along the ray), 0 = no object |
| `normal` | 16-bit RGB, world normals as (n + 1)/2·65535, 0 0 0 = none |
| `flow` | two-channel float32 TIFF, pixels to the next frame's place, right and down |

World: right-handed, metres, +Z up. Camera: +x right, +y down, +z forward; the centre of the top-left pixel is at
(0.5, 0.5). Body: nose +X, up +Z, size normalised to 1 m, so that size is no cue. Quaternions are w, x, y, z.
`bbox` is the tight box of the mask, `visible_box` that of what is visible, to a fraction of a pixel, `projected_box`
that of the projected mesh, which reaches beyond the image where the object does; `visibility` is the visible share of
what would show if the object were alone. `oriented_box` and `aligned_box` are the smallest boxes in space along the
body's and the world's axes (metres, world), `projected_corners` the eight corners of the first in each image; where an
object has `gaussians`, each frame's file holds Gaussians on its surface (world frame, unlit colours, normals in nx ny
nz). Frames in which fewer cameras than asked for see the object are listed in `frames_below_min_cameras`."""


def readme_text(manifest: Manifest) -> str:
    """The data set's card in Markdown with the YAML header that Hugging Face reads."""
    images = sum(s.frames * s.cameras for s in manifest.sequences)
    header = "\n".join(
        [
            "---",
            "license: cc-by-4.0",
            f"pretty_name: {NAME}",
            "task_categories:",
            *[f"- {task}" for task in ("object-detection", "video-classification", "depth-estimation")],
            "tags:",
            *[f"- {tag}" for tag in ("multi-view", "synthetic", "uav", "drone", "bird", "3d", "6-dof", "usd")],
            "size_categories:",
            f"- {size_category(images)}",
            "---",
        ]
    )
    parts = [
        f"# {NAME}",
        ABOUT,
        f"{len(manifest.identities)} identities, {len(manifest.sequences)} sequences, {images} images, "
        f"seed {manifest.seed}. Identities and their families belong to one split only.",
        _table(manifest),
        "## Files",
        _LAYOUT,
        _FIELDS,
        "## How it was made",
        _origin(manifest),
        "## Licence",
        f"Data: CC BY 4.0 ({LICENCE_ADDRESS}). Objects by licence: {_licences(manifest)}.",
        "## Limits",
        "Rendered, not filmed: lenses are ideal pinholes unless stated, and every object is one metre large. Models "
        "trained on it should be tested on real video before anyone relies on them.",
    ]
    return header + "\n\n" + "\n\n".join(parts) + "\n"


def size_category(images: int) -> str:
    """The size class of a data set as Hugging Face words it."""
    for limit, words in ((10**3, "n<1K"), (10**4, "1K<n<10K"), (10**5, "10K<n<100K"), (10**6, "100K<n<1M")):
        if images < limit:
            return words
    return "1M<n<10M"


def _table(manifest: Manifest) -> str:
    lines = ["| rig | split | " + " | ".join(CLASSES) + " | sequences | frames |", "|---" * (len(CLASSES) + 4) + "|"]
    groups: dict[tuple[str, str], list[SequenceEntry]] = {}
    for sequence in manifest.sequences:
        groups.setdefault((sequence.rig, sequence.split), []).append(sequence)
    for rig, split in sorted(groups, key=lambda pair: (pair[0], SPLITS.index(pair[1]))):
        members = groups[rig, split]
        identities = Counter(label for label, _ in {(s.label, s.identity) for s in members})
        counts = " | ".join(str(identities[label]) for label in CLASSES)
        lines.append(f"| {rig} | {split} | {counts} | {len(members)} | {sum(s.frames for s in members)} |")
    return "\n".join(lines) + "\n\nColumns of classes count identities; frames are moments, each seen by all cameras."


def _origin(manifest: Manifest) -> str:
    lines = [
        f"- {name}: commit {rig.commit or 'unknown'}, "
        + ", ".join(f"{package} {version}" for package, version in sorted(rig.versions.items()))
        for name, rig in manifest.rigs.items()
    ]
    how = "`python -m experiments.generate_dataset rig=<rig>` with the configuration in `rigs/<rig>.json`:"
    return how + "\n\n" + "\n".join(lines)


def _licences(manifest: Manifest) -> str:
    counts = Counter(identity.licence for identity in manifest.identities)
    return ", ".join(f"{licence} ({number})" for licence, number in sorted(counts.items()))
