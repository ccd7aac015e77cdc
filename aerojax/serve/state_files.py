"""What a service remembers, on disk, so that another one goes on where it ended: one safetensors file, whole or not."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from aerojax.core.errors import UserError
from aerojax.core.files import json_text
from aerojax.core.tensors import read_tensors, write_tensors
from aerojax.pipeline.step import PipelineState
from aerojax.serve.trees import NotStorable, from_tree, to_tree

FORMAT, VERSION = "aerojax-live-state", 2
_DAMAGED = (ValueError, KeyError, TypeError, AttributeError, ImportError, UserError)


@dataclass(frozen=True, eq=False)
class ServiceState:
    """Everything that outlives the process.

    pipeline: of the stages; None before the first frame.
    numbers: by camera, the number of its last picture that a frame was made of.
    zero_s: source time of the network's zero; None before the first frame. frame, time_s: of the last frame.
    began: when the first service began, ISO 8601: track numbers are unique with it.
    """

    pipeline: PipelineState | None = None
    numbers: Mapping[int, int] = field(default_factory=dict)
    zero_s: float | None = None
    frame: int = -1
    time_s: float = float("-inf")
    began: str = ""


def write_service_state(path: Path, state: ServiceState, made_with: Mapping[str, str]) -> str | None:
    """Write a state whole or not at all.

    Args:
        path: of the file.
        state: of a service.
        made_with: texts that a service that goes on must agree with, by what they say.

    Returns:
        What could not be stored: the segmenter's memory, without which it learns the background anew; None otherwise.

    Raises:
        OSError: the disk takes no file.
    """
    lost = None
    try:
        tree, arrays = to_tree(state)
    except NotStorable as error:
        if state.pipeline is None:
            raise
        tree, arrays = to_tree(replace(state, pipeline=replace(state.pipeline, segment=None)))
        lost = str(error)
    header = {"format": FORMAT, "version": VERSION, "made_with": dict(made_with), "state": tree}
    write_tensors(path, arrays, {"state": json_text(header, indent=None)})
    return lost


def read_service_state(path: Path, made_with: Mapping[str, str]) -> ServiceState:
    """Read a state; its pipeline's `segment` may be None, and then begins anew.

    Raises:
        UserError: the file is no state, is damaged, or is of other cameras, settings or weights.
    """
    try:
        arrays, header = read_tensors(path)
        raw: dict[str, Any] = json.loads(header["state"])
        known = (raw["format"], raw["version"]) == (FORMAT, VERSION)
    except _DAMAGED:
        known, raw, arrays = False, {}, {}
    if not known:
        raise UserError("invalid", f"state={path}: is no {FORMAT} of version {VERSION}", "delete it to begin anew")
    changed = [name for name in made_with if raw.get("made_with", {}).get(name) != made_with[name]]
    if changed:
        problem = f"state={path}: was made with other {' and '.join(changed)}"
        raise UserError("mismatch", problem, "start as before, or delete it to begin anew")
    try:
        state = from_tree(raw["state"], arrays)
    except _DAMAGED as error:
        raise UserError("invalid", f"state={path}: is damaged: {error}", "delete it to begin anew") from None
    if not isinstance(state, ServiceState):
        raise UserError("invalid", f"state={path}: holds no state", "delete it to begin anew")
    return state
