"""A service's figures in Prometheus' text format, version 0.0.4."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from aerojax.serve.figures import Health

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
Sample = tuple[str, Mapping[str, str], float]


def exposition(health: Health) -> str:
    """All metrics, names beginning with `aerojax_`."""
    cameras, latency = health.cameras, health.latency_ms
    spent = (
        [] if latency is None else [("", {"quantile": q}, ms / 1e3) for q, ms in zip(_QUANTILES, latency, strict=True)]
    )
    spent += [("_sum", {}, health.latency_sum_s), ("_count", {}, float(health.frames))]
    by_camera = {
        key: [("", {"camera": name}, float(getattr(one, key))) for name, one in cameras.items()]
        for key in ("given", "late", "surplus", "silent")
    }
    held = health.resources
    parts = [
        _family("uptime_seconds", "gauge", "Since the service began.", _one(health.uptime_s)),
        _family("frames_total", "counter", "Frames that were looked at.", _one(health.frames)),
        _family("frames_partial_total", "counter", "Of these, without one of the cameras.", _one(health.partial)),
        _family("frames_dropped_total", "counter", "Frames that were not taken in time.", _one(health.dropped)),
        _family("frames_waiting", "gauge", "Frames in the buffer.", _one(health.waiting)),
        _family("frame_rate", "gauge", "Frames a second, of the last 1000.", _one(health.rate)),
        _family("frame_to_track_seconds", "summary", "From a frame's last picture to its messages.", spent),
        _family("tracks", "gauge", "Objects that are known.", _one(health.tracks)),
        _family("sightings_total", "counter", "Objects in frames, by answer.", _by("answer", health.sightings)),
        _family("unusable_total", "counter", "What could not be used, by reason.", _by("code", health.unusable)),
        _family("pictures_total", "counter", "Pictures that cameras gave.", by_camera["given"]),
        _family("pictures_late_total", "counter", "Pictures too late for their frame.", by_camera["late"]),
        _family("pictures_surplus_total", "counter", "Pictures beyond one a frame.", by_camera["surplus"]),
        _family("camera_silent", "gauge", "Whether a camera gives nothing.", by_camera["silent"]),
        _family("stage_seconds", "gauge", "Median of a stage.", _by("stage", _seconds(health.stages_ms))),
        _family("send_failures_total", "counter", "Messages that a sink lost.", _by("sink", health.failed_sends)),
        _family("resident_memory_bytes", "gauge", "Memory of the process.", _one(held.resident_mb * 1e6)),
        _family("open_handles", "gauge", "Files and sockets.", _one(held.handles)),
        _family("threads", "gauge", "Threads of Python.", _one(held.threads)),
    ]
    return "".join(parts)


_QUANTILES = ("0.5", "0.95", "1")


def _seconds(milliseconds: Mapping[str, float]) -> dict[str, float]:
    return {name: value / 1e3 for name, value in milliseconds.items()}


def _one(value: float | int) -> list[Sample]:
    return [("", {}, float(value))]


def _by(label: str, values: Mapping[str, float] | Mapping[str, int]) -> list[Sample]:
    return [("", {label: name}, float(value)) for name, value in values.items()]


def _family(name: str, kind: str, about: str, samples: Iterable[Sample]) -> str:
    name = f"aerojax_{name}"
    lines = [f"# HELP {name} {about}", f"# TYPE {name} {kind}"]
    for suffix, labels, value in samples:
        pairs = ",".join(f'{key}="{_escaped(text)}"' for key, text in labels.items())
        lines.append(f"{name}{suffix}{{{pairs}}} {value!r}" if pairs else f"{name}{suffix} {value!r}")
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """A label's value: backslash, quote and line feed are escaped."""
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
