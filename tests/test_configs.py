"""Every act's configuration composes and fits its dataclass in every preset, repeats no default, names mistakes."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from hydra.errors import HydraException
from support.act_configs import NAMES, PRESETS, config_of, values_of
from support.toy_door import BallConfig, ShapeConfig

from aerojax.core.config import default_of, door_of, members_of, to_dataclass
from aerojax.core.errors import UserError
from experiments._launch.composition import CONF_DIR, defaults_of, doors_of

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize(("name", "preset"), [(name, preset) for name in NAMES for preset in PRESETS[name]])
def test_config_fits(name, preset):
    config = to_dataclass(values_of(name, f"preset={preset}"), config_of(name))
    assert config.preset == preset


@pytest.mark.parametrize("preset", ["smoke", "small", "full"])
def test_clips_hold_the_tokens_that_training_takes(preset):
    """`train_classifier preset=full` once asked for twice as many as its clips had."""
    kept = values_of("reconstruct_dataset" if preset == "smoke" else "generate_clips", f"preset={preset}")
    taken = values_of("train_classifier", f"preset={preset}")
    assert taken["variation"]["tokens"] <= kept["tokens"]
    assert all(folder.startswith(kept["folder"]) for folder in taken["clips"])


def test_what_an_act_takes_in_a_preset_is_made_in_it():
    """The chain of `make demo`: nothing but the preset, the rig and the weights is said."""
    made = values_of("generate_dataset", "preset=smoke", "rig=random")
    clips = values_of("reconstruct_dataset", "preset=smoke")
    assert clips["datasets"] == [made["folder"]] and made["sequences"] == {"train": 1, "val": 1, "test": 1}
    folders = [f"{clips['folder']}/{made['rig']['name']}"]
    assert values_of("train_classifier", "preset=smoke")["clips"] == folders
    assert values_of("measure_accuracy", "preset=smoke")["tests"] == folders
    for act in ("eval_rotation", "measure_drift"):
        assert values_of(act, "preset=smoke")["clips"] == folders


def test_no_group_has_the_name_of_a_field():
    """Hydra takes `rows=…` for a group of that name, whatever act it belongs to, and the field cannot be set."""
    groups = {path.name for path in CONF_DIR.iterdir() if path.is_dir()}
    for name in NAMES:
        used = {path.parent.name for path in files_of(name)}
        fields = {field.name for field in dataclasses.fields(config_of(name))}
        assert fields & groups <= used | {"preset"}, f"{name}: {sorted(fields & groups)}"


def test_sweeps_of_trainings_and_measurements_skip_finished_runs():
    """`measure_kills` alone writes what it knows after each kill."""
    wanted = [name for name in NAMES if name.startswith(("train_", "eval_", "compare_", "measure_"))]
    sources = {name: (ROOT / "experiments" / f"{name}.py").read_text() for name in wanted}
    assert [name for name in wanted if "finished_by=" not in sources[name]] == ["measure_kills"]


def test_every_experiment_has_a_config():
    acts = {p.stem for p in (ROOT / "experiments").glob("*.py") if "\n@experiment(" in p.read_text()}
    assert acts == set(NAMES)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"sead": 1}, "sead"),
        ({"seed": "one"}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"seed": True}, "seed"),
        ({"pipeline": {"reconstruct": {"name": "hull", "grid": "big"}}}, "pipeline.reconstruct.grid"),
        ({"pipeline": {"reconstruct": {"name": "hall"}}}, "pipeline.reconstruct: name is 'hall'"),
        ({"pipeline": {"crop_sise": 128}}, "crop_sise"),
    ],
)
def test_mistakes_are_named(change, named):
    with pytest.raises(UserError, match=named):
        to_dataclass({**values_of("classify"), **change}, config_of("classify"))


def test_missing_key_is_named():
    values = values_of("classify_folder")
    del values["captures"]
    with pytest.raises(UserError, match="captures"):
        to_dataclass(values, config_of("classify_folder"))


def test_all_mistakes_at_once():
    with pytest.raises(UserError) as caught:
        to_dataclass({**values_of("classify"), "seed": "x", "colour": 3}, config_of("classify"))
    assert "seed" in str(caught.value) and "colour" in str(caught.value)


def test_paths_do_not_depend_on_the_working_directory():
    assert CONF_DIR.is_absolute()


@pytest.mark.parametrize("name", NAMES)
def test_every_field_is_in_the_composed_config(name):
    """So each can be changed on the command line, which refuses keys that are not there."""

    def keys(values: dict[str, Any], prefix: str = "") -> Iterator[str]:
        for key, value in values.items():
            yield prefix + key
            yield from keys(value, f"{prefix}{key}.") if isinstance(value, dict) else ()

    found = set(keys(values_of(name)))
    assert set(keys(defaults_of(config_of(name)))) <= found
    assert {path for path, *_ in doors_of(config_of(name))} <= found


def test_an_override_of_any_depth_arrives():
    values = values_of("classify", "pipeline.reconstruct.grid=17", "pipeline.segment.motion.threshold=0.5", "seed=4")
    config = to_dataclass(values, config_of("classify"))
    assert (config.pipeline.reconstruct.grid, config.pipeline.segment.motion.threshold, config.seed) == (17, 0.5, 4)
    with pytest.raises(HydraException, match="grad"):
        values_of("classify", "pipeline.reconstruct.grad=17")


def test_a_group_chooses_a_member_with_its_own_defaults():
    assert set(values_of("classify")["pipeline"]["segment"]) == {"name", "motion"}
    assert values_of("classify", "segment=given")["pipeline"]["segment"] == {"name": "given"}
    with pytest.raises(HydraException, match="auto"):
        values_of("classify", "segment=guessed")


@dataclasses.dataclass(frozen=True)
class Toy:
    """Fields with and without defaults, a door whose default has a value that its class has not."""

    size: int
    ball: BallConfig
    shape: ShapeConfig = dataclasses.field(default_factory=lambda: BallConfig(radius=2.0))


def test_defaults_of_a_class():
    assert defaults_of(Toy) == {"size": "???", "ball": {"name": "ball", "radius": 1.0}}
    with pytest.raises(ValueError, match="shape must be a member with its own defaults"):
        list(doors_of(Toy))


# A number has one home


def leaves(values: Any, kind: Any, default: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Path, value and default of every value that YAML sets; items of a list have their class's defaults."""
    kinds = [option for option in (kind, *typing.get_args(kind)) if dataclasses.is_dataclass(option)]
    if isinstance(values, dict) and kinds:
        door = door_of(kind)
        usual = getattr(default, "name", None)
        kind = members_of(door)[values.get("name", usual)] if door else kinds[0]
        if door and "name" in values:
            yield f"{path}.name".lstrip("."), values["name"], usual
            values = {key: value for key, value in values.items() if key != "name"}
        default = default if isinstance(default, kind) else None
        hints = typing.get_type_hints(kind)
        for field in dataclasses.fields(kind):
            if field.name in values:
                known = default_of(field) if default is None else getattr(default, field.name)
                yield from leaves(values[field.name], hints[field.name], known, f"{path}.{field.name}")
    elif isinstance(values, dict) and isinstance(default, dict):
        for key, value in values.items():
            yield f"{path}.{key}".lstrip("."), value, default.get(key, dataclasses.MISSING)
    elif isinstance(values, list) and kinds:
        if (items := tuple(to_dataclass(item, kinds[0]) for item in values)) == default:
            yield path.lstrip("."), items, items
        for number, item in enumerate(values):
            yield from leaves(item, kinds[0], None, f"{path}[{number}]")
    else:
        yield path.lstrip("."), values, default


def same(value: Any, default: Any) -> bool:
    """Whether a value of a YAML file is a dataclass's default."""
    if value is default or default is dataclasses.MISSING:
        return value is default
    if isinstance(default, tuple | list):
        return isinstance(value, list) and len(value) == len(default) and all(map(same, value, default))
    return value == (str(default) if isinstance(default, Path) else default)


def files_of(name: str) -> set[Path]:
    """YAML files that may be part of an act's configuration."""
    found = {CONF_DIR / f"{name}.yaml"}
    for entry in yaml.safe_load((CONF_DIR / f"{name}.yaml").read_text())["defaults"]:
        if isinstance(entry, dict):
            (group,) = entry
            found |= set((CONF_DIR / group.partition("@")[0]).glob("*.yaml"))
        elif (CONF_DIR / f"{entry}.yaml").is_file() and entry != "base":
            found |= files_of(entry)
    return found


def settings_of(path: Path, config_type: type, text: str | None = None) -> list[tuple[str, Any, Any]]:
    return list(leaves(yaml.safe_load(path.read_text() if text is None else text) or {}, config_type, None))


def repeated(name: str) -> set[tuple[Path, str]]:
    """Values of an act's files that are its dataclass's defaults already, unless they undo what another file sets."""
    rows = [(path, *row) for path in files_of(name) for row in settings_of(path, config_of(name))]
    changed = {(path.parent, key) for path, key, value, default in rows if not same(value, default)}
    undoes = {(path, key) for path, key, *_ in rows if any(path.parent != where and key == k for where, k in changed)}
    return {(path, key) for path, key, value, default in rows if same(value, default)} - undoes


def test_yaml_repeats_no_default():
    """A file that several acts share may say what is the default of some of them."""
    found = {name: repeated(name) for name in NAMES}
    users = {path: [name for name in NAMES if path in files_of(name)] for name in NAMES for path in files_of(name)}
    twice = {
        f"{path.relative_to(CONF_DIR)}: {key}"
        for name in NAMES
        for path, key in found[name]
        if all((path, key) in found[user] for user in users[path])
    }
    assert not twice, "defaults repeated:\n" + "\n".join(sorted(twice))


def test_every_file_belongs_to_an_act():
    known = {path for name in NAMES for path in files_of(name)}
    assert known == set(CONF_DIR.rglob("*.yaml")) - {CONF_DIR / "base.yaml"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("seed: 0", ["seed"]),
        ("seed: 1", []),
        ("assets: data/assets", ["assets"]),
        ("capture: null", ["capture"]),
        ("pipeline: {crop_size: 128, reconstruct: {name: hull}}", ["pipeline.crop_size", "pipeline.reconstruct.name"]),
        ("pipeline: {segment: {name: given}}", []),
        ("sample: {sequence: {rigs: [{kind: sphere, cameras: 9}]}}", ["sample.sequence.rigs[0].kind"]),
        ("sample: {sequence: {rigs: [{span_px: [90, 90], distance: [12, 12]}]}}", ["sample.sequence.rigs"]),
    ],
)
def test_a_repeated_default_is_found(text, expected):
    rows = settings_of(Path(), config_of("classify"), text)
    assert sorted(key for key, value, default in rows if same(value, default)) == expected


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("pipeline.crop_size=-3", "crop_size is -3 in PipelineConfig; it must be at least 16"),
        ("pipeline.reconstruct.grid=0", "grid is 0 in HullConfig; it must be at least 2"),
        ("pipeline.decimation.keep=0", "keep is 0 in DecimationConfig; it must be at least 1"),
        ("sample.sequence.fps=0", "fps is 0.0 in SequenceConfig; it must be at least 0.01"),
    ],
)
def test_bad_numbers_end_in_one_line(override, told):
    with pytest.raises(UserError) as caught:
        to_dataclass(values_of("classify", override), config_of("classify"))
    assert told in str(caught.value) and "\n" not in str(caught.value)
