"""A capture that is still being written: images a camera and frame, whose names are frame numbers or time stamps."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

from aerojax.capture.format import Capture, read_network
from aerojax.capture.frames import frames_early, read_view
from aerojax.capture.paths import frame_numbers, frame_path, is_video
from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.segment.base import Preview
from aerojax.serve.intake import Intake
from aerojax.serve.notices import SourceFailed
from aerojax.serve.pictures import Picture
from aerojax.serve.retries import RetryConfig
from aerojax.serve.sources.base import SourceConfig

_ENDINGS = {
    ".png": b"IEND\xaeB`\x82",  # the last chunk and its checksum
    ".jpg": b"\xff\xd9",
    ".jpeg": b"\xff\xd9",
}
"""Last bytes of complete files."""
_GRAIN_NS = 50_000_000
"""Nanoseconds within which a folder may change twice and keep its stamp; file systems tick every 10 ms or so."""


@dataclass(frozen=True)
class FolderConfig(SourceConfig):
    """A folder that grows, as `capture.json` in it describes; how many frames there will be it need not say.

    poll_s: how often the disk is looked at.
    stamps_per_s: units a second of the numbers in file names where these are time stamps, such as 1000 for
        milliseconds; they are frame numbers if None.
    settle_s: after which a file that does not grow counts as complete though its end is not there, and a frame number
        or a mask that is missing counts as left out.
    backlog: whether what lies there at the start is taken, all of it; otherwise only what comes later.
    drop: whether frames that come faster than they are taken are dropped, the oldest first, or never: then they wait
        on the disk, however long.
    retry: waits after the disk could not be read.
    """

    name: Literal["folder"] = "folder"
    poll_s: float = 0.02
    stamps_per_s: float | None = None
    settle_s: float = 0.5
    backlog: bool = True
    drop: Literal["oldest", "never"] = "oldest"
    retry: RetryConfig = field(default_factory=RetryConfig)

    def __post_init__(self) -> None:
        require_at_least(self, "poll_s", least=1e-3)
        require_at_least(self, "settle_s", least=0)
        if self.stamps_per_s is not None:
            require_at_least(self, "stamps_per_s", least=1e-9)

    def build(self, folder: Path) -> GrowingFolder:
        """The member that watches this folder."""
        site = read_network(folder)
        for camera in site.cameras:
            if is_video(camera.rgb) or not camera.rgb:
                problem = f"{folder}/capture.json: camera {camera.name} has no file a frame (rgb is {camera.rgb!r})"
                raise UserError(
                    "mismatch", problem, "write a pattern with {frame}, or choose another member of sources"
                )
        return GrowingFolder(self, site, tuple(_last_number(folder, camera.rgb) for camera in site.cameras))


@dataclass(frozen=True)
class GrowingFolder:
    """Watches a folder. backlog: number of each camera's last file when it was built; -1 where there was none."""

    config: FolderConfig
    site: Capture
    backlog: tuple[int, ...]

    @property
    def numbered(self) -> bool:
        """Whether file names are frame numbers."""
        return self.config.stamps_per_s is None

    def preview(self) -> Preview | None:
        """Nothing: most of it is yet to come."""
        return None

    def run(self, intake: Intake, since: Mapping[int, int], stop: threading.Event) -> None:
        """Put pictures as their files are complete, camera by camera in turn."""
        files = [_Files(self, index, since.get(index)) for index in range(len(self.site.cameras))]
        failures = 0
        while not stop.is_set():
            try:
                found = [self._put_next(camera, one, intake) for camera, one in enumerate(files)]
                failures = 0
            except OSError as error:
                failures += 1
                delay = self.config.retry.delay_s(failures)
                intake.note(SourceFailed(None, f"{self.site.folder}: {error.strerror or error}", delay))
                stop.wait(delay)
                continue
            if not any(found):
                stop.wait(self.config.poll_s)

    def _put_next(self, camera: int, files: _Files, intake: Intake) -> bool:
        """Put a camera's next picture if there is one."""
        number = files.ready()
        if number is None:
            return False
        waits = self.config.drop == "never" or number <= self.backlog[camera]
        if waits and not intake.has_room(camera):
            return False
        files.put(number)
        picture = self._picture(camera, number)
        if picture is not None:
            intake.put(picture)
        return True

    def _picture(self, camera: int, number: int) -> Picture | None:
        """The picture of a file; None where the camera recorded it before frame 0 of the network."""
        stamps = self.config.stamps_per_s
        if stamps is None:
            frame = number - frames_early(self.site, camera)
            load = partial(read_view, self.site, camera, frame, rgb=True, ids=True)
            return None if frame < 0 else Picture(camera, frame / self.site.fps, number, load)
        one = self.site.cameras[camera]
        time_s = number / stamps + one.time_offset_s
        # The file's own number is asked for, so the camera's clock must not be corrected once more.
        alone = replace(self.site, cameras=(replace(one, time_offset_s=0.0),))
        return Picture(camera, time_s, number, partial(read_view, alone, 0, number, rgb=True, ids=True))


def _last_number(folder: Path, pattern: str) -> int:
    """The highest number of the files of a pattern; -1 where there is none, or no folder yet."""
    number_of, parent = frame_numbers(pattern), (folder / pattern).parent
    return max(_numbers(parent, number_of), default=-1) if parent.is_dir() else -1


def _numbers(folder: Path, number_of: Callable[[str], int | None]) -> Iterator[int]:
    """Of a folder's files those whose names have one."""
    return (one for entry in folder.iterdir() if (one := number_of(entry.name)) is not None)


class _Files:
    """One camera's files in the order of their numbers. last: that was put."""

    def __init__(self, source: GrowingFolder, camera: int, since: int | None) -> None:
        site, config = source.site, source.config
        one = site.cameras[camera]
        self._root, self._rgb, self._mask = site.folder, one.rgb, one.mask
        self._consecutive, self._settle_s = config.stamps_per_s is None, config.settle_s
        self._number_of = frame_numbers(one.rgb)
        self._folder = (site.folder / one.rgb).parent
        self._sizes: dict[Path, tuple[int, float]] = {}
        self._gap: tuple[int, float] | None = None
        self._listed, self._numbers = -1, deque[int]()
        self.last = since if since is not None else -1 if config.backlog else source.backlog[camera]

    def ready(self) -> int | None:
        """The number of the next file that is complete, with its mask; None where there is none yet."""
        number = self._next()
        if number is None:
            return None
        paths = [self._root / frame_path(self._rgb, number)]
        if self._mask is not None:
            paths.append(self._root / frame_path(self._mask, number))
        missing = [path for path in paths if not self._complete(path)]  # all are looked at, so that all are timed
        return None if missing else number

    def put(self, number: int) -> None:
        """Note that a number was put, or passed over."""
        self.last = number
        self._sizes.clear()

    def _next(self) -> int | None:
        """The next number there is; a frame number that is left out is waited for a little."""
        while self._numbers and self._numbers[0] <= self.last:
            self._numbers.popleft()
        if not self._consecutive or self.last < 0:
            self._list()
            return self._numbers[0] if self._numbers else None
        number, now = self.last + 1, time.monotonic()
        if (self._root / frame_path(self._rgb, number)).exists():
            return number
        if self._gap is None or self._gap[0] != self.last:
            self._gap = (self.last, now)
        if now - self._gap[1] < self._settle_s:
            return None
        if not self._numbers:  # folders of many files are not looked through for each of them
            self._list()
        if not self._numbers:
            self._gap = (self.last, now)
            return None
        return self._numbers[0]

    def _list(self) -> None:
        """Note the numbers of the files after the last one; read again when the folder has changed."""
        try:
            changed = self._folder.stat().st_mtime_ns
        except FileNotFoundError:
            return
        if changed == self._listed:
            return
        begun = time.time_ns()
        self._numbers = deque(sorted(one for one in _numbers(self._folder, self._number_of) if one > self.last))
        # What comes within the clock's grain would not change the stamp.
        self._listed = changed if begun - changed > _GRAIN_NS else -1

    def _complete(self, path: Path) -> bool:
        """Whether a file's end is there, or nothing has been added to it for long."""
        try:
            size = path.stat().st_size
            ending = _ENDINGS.get(path.suffix.lower())
            if ending is not None and size > len(ending):
                with path.open("rb") as file:
                    file.seek(-len(ending), os.SEEK_END)
                    if file.read() == ending:
                        return True
        except FileNotFoundError:
            size = -1
        now = time.monotonic()
        before = self._sizes.get(path)
        if before is None or before[0] != size:
            self._sizes[path] = (size, now)
            return self._settle_s == 0
        return now - before[1] >= self._settle_s
