"""`python -m experiments.import_clips` on small trees of both layouts; every problem is named at once."""

from __future__ import annotations

import json

import jax.numpy as jnp
import numpy as np
import pytest
from support.command_line import run_command
from support.torch_files import write_archive

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES, SH_C0, Gaussians
from aerojax.data.clips import load_clips
from aerojax.data.imports.released_frames import columns_from_published
from aerojax.data.imports.released_layout import asset_of, find_sequences
from aerojax.gaussians.io.ply import write_ply
from experiments import import_clips

OWL = "blank_1.4r_20el_4cams_pinhole_5.0x_20_Owl_merged"


def _published(seed, tokens=6):
    columns = np.random.default_rng(seed).uniform(-0.5, 0.5, (2, tokens, 14)).astype(np.float32)
    columns[..., 7:10] = np.abs(columns[..., 7:10])
    return columns


def _frame(root, entry, columns, label):
    (root / entry).parent.mkdir(parents=True, exist_ok=True)
    content = {"versions": columns, "label": CLASSES.index(label), "class_name": label, "sample_name": entry}
    write_archive(root / entry, content)


def _gaussians(seed, count):
    rng = np.random.default_rng(seed)
    parts = (rng.normal(size=(count, 3)), rng.normal(size=(count, 4)), rng.uniform(0.1, 1, (count, 3)))
    rest = (rng.uniform(0.1, 0.9, count), rng.normal(size=(count, 1, 3)))
    return Gaussians(*(jnp.asarray(part, jnp.float32) for part in (*parts, *rest)))


def _preprocessed(root):
    entries = [f"train/0/{OWL}_frame_{i:04d}_s1.pt" for i in (10, 2)]
    for seed, entry in enumerate(entries):
        _frame(root, entry, _published(seed), "bird")
    _frame(root, "test/1/quad_frame_0000.pt", _published(5), "drone")
    (root / "train.json").write_text(json.dumps(entries))
    (root / "test.json").write_text(json.dumps(["test/1/quad_frame_0000.pt"]))
    (root / "category.txt").write_text("0,bird\n1,drone\n")


def _run(monkeypatch, tmp_path, *arguments):
    run_command(import_clips, monkeypatch, *arguments, f"out={tmp_path}/out", f"hydra.run.dir={tmp_path}/run")


def test_numbers_of_the_conventions_by_hand():
    column = np.zeros((1, 14), np.float32)
    column[0, 10:] = (0.5, 1 / 3**0.5, 0, -0.2)
    found = columns_from_published(column)
    np.testing.assert_allclose(found[0, 10:], [0.75, 0.5 / SH_C0, 0, -0.2 * 3**0.5 / 2 / SH_C0], rtol=1e-6)


def test_a_preprocessed_folder_becomes_clips(tmp_path, monkeypatch):
    _preprocessed(tmp_path / "in")
    _run(monkeypatch, tmp_path, f"source={tmp_path}/in", "tokens=4", "version=1")
    clips = load_clips(tmp_path / "out/train", frames=3)
    assert clips.identity == ("20_Owl_merged",) and clips.label[0] == 0
    np.testing.assert_array_equal(clips.present, [[True, True, False]])
    for time, seed in enumerate((1, 0)):  # by number: 0002 before 0010
        np.testing.assert_allclose(clips.columns[0, time], columns_from_published(_published(seed))[1, :4])
    assert load_clips(tmp_path / "out/test", frames=1).label[0] == 1
    assert json.loads((tmp_path / "run/metrics.json").read_text())["clips"] == {"train": 1, "test": 1}


def test_folders_of_plys_are_decimated_and_resumed(tmp_path, monkeypatch):
    for split, label, seed in (("train", "bird", 0), ("test", "airplane", 1)):
        folder = tmp_path / "in" / split / label / f"{label}_seq"
        folder.mkdir(parents=True)
        for frame, count in enumerate((40, 33)):
            write_ply(folder / f"frame_{frame:04d}.ply", _gaussians(seed + frame, count))
    small = ("tokens=16", "decimation.farthest=24", "decimation.keep=16", "decimation.draw=32")
    _run(monkeypatch, tmp_path, f"source={tmp_path}/in", *small)
    clips = load_clips(tmp_path / "out/train", frames=2)
    assert clips.identity == ("bird_seq",) and clips.columns.shape == (1, 2, 16, 14)
    source = _gaussians(0, 40)
    distance = np.abs(clips.columns[0, 0][:, None, :3] - np.asarray(source.mean)[None]).max(axis=-1)
    assert np.all(distance.min(axis=1) < 1e-5) and len(set(distance.argmin(axis=1))) > 8
    np.testing.assert_allclose(clips.columns[0, 0, :, 10], source.opacity[distance.argmin(axis=1)], atol=1e-5)
    stored = (tmp_path / "out/train/bird_bird_seq_s0.npz").read_bytes()
    (tmp_path / "out/test/airplane_airplane_seq_s0.npz").unlink()
    _run(monkeypatch, tmp_path, f"source={tmp_path}/in", *small)
    assert (tmp_path / "out/train/bird_bird_seq_s0.npz").read_bytes() == stored
    assert (tmp_path / "out/test/airplane_airplane_seq_s0.npz").is_file()
    with pytest.raises(SystemExit):
        _run(monkeypatch, tmp_path, f"source={tmp_path}/in", "tokens=8")


def test_raw_frames_and_a_given_class(tmp_path, monkeypatch):
    g = _gaussians(3, 20)
    raw = {"position": g.mean, "quaternion": g.quaternion, "scale": g.scale}
    raw |= {"opacity": g.opacity[:, None], "sh_dc": g.sh[:, 0]}
    (tmp_path / "in").mkdir()
    write_archive(tmp_path / "in/eagle_frame_0001.pt", {name: np.asarray(part) for name, part in raw.items()})
    small = ("tokens=8", "decimation.farthest=20", "decimation.keep=8")
    _run(monkeypatch, tmp_path, f"source={tmp_path}/in", "label=bird", "split=test", *small)
    clips = load_clips(tmp_path / "out/test", frames=1)
    assert clips.identity == ("eagle",)
    columns = np.asarray(g.columns())
    assert all(np.abs(columns - token).max(axis=1).min() < 1e-6 for token in clips.columns[0, 0])


def test_assets_of_rendered_names():
    assert asset_of(OWL) == "20_Owl_merged"
    assert asset_of("x_lform_1956_L-1049G_Full_custom_1440p_pinhole_3.0x") == "1956_L-1049G_Full"
    assert asset_of("quad") == "quad"


def test_every_problem_of_a_list_is_named(tmp_path):
    _preprocessed(tmp_path)
    entries = [*json.loads((tmp_path / "train.json").read_text()), "train/9/a_frame_0000.pt", "../b_frame_0000.pt"]
    (tmp_path / "train.json").write_text(json.dumps([*entries, "train/0/gone_frame_0000.pt"]))
    (tmp_path / "val.json").write_text("{")
    (tmp_path / "category.txt").write_text("0,bird\n1,drone\n2,kite\n")
    _frame(tmp_path, f"test/0/{OWL}_frame_0000.pt", _published(0), "bird")
    (tmp_path / "test.json").write_text(json.dumps([f"test/0/{OWL}_frame_0000.pt"] * 2))
    with pytest.raises(UserError) as error:
        find_sequences(tmp_path)
    for part in (
        *("2,kite", "'train/9/a_frame_0000.pt' has another split", "'../b_frame_0000.pt' is not split/class"),
        *("gone_frame_0000.pt' does not exist", "val.json is not a JSON list", "frame 0 is there twice"),
        "bird 20_Owl_merged is in test and train",
    ):
        assert part in str(error.value)


@pytest.mark.parametrize(
    "names",
    [
        ("7", "10", "100"),
        ("0007", "0010", "0100"),
        ("kite-7", "kite-10", "kite-100"),
        ("frame7", "frame10", "frame100"),
    ],
)
def test_any_numbering_is_an_order_of_time(tmp_path, names):
    folder = tmp_path / "test/bird/eagle"
    folder.mkdir(parents=True)
    for name in names:
        (folder / f"{name}.ply").touch()
    (sequence,) = find_sequences(tmp_path)
    assert [path.stem for path in sequence.files] == list(names)
    assert sequence.label == "bird" and sequence.identity == ("kite" if "kite" in names[0] else "eagle")


def test_every_problem_of_a_folder_is_named(tmp_path):
    for name in ("bird/picture.ply", "a/x_frame_0001.ply"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).touch()
    with pytest.raises(UserError) as error:
        find_sequences(tmp_path)
    for part in (
        "picture.ply: the name ends in no number",
        "x_frame_0001.ply: no folder on its way is a class",
        "split",
    ):
        assert part in str(error.value)
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match="no frames"):
        find_sequences(tmp_path / "empty")
    with pytest.raises(UserError, match="is not a folder"):
        find_sequences(tmp_path / "none")


def test_unreadable_frames_are_all_named_and_the_rest_is_kept(tmp_path, monkeypatch, capsys):
    _preprocessed(tmp_path / "in")
    broken = _published(0)
    broken[0, 0, 0] = np.nan
    _frame(tmp_path / "in", f"train/0/{OWL}_frame_0010_s1.pt", broken, "bird")
    _frame(tmp_path / "in", f"train/0/{OWL}_frame_0002_s1.pt", _published(0), "drone")
    with pytest.raises(SystemExit) as ended:
        _run(monkeypatch, tmp_path, f"source={tmp_path}/in", "tokens=6")
    message = capsys.readouterr().err
    assert ended.value.code == 2
    assert "_0010_s1.pt: numbers are not finite" in message and "says class 'drone'" in message
    assert (tmp_path / "out/test/drone_quad_s0.npz").is_file() and not (tmp_path / "out/train").exists()
