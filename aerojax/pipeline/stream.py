"""The pipeline over frames that never end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from aerojax.core.types import FrameSet
from aerojax.pipeline.events import Event
from aerojax.pipeline.step import Pipeline, PipelineState


def stream(
    pipeline: Pipeline, source: Iterable[FrameSet], state: PipelineState | None = None
) -> Iterator[tuple[tuple[Event, ...], PipelineState]]:
    """Events after each frame of a source, in constant memory and time a frame.

    Args:
        pipeline: the network's.
        source: frame sets in the order of time.
        state: where an earlier stream ended, or `pipeline.initial(preview)`; from nothing if None.

    Yields:
        The frame's events, and the state with which another call goes on behind it.
    """
    state = pipeline.initial() if state is None else state
    for frames in source:
        events, state = pipeline.step(frames, state)
        yield events, state
