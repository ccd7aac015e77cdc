"""Detections of a clip as SAPIENT messages (BSI Flex 335 v2.0), one JSON object a line by protobuf's own mapping.

The messages are made with the published protobuf bindings (package `sapient-msg`, extra `sapient`), so that every field
is one of the standard's. Places are latitude, longitude and height on WGS 84, so the capture needs an `origin`.
"""

from __future__ import annotations

import importlib.util
import uuid
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from aerojax.capture.format import Capture
from aerojax.core.errors import UserError
from aerojax.core.files import write_text
from aerojax.core.seeds import number_of
from aerojax.pipeline.track_points import TrackPoint

_TAXONOMY = {
    "bird": ("Animal", "Bird"),
    "drone": ("Air vehicle", "UAV rotary wing"),
    "airplane": ("Air vehicle", "Manned fixed wing"),
    "helicopter": ("Air vehicle", "Manned rotary wing"),
}
"""The standard's classes nearest to ours, which do not say whether somebody is on board."""
_CROCKFORD = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_NAMESPACE = uuid.UUID("6f1c7c1e-0d0b-5d0e-9a52-0d5b5c1f3a77")
"""Of the node ids; any fixed value."""


def require_sapient(capture: Capture, began: str, *, asked: str = "export=sapient") -> None:
    """Refuse a capture without a place on the earth, and a machine without the bindings.

    Args:
        capture: whose cameras they are.
        began: time of frame 0, ISO 8601.
        asked: what wants the messages, for the error.

    Raises:
        UserError: the bindings are not installed, the capture has no origin, or `began` is no time.
    """
    if importlib.util.find_spec("sapient_msg") is None:
        message = f"{asked} needs the package sapient-msg"
        raise UserError("unavailable", message, "pip install 'aerojax[sapient]'")
    if capture.origin is None:
        message = f"{capture.folder}/capture.json has no origin, and SAPIENT wants latitude and longitude"
        raise UserError("missing", message, 'add "origin": {"latitude": …, "longitude": …, "height": …}')
    _moment(began)


def export_sapient(capture: Capture, points: Sequence[TrackPoint], path: Path, began: str) -> Path:
    """One message with a detection report a frame.

    Args:
        capture: what was classified; its origin says where the world lies.
        points: its track.
        path: of the JSON-lines file.
        began: time of frame 0, ISO 8601; UTC where it names no offset.

    Raises:
        UserError: as `require_sapient`.
    """
    require_sapient(capture, began)
    from google.protobuf import json_format

    start = _moment(began)
    node = node_of(capture)
    track = ulid(start, number_of(node, began, "track"))
    lines = []
    for point in points:
        moment = start + timedelta(seconds=point.time_s)
        message = detection_message(
            point, node, moment, track=track, report=ulid(moment, number_of(node, began, "report", point.frame))
        )
        lines.append(json_format.MessageToJson(message, preserving_proto_field_name=True, indent=None) + "\n")
    write_text(path, "".join(lines))
    return path


def node_of(capture: Capture) -> str:
    """The UUID of the network as a SAPIENT node: the same for the same folder."""
    return str(uuid.uuid5(_NAMESPACE, str(capture.folder.resolve())))


def detection_message(point: TrackPoint, node: str, moment: datetime, *, track: str, report: str) -> Any:
    """One sighting as a `SapientMessage` with a detection report.

    Args:
        point: where and what it is; with its place.
        node: UUID of what reports it.
        moment: when, UTC.
        track, report: ULIDs of the object and of the report.
    """
    from sapient_msg.bsi_flex_335_v2_0 import location_pb2, sapient_message_pb2

    message = sapient_message_pb2.SapientMessage(node_id=node)
    message.timestamp.FromDatetime(moment.replace(tzinfo=None))
    location = message.detection_report.location
    location.coordinate_system = location_pb2.LOCATION_COORDINATE_SYSTEM_LAT_LNG_DEG_M
    location.datum = location_pb2.LOCATION_DATUM_WGS84_E
    _fill(message.detection_report, point, track, report)
    return message


def _moment(began: str) -> datetime:
    try:
        moment = datetime.fromisoformat(began)
    except ValueError:
        raise UserError("invalid", f"began={began!r} is no time", "write it as 2026-05-01T12:00:00Z") from None
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


def _fill(report: Any, point: TrackPoint, track: str, number: str) -> None:
    assert point.place is not None, "the capture has an origin"
    report.report_id, report.object_id = number, track
    location = report.location
    location.y, location.x, location.z = point.place  # x is the longitude, y the latitude
    if point.velocity is not None:
        rate = report.enu_velocity
        rate.east_rate, rate.north_rate, rate.up_rate = point.velocity
    if point.size is not None:
        for name, value in zip(("length", "width", "height"), point.size, strict=True):
            report.object_info.add(type=name, value=f"{value:.3f}")
    for kind in dict.fromkeys(kind for kind, _ in _TAXONOMY.values()):
        members = {name: sub for name, (top, sub) in _TAXONOMY.items() if top == kind}
        entry = report.classification.add(type=kind, confidence=sum(point.probabilities[name] for name in members))
        for name, sub in members.items():
            entry.sub_class.add(type=sub, confidence=point.probabilities[name], level=1)


def ulid(moment: datetime, number: int) -> str:
    """A ULID: 48 bits of milliseconds since 1970 and 80 bits of `number`, in Crockford's base 32 (ulid/spec)."""
    value = (int(moment.timestamp() * 1000) % 2**48) << 80 | number % 2**80
    return "".join(_CROCKFORD[value >> shift & 31] for shift in range(125, -1, -5))
