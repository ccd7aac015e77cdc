"""Clips on disk and in memory, and windows of them."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.data.clips import VIEWS, clip_files, crop_bytes, load_clip, load_clips, save_clip
from aerojax.data.windows import read_windows, window_starts


def test_clips_are_read_in_order_padded_and_cut(tmp_path):
    save_clip(tmp_path / "b.npz", np.ones((3, 4, 14)), "drone", "drone_x")
    save_clip(tmp_path / "a.npz", np.full((6, 4, 14), 2.0), "bird", "bird_y")
    clips = load_clips(tmp_path, frames=5)
    assert clips.columns.shape == (2, 5, 4, 14) and clips.columns.dtype == np.float32
    assert clips.label.tolist() == [0, 1] and clips.identity == ("bird_y", "drone_x")
    assert clips.present.tolist() == [[True] * 5, [True] * 3 + [False] * 2]
    assert not clips.columns[1, 3:].any()
    (tmp_path / ".c.x1y2.tmp.npz").write_bytes(b"what a killed writer leaves")
    assert load_clips(tmp_path, frames=5).identity == clips.identity
    assert [path.name for path in clip_files(tmp_path)] == ["a.npz", "b.npz"]


def test_clips_that_cannot_be_used_are_named(tmp_path):
    with pytest.raises(UserError, match=r"holds no clips .* experiments\.reconstruct_dataset"):
        load_clips(tmp_path, frames=4)
    save_clip(tmp_path / "odd.npz", np.ones((3, 4, 14)), "kite", "kite_0")
    with pytest.raises(UserError, match=r"odd\.npz is not a clip"):
        load_clips(tmp_path, frames=4)
    save_clip(tmp_path / "odd.npz", np.ones((3, 4, 11)), "bird", "bird_0")
    with pytest.raises(UserError, match=r"odd\.npz is not a clip"):
        load_clips(tmp_path, frames=4)


@pytest.mark.parametrize("content", [b"", b"not an archive", b"PK\x03\x04 cut"])
def test_broken_clip_files_are_named(tmp_path, content):
    (tmp_path / "cut.npz").write_bytes(content)
    with pytest.raises(UserError, match=r"cut\.npz"):
        load_clips(tmp_path, frames=4)


@pytest.mark.parametrize("shape", ["(2, 3", "(" * 300, "(2**60,)", "(1000000000000000,)", "(-2,)"])
def test_headers_of_arrays_that_make_no_sense_are_named(tmp_path, shape):
    content = io.BytesIO()
    np.save(content, np.zeros(6, np.float32))
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}".encode() + b"\n"
    with zipfile.ZipFile(tmp_path / "odd.npz", "w") as archive:
        archive.writestr("columns.npy", content.getvalue()[:8] + len(header).to_bytes(2, "little") + header + bytes(24))
    with pytest.raises(UserError, match=r"odd\.npz cannot be read as a clip"):
        load_clip(tmp_path / "odd.npz")


def test_compressed_clips_are_refused(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", columns=np.zeros((2, 3, 14), np.float32), label="bird", identity="b")
    with pytest.raises(UserError, match=r"a\.npz cannot be read as a clip \(an entry is compressed"):
        load_clip(tmp_path / "a.npz")


def test_clips_of_unequal_token_counts_are_named(tmp_path):
    save_clip(tmp_path / "a.npz", np.ones((3, 4, 14)), "bird", "bird_0")
    save_clip(tmp_path / "b.npz", np.ones((3, 5, 14)), "bird", "bird_0")
    with pytest.raises(UserError, match=r"b\.npz .*5 tokens.*4"):
        load_clips(tmp_path, frames=4)


def test_sets_are_joined_in_order(tmp_path):
    save_clip(tmp_path / "a/x.npz", np.ones((3, 4, 14)), "bird", "bird_0")
    save_clip(tmp_path / "b/x.npz", np.ones((3, 4, 14)), "drone", "drone_0")
    save_clip(tmp_path / "c/x.npz", np.ones((3, 5, 14)), "drone", "drone_0")
    joined = load_clips(tmp_path / "a", tmp_path / "b", frames=3)
    assert joined.label.tolist() == [0, 1] and joined.identity == ("bird_0", "drone_0")
    with pytest.raises(UserError, match=r"5 tokens a frame, others have 4"):
        load_clips(*(tmp_path / name for name in "abc"), frames=3)


def test_windows_of_clips(tmp_path):
    clip = np.arange(7)[:, None, None] * np.ones((7, 4, 14))
    save_clip(tmp_path / "sim1/test/a.npz", clip, "bird", "bird_0")
    save_clip(tmp_path / "sim1/test/b.npz", clip[:2], "drone", "drone_0")
    windows = read_windows([tmp_path / "sim1"], "test", frames=7, length=4, stride=2, tokens=3)
    assert windows.name == tuple(f"sim1/test/{name}" for name in ("a@0", "a@2", "a@3", "b@0"))
    assert windows.columns.shape == (4, 4, 3, 14) and windows.columns[1, :, 0, 0].tolist() == [2, 3, 4, 5]
    assert windows.present.tolist()[3] == [True, True, False, False]
    assert windows.video.tolist() == [0, 0, 0, 1] and windows.one_a_video().tolist() == [0, 3]
    assert windows.identity[-1] == "drone_0" and windows.label.tolist() == [0, 0, 0, 1]


def test_sizes_of_windows_are_checked():
    assert window_starts(3, 4, 2) == [0] and window_starts(10, 4, 4) == [0, 4, 6]
    with pytest.raises(UserError, match="stride is 0"):
        window_starts(10, 4, 0)


def test_crops_and_facts_are_kept(tmp_path):
    rgba = np.random.default_rng(0).random((3, 5, 4, 4, 4)).astype(np.float32)
    valid = np.array([[True, True, False, True, True]] * 3)
    facts = {"rig": "sim1", "width_px": 31.5, "cameras": 5}
    columns = np.ones((3, 2, 14))
    save_clip(tmp_path / "a.npz", columns, "bird", "b", crops=crop_bytes(rgba), crop_valid=valid, facts=facts)
    save_clip(tmp_path / "b.npz", columns, "drone", "d")
    clips = load_clips(tmp_path, frames=4)
    assert clips.crops.shape == (2, 4, VIEWS, 4, 4, 4) and clips.facts == (facts, {})
    np.testing.assert_allclose(clips.crops[0, :3, :5] / 255.0, rgba, atol=0.5 / 255 + 1e-6)
    np.testing.assert_array_equal(clips.crop_valid[0, :3, :5], valid)
    assert not clips.crop_valid[0, 3:].any() and not clips.crop_valid[0, :, 5:].any() and not clips.crop_valid[1].any()
    (one,) = (clips.take(np.array([1])),)
    assert one.identity == ("d",) and one.crops.shape[0] == 1 and one.facts == ({},)
    windows = read_windows([tmp_path.parent], tmp_path.name, frames=4, length=2, stride=1, tokens=2)
    assert windows.crops.shape == (4, 2, VIEWS, 4, 4, 4)
    np.testing.assert_array_equal(windows.crops[1], clips.crops[0, 1:3])


def test_sets_with_and_without_crops_are_joined(tmp_path):
    crops, valid = np.full((3, 2, 4, 4, 4), 7, np.uint8), np.ones((3, 2), bool)
    save_clip(tmp_path / "a/x.npz", np.ones((3, 4, 14)), "bird", "b", crops=crops, crop_valid=valid)
    save_clip(tmp_path / "b/x.npz", np.ones((3, 4, 14)), "bird", "c")
    joined = load_clips(tmp_path / "a", tmp_path / "b", frames=3)
    assert joined.crops.shape == (2, 3, VIEWS, 4, 4, 4) and joined.crop_valid[0, :, :2].all()
    assert not joined.crop_valid[1].any() and len(joined.facts) == 2
    save_clip(tmp_path / "a/y.npz", np.ones((3, 4, 14)), "bird", "b", crops=crops[..., :2, :2, :], crop_valid=valid)
    with pytest.raises(UserError, match=r"y\.npz has crops of 2 pixels, others have crops of 4"):
        load_clips(tmp_path / "a", frames=3)
    with pytest.raises(UserError, match=r"z\.npz is not a clip"):
        save_clip(tmp_path / "c/z.npz", np.ones((3, 4, 14)), "bird", "b", crops=crops, crop_valid=valid[:2])
        load_clips(tmp_path / "c", frames=3)
