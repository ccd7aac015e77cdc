"""What a data set consists of: Table 6.3 of the thesis, the presets, and refusals."""

from __future__ import annotations

from collections import Counter

import pytest
from support.dataset_configs import config_of

from aerojax.core.errors import UserError
from aerojax.simulate.plan.dataset import count, work_list
from aerojax.simulate.plan.sizes import estimated_bytes

IDENTITIES = {
    "bird": {"train": 15, "val": 6, "test": 8},
    "drone": {"train": 15, "val": 7, "test": 8},
    "helicopter": {"train": 8, "val": 4, "test": 4},
    "airplane": {"train": 8, "val": 4, "test": 4},
}
TABLE = {  # thesis Table 6.3: assets, sequences, frames
    "sim1": {"train": (46, 920, 27600), "val": (21, 420, 12600), "test": (24, 480, 14400)},
    "sim2": {"train": (46, 92, 8280), "val": (21, 42, 3780), "test": (24, 48, 4320)},
    "sim3": {"test": (24, 24, 2880)},
}


@pytest.mark.parametrize("rig", TABLE)
def test_full_presets_are_table_6_3(rig):
    config = config_of(f"rig={rig}", "preset=full")
    tasks = work_list(config)
    for split, (assets, sequences, frames) in TABLE[rig].items():
        mine = [task for task in tasks if task.identity.split == split]
        assert (len({t.identity.name for t in mine}), len(mine), len(mine) * config.frames) == (
            assets,
            sequences,
            frames,
        )
        each = sequences // assets * config.frames
        by_class = Counter(task.identity.label for task in mine)
        assert {c: n * config.frames for c, n in by_class.items()} == {
            c: n[split] * each for c, n in IDENTITIES.items()
        }
    assert {task.identity.split for task in tasks} == set(TABLE[rig])
    assert len({task.name for task in tasks}) == len(tasks)


@pytest.mark.parametrize("rig", ["sim1", "sim2", "sim3", "random"])
@pytest.mark.parametrize("preset", ["smoke", "small", "full"])
def test_every_preset_has_work_and_a_size(rig, preset):
    config = config_of(f"rig={rig}", f"preset={preset}")
    tasks = work_list(config)
    counts = count(config, tasks)
    assert counts.sequences == len(tasks) and counts.frames == len(tasks) * config.frames
    assert counts.images >= 3 * counts.frames and estimated_bytes(config, tasks) > 1000 * counts.images
    if preset == "small":
        # The test identities alone, and three individuals of each family before random networks.
        assert counts.identities == {"sim3": 24, "random": 3 * 91}.get(rig, 91) and config.frames >= 8


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (("frames=0",), "frames is 0; a sequence needs at least 1"),
        (("fps=0.0",), "fps is 0"),
        (("sequences.train=-1",), "sequences is negative"),
        (("+sequences.extra=1",), "sequences has .*extra.*use train, val, test"),
        (("sequences={train: 0, val: 0, test: 0}",), "the data set would be empty"),
        (("radii=[3]",), r"radii is \[3.0\]; choose among \[2.0, 4.0"),
        (("crowd.objects=0",), "crowd.objects is 0"),
        (("crowd.birds=-1",), "crowd.birds is -1"),
        (("faults.position_m=-0.1",), "faults has a negative size"),
        (("randomisation=2.0",), "randomisation is 2"),
        (("images.samples=0",), "images.samples is 0"),
        (("rig.fixed.cameras=2",), "at least 3"),
        (("classes=[ufo]",), "classes has .*ufo"),
    ],
)
def test_nonsense_is_refused(overrides, words):
    with pytest.raises(UserError, match=words):
        work_list(config_of("rig=sim1", "preset=small", *overrides))
