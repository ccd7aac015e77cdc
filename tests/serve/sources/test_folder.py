"""A folder that grows: files are taken in order when they are complete, with gaps, stamps, offsets and restarts."""

from __future__ import annotations

import json
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from support.live_sites import FPS, write_frame, write_frames, write_site
from support.networks import frame_sets, network

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_frames
from aerojax.core.errors import UserError
from aerojax.serve.intake import Intake, IntakeConfig
from aerojax.serve.notices import SourceFailed
from aerojax.serve.pictures import Picture, read_pictures
from aerojax.serve.retries import RetryConfig
from aerojax.serve.sources.folder import FolderConfig

QUICK = FolderConfig(poll_s=0.002, settle_s=0.02)


class Followed:
    """A folder's source at work, and what it has given: (camera, number)."""

    def __init__(self, folder, config=QUICK, since=None, **intake):
        self.source = config.build(folder)
        settings = IntakeConfig(**{"wait_s": 5.0, "silent_s": 60.0, **intake})
        self.intake = Intake(len(self.source.site.cameras), self.source.site.fps, settings)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.source.run, args=(self.intake, since or {}, self._stop))

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *error):
        self._stop.set()
        self._thread.join()

    def frames(self, count: int) -> list[tuple[Picture | None, ...]]:
        """The next frames' pictures."""
        found, end = [], time.monotonic() + 10
        while len(found) < count and time.monotonic() < end:
            taken = self.intake.take(0.01)
            found += [] if taken is None else [taken.pictures]
        return found

    def numbers(self, count: int) -> list[list[int | None]]:
        return [[None if one is None else one.number for one in frame] for frame in self.frames(count)]


@pytest.fixture
def cameras():
    return network(3)


def test_what_grows_is_read_as_the_finished_capture_is(tmp_path, cameras):
    cameras = (cameras[0], replace(cameras[1], time_offset_s=1.4 / FPS), replace(cameras[2], time_offset_s=-2.5 / FPS))
    folder = write_site(tmp_path / "site", cameras)
    write_frames(folder, cameras, range(4))
    with Followed(folder) as followed:
        found = followed.frames(1)
        write_frames(folder, cameras, range(4, 8))
        found += followed.frames(4)
    write_site(tmp_path / "site", cameras, frames=8)
    capture = read_capture(folder)
    for frame, pictures in enumerate(found):
        offline = read_frames(capture, frame)
        live = read_pictures(pictures, frame, pictures[0].time_s)
        assert live.time_s == pytest.approx(offline.time_s, abs=1e-12) and live.missing == ()
        for ours, theirs in zip((*live.rgb, *live.ids), (*offline.rgb, *offline.ids), strict=True):
            if theirs is not None:
                np.testing.assert_array_equal(ours, theirs)
    assert len(found) == 5


def test_half_a_file_is_not_taken(tmp_path, cameras):
    folder = write_site(tmp_path / "site", cameras)
    write_frames(folder, cameras, range(1))
    path = folder / "cam_02/000000.png"
    whole = path.read_bytes()
    path.write_bytes(whole[:100])
    with Followed(folder, replace(QUICK, settle_s=30.0)) as followed:
        assert followed.intake.take(0.1) is None
        path.write_bytes(whole)
        (pictures,) = followed.frames(1)
        assert read_pictures(pictures, 0, 0.0).missing == ()


def test_a_damaged_file_leaves_its_camera_out_and_is_named(tmp_path, cameras):
    folder = write_site(tmp_path / "site", cameras)
    write_frames(folder, cameras, range(1))
    path = folder / "cam_02/000000.png"
    path.write_bytes(path.read_bytes()[:100])
    with Followed(folder) as followed:
        (pictures,) = followed.frames(1)
    found = read_pictures(pictures, 0, 0.0)
    assert found.rgb[1] is None and found.rgb[0] is not None
    (missing,) = found.missing
    assert missing.camera == 1 and "cam_02/000000.png" in missing.text and "damaged" in missing.text


def test_numbers_that_are_left_out_are_passed_over(tmp_path, cameras):
    folder = write_site(tmp_path / "site", cameras)
    for one in frame_sets(cameras, range(5)):
        write_frame(folder, cameras, one)
    (folder / "cam_01/000002.png").unlink()
    for camera in cameras:
        (folder / camera.rgb.replace("{frame:06d}", "000003")).unlink()
    with Followed(folder) as followed:
        found = followed.numbers(4)
    assert found == [[0, 0, 0], [1, 1, 1], [None, 2, 2], [4, 4, 4]]


def test_a_restart_goes_on_behind_what_was_taken_and_backlog_may_be_left(tmp_path, cameras):
    folder = write_site(tmp_path / "site", cameras)
    write_frames(folder, cameras, range(6))
    with Followed(folder, since={0: 3, 1: 3, 2: 3}) as followed:
        assert followed.numbers(2) == [[4, 4, 4], [5, 5, 5]]
    with Followed(folder, replace(QUICK, backlog=False)) as followed:
        assert followed.intake.take(0.05) is None
        write_frames(folder, cameras, range(6, 7))
        assert followed.numbers(1) == [[6, 6, 6]]


def test_a_backlog_waits_for_room_and_what_comes_later_does_not(tmp_path, cameras):
    folder = write_site(tmp_path / "site", cameras)
    write_frames(folder, cameras, range(8))
    with Followed(folder, buffer=2) as followed:
        assert followed.numbers(8) == [[n, n, n] for n in range(8)] and followed.intake.dropped == 0
        write_frames(folder, cameras, range(8, 14))
        end = time.monotonic() + 10
        while followed.intake.dropped < 4 and time.monotonic() < end:
            time.sleep(0.01)
        assert followed.numbers(2) == [[12, 12, 12], [13, 13, 13]]
    with Followed(folder, replace(QUICK, drop="never", backlog=False), buffer=2) as followed:
        write_frames(folder, cameras, range(14, 20))
        assert followed.numbers(6) == [[n, n, n] for n in range(14, 20)]


def test_names_may_be_time_stamps_that_differ_from_camera_to_camera(tmp_path, cameras):
    cameras = tuple(replace(camera, rgb=f"{camera.name}/{{frame}}.png", mask=None) for camera in cameras)
    cameras = (*cameras[:2], replace(cameras[2], time_offset_s=1.0))
    folder = write_site(tmp_path / "site", cameras)
    for index, one in enumerate(frame_sets(network(3), range(3), masks=False)):
        for camera, shift in zip(cameras, (0, 7, -1004), strict=True):
            path = folder / f"{camera.name}/{1_777_000_000_000 + 33 * index + shift}.png"
            write_frame(
                folder,
                (replace(camera, rgb=str(path.relative_to(folder))),),
                replace(one, rgb=one.rgb[:1], ids=(None,)),
            )
    with Followed(folder, replace(QUICK, stamps_per_s=1000.0)) as followed:
        found = followed.frames(3)
        assert not followed.source.numbered
    assert all(one is not None for frame in found for one in frame)
    moments = [[one.time_s - 1_777_000_000 for one in frame] for frame in found]
    np.testing.assert_allclose(moments[1], [0.033, 0.040, 0.029], atol=1e-6)
    assert read_pictures(found[1], 1, 0.0).missing == ()


def test_a_disk_that_cannot_be_read_is_tried_again(tmp_path, cameras, monkeypatch):
    folder = write_site(tmp_path / "site", cameras)
    write_frames(folder, cameras, range(1))
    fails = [True, True]
    from aerojax.serve.sources import folder as module

    real = module._Files.ready

    def ready(files):
        if fails:
            fails.pop()
            raise OSError(5, "Input/output error")
        return real(files)

    monkeypatch.setattr(module._Files, "ready", ready)
    with Followed(folder, replace(QUICK, retry=RetryConfig(0.01, 0.02))) as followed:
        assert followed.numbers(1) == [[0, 0, 0]]
        notices = followed.intake.notices()
    assert [(one.camera, one.retry_s) for one in notices if isinstance(one, SourceFailed)] == [
        (None, 0.01),
        (None, 0.02),
    ]
    assert "Input/output error" in notices[0].text


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"rgb": None}, "must be a file pattern"),
        ({"rgb": "{frame}/a.png"}, "in the file's own name"),
        ({"K": 3}, r"cameras\[0\]\.K"),
        ({"rgb": "../{frame}.png"}, "leaves the capture's folder"),
    ],
)
def test_cameras_that_cannot_be_watched_are_named(tmp_path, cameras, change, named):
    folder = write_site(tmp_path / "site", cameras)
    raw = json.loads((folder / "capture.json").read_text())
    raw["cameras"][0] |= change
    (folder / "capture.json").write_text(json.dumps(raw))
    with pytest.raises(UserError, match=named):
        QUICK.build(folder)


def test_a_camera_without_files_is_named(tmp_path, cameras):
    folder = write_site(tmp_path / "site", cameras)
    raw = json.loads((folder / "capture.json").read_text())
    del raw["cameras"][0]["rgb"]
    (folder / "capture.json").write_text(json.dumps(raw))
    with pytest.raises(UserError, match="camera cam_01 has no file a frame"):
        QUICK.build(folder)
