"""Sightings as SAPIENT detection reports (BSI Flex 335 v2.0), one JSON object a line; extra `sapient`."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from aerojax.capture.format import Capture
from aerojax.core.seeds import number_of
from aerojax.pipeline.exports.sapient import detection_message, node_of, require_sapient, ulid
from aerojax.serve.figures import Health
from aerojax.serve.messages import Message, Sighting
from aerojax.serve.sinks.json_lines import LineFile


class Sapient:
    """A file that is added to; a track's id is the same as long as its number is, restarts included."""

    name, vital = "sapient", False

    def __init__(self, path: Path, site: Capture) -> None:
        require_sapient(site, "1970-01-01", asked="sapient")
        self._file, self._node = LineFile(path), node_of(site)
        self._began = datetime.fromtimestamp(0, UTC)

    def send(self, message: Message, sighting: Sighting | None) -> None:
        """Write a report of a sighting; other messages have none."""
        if message["type"] == "started":
            self._began = datetime.fromisoformat(message["began"])
        if sighting is None:
            return
        from google.protobuf import json_format

        moment, track = sighting.moment, sighting.track
        known = ulid(self._began, number_of(self._node, self._began.isoformat(), "track", track))
        report = ulid(moment, number_of(self._node, "report", track, sighting.point.frame))
        told = detection_message(sighting.point, self._node, moment, track=known, report=report)
        self._file.write(json_format.MessageToJson(told, preserving_proto_field_name=True, indent=None))

    def see(self, health: Health) -> None:
        """SAPIENT's status reports are another message, which this does not write."""

    def close(self) -> None:
        """Close the file."""
        self._file.close()
