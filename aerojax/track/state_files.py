"""The tracker's memory as JSON, to go on after a restart with the same numbers and the same bits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.imports.calibration.documents import read_document
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.track.following import Followed, FollowingState
from aerojax.track.motion import STATE
from aerojax.track.sights import UNKNOWN, Scan

FORMAT, VERSION = "aerojax-track-state", 2


def write_state(path: Path, state: FollowingState, cameras: tuple[str, ...]) -> None:
    """Write a state whole or not at all.

    Args:
        path: of the JSON file.
        state: that has taken a scan.
        cameras: names of the network's, in order.
    """
    write_json(path, {"format": FORMAT, "version": VERSION, "cameras": list(cameras), **state_to_json(state)})


def read_state(path: Path, cameras: tuple[str, ...]) -> FollowingState:
    """Read a state.

    Raises:
        UserError: the file is no state, or one of other cameras.
    """
    raw = read_document(path)
    if not isinstance(raw, dict) or (raw.get("format"), raw.get("version")) != (FORMAT, VERSION):
        raise UserError("invalid", f"{path}: is no {FORMAT} of version {VERSION}", "give a state that `track` wrote")
    if raw.get("cameras") != list(cameras):
        problem = f"{path}: is of cameras {raw.get('cameras')}, not {list(cameras)}"
        raise UserError("mismatch", problem, "go on with the same cameras in the same order")
    try:
        return state_from_json(raw)
    except (KeyError, TypeError, ValueError) as error:
        raise UserError("invalid", f"{path}: is damaged: {error}", "start without it") from None


def state_to_json(state: FollowingState) -> dict[str, Any]:
    """JSON-ready; numbers keep all their bits."""
    return {
        "time_s": None if np.isinf(state.time_s) else state.time_s,
        "began_s": None if np.isinf(state.began_s) else state.began_s,
        "heard": sorted(state.heard),
        "keys": state.keys,
        "numbers": state.numbers,
        "tracks": [_track_to_json(one) for one in state.tracks],
        "unclaimed": [_scan_to_json(state.unclaimed[camera]) for camera in sorted(state.unclaimed)],
    }


def state_from_json(raw: dict[str, Any]) -> FollowingState:
    """Inverse of `state_to_json`."""
    scans = [_scan_from_json(one) for one in raw["unclaimed"]]
    return FollowingState(
        time_s=-np.inf if raw["time_s"] is None else float(raw["time_s"]),
        began_s=-np.inf if raw["began_s"] is None else float(raw["began_s"]),
        tracks=tuple(_track_from_json(one) for one in raw["tracks"]),
        heard=frozenset(raw["heard"]),
        unclaimed={scan.camera: scan for scan in scans},
        keys=int(raw["keys"]),
        numbers=int(raw["numbers"]),
    )


def _track_to_json(one: Followed) -> dict[str, Any]:
    return {
        "key": one.key,
        "number": one.number,
        "mean": one.mean.tolist(),
        "covariance": one.covariance.tolist(),
        "size_m": one.size_m,
        "status": one.status,
        "hits": list(one.hits),
        "hit_s": one.hit_s,
        "seen": sorted(one.seen),
        "beside": sorted(one.beside),
    }


def _track_from_json(raw: dict[str, Any]) -> Followed:
    return Followed(
        key=int(raw["key"]),
        number=raw["number"],
        mean=np.array(raw["mean"], np.float64).reshape(STATE),
        covariance=np.array(raw["covariance"], np.float64).reshape(STATE, STATE),
        size_m=float(raw["size_m"]),
        status=raw["status"],
        hits=tuple(raw["hits"]),
        hit_s=float(raw["hit_s"]),
        seen={int(camera): UNKNOWN for camera in raw["seen"]},
        beside=frozenset(raw["beside"]),
    )


def _scan_to_json(scan: Scan) -> dict[str, Any]:
    arrays = {name: getattr(scan, name).tolist() for name in ("times", "pixels", "variance", "diagonal")}
    return {"camera": scan.camera, "time_s": scan.time_s, **arrays}


def _scan_from_json(raw: dict[str, Any]) -> Scan:
    times = np.array(raw["times"], np.float64)
    return Scan(
        camera=int(raw["camera"]),
        time_s=float(raw["time_s"]),
        times=times,
        pixels=np.array(raw["pixels"], np.float64).reshape(-1, 2),
        variance=np.array(raw["variance"], np.float64),
        diagonal=np.array(raw["diagonal"], np.float64),
        rows=np.full(len(times), UNKNOWN),
    )
