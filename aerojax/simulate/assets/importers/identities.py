"""Users' own models as identities of the catalogue."""

from __future__ import annotations

from pathlib import Path

from aerojax.core.errors import UserError
from aerojax.core.seeds import seed_of
from aerojax.core.types import CLASSES
from aerojax.simulate.assets.catalogue import Identity, families_of
from aerojax.simulate.assets.importers.models import read_models

FAMILY = "imported"


def imported_identities(path: Path) -> tuple[Identity, ...]:
    """The models that a YAML file lists, in its order; `build_identity` converts them when they are first needed.

    ```yaml
    models:
      - name: my_cessna     # unique; letters, digits and underscores
        file: cessna.glb    # .glb .gltf .obj .stl .ply .usd .usda .usdc .usdz, relative to the list
        class: airplane
        split: test         # default: test
        forward: +X         # the file's own axes; default +Z and +Y for glTF, up as the stage says for USD
        up: +Y
        scale: auto         # default; or metres per unit
        animation: 0        # index or name of a clip, none for a still model; default: first, the first one with
                            # all others that move other nodes (one clip a rotor)
        speed: 1.0          # factor of playback
        licence: GPL-2.0    # goes into the truth of captures
        source: https://…
    ```

    Raises:
        UserError: if the list does not fit, or a name is one of a procedural identity.
    """
    models = read_models(path)
    ours = {f"{label}_{family}" for label in CLASSES for family in families_of(label)}
    taken = [m.name for m in models if m.name.rpartition("_")[0] in ours and m.name.rpartition("_")[2].isdigit()]
    if taken:
        raise UserError(
            "mismatch", f"{path}: name {', '.join(taken)} belongs to the procedural catalogue", "choose another"
        )
    return tuple(Identity(m.name, m.label, FAMILY, seed_of(FAMILY, m.name), m.split, m) for m in models)
