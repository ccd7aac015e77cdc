"""What a service remembers comes back with the same bits, and nothing else is taken for it."""

from __future__ import annotations

import numpy as np
import pytest
from support.networks import frame_sets, network

from aerojax.core.errors import UserError
from aerojax.core.tensors import write_tensors
from aerojax.pipeline.step import PipelineState
from aerojax.segment.voxel_vote.background import BackgroundConfig
from aerojax.segment.voxel_vote.member import VoxelVoteConfig
from aerojax.serve.state_files import ServiceState, read_service_state, write_service_state

MADE_WITH = {"cameras": "a", "settings": "b"}


def segmented(model) -> tuple:
    """A segmenter's state after some frames, and the segmenter."""
    config = VoxelVoteConfig(background=BackgroundConfig(model=model, warm_up=3))
    segmenter = config.build(None)
    state = segmenter.initial(network(3))
    for frames in frame_sets(network(3), range(4), masks=False):
        _, state = segmenter.step(frames, state)
    return segmenter, state


def test_a_segmenter_goes_on_from_the_file_as_from_memory(tmp_path):
    segmenter, state = segmented("running")
    before = ServiceState(PipelineState(state, None, {}), {0: 7, 2: 8}, 0.25, 3, 0.1, "2026-01-01T00:00:00+00:00")
    assert write_service_state(tmp_path / "state", before, MADE_WITH) is None
    after = read_service_state(tmp_path / "state", MADE_WITH)
    assert after.pipeline is not None and after.numbers == {0: 7, 2: 8}
    assert (after.zero_s, after.frame, after.time_s, after.began) == (0.25, 3, 0.1, before.began)
    (later,) = frame_sets(network(3), range(4, 5), masks=False)
    ours, theirs = (segmenter.step(later, one) for one in (after.pipeline.segment, state))
    for one, other in zip(ours[1].cameras, theirs[1].cameras, strict=True):
        np.testing.assert_array_equal(one.background.mean, other.background.mean)
        np.testing.assert_array_equal(one.background.variance, other.background.variance)
    assert len(ours[0]) == len(theirs[0])


def test_what_opencv_keeps_to_itself_is_left_out_and_said(tmp_path):
    _, state = segmented("mixture")
    lost = write_service_state(tmp_path / "state", ServiceState(PipelineState(state, None, {}), frame=3), MADE_WITH)
    assert lost is not None and "Subtractor" in lost
    after = read_service_state(tmp_path / "state", MADE_WITH)
    assert after.pipeline is not None and after.pipeline.segment is None and after.frame == 3


def test_a_state_of_something_else_is_refused(tmp_path):
    path = tmp_path / "state"
    write_service_state(path, ServiceState(), MADE_WITH)
    assert read_service_state(path, MADE_WITH).frame == -1
    with pytest.raises(UserError, match="made with other settings; start as before, or delete it") as caught:
        read_service_state(path, {**MADE_WITH, "settings": "c"})
    assert caught.value.code == "mismatch"
    whole = path.read_bytes()
    for content in (whole[:-3], b"", b"{}", whole.replace(b"aerojax-live-state", b"aerojax-live-stale")):
        path.write_bytes(content)
        with pytest.raises(UserError, match="is no aerojax-live-state of version 2"):
            read_service_state(path, MADE_WITH)
    path.write_bytes(whole.replace(b"ServiceState", b"ServiceStale"))
    with pytest.raises(UserError, match="is damaged"):
        read_service_state(path, MADE_WITH)
    write_tensors(path, {"a": np.zeros(3)}, {"what": "ever"})
    with pytest.raises(UserError, match="is no aerojax-live-state"):
        read_service_state(path, MADE_WITH)
