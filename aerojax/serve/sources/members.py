"""The sources behind the door, by name."""

from aerojax.serve.sources.base import SourceConfig
from aerojax.serve.sources.folder import FolderConfig
from aerojax.serve.sources.playback import PlaybackConfig
from aerojax.serve.sources.streams import StreamsConfig

MEMBERS: dict[str, type[SourceConfig]] = {
    "folder": FolderConfig,
    "playback": PlaybackConfig,
    "streams": StreamsConfig,
}
