"""A recording begins with the bodies and the tools as they stand before the first step, and so does its replay."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rerun as rr

import softseam
from softseam.recording import Recording, time_of
from softseam.replay import convert, verify
from softseam_protocol.messages.session import Frame, StepReport
from softseam_protocol.scene.tools import PlaneTool

pytestmark = pytest.mark.kernels


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("start") / "run.mcap"
    with softseam.open("tofu_grasp", record=path) as session:
        session.reset()
        session.run(max_steps=3)
    return Recording(path)


def test_the_first_message_is_the_body_at_rest_between_its_tools(recording: Recording) -> None:
    first, *others = recording
    assert isinstance(first, Frame) and first.start and time_of(first, recording.scene.step) == 0.0
    np.testing.assert_allclose(first.point_x, recording.surfaces["body"].point_rest, rtol=0.0, atol=1e-15)
    solid = [tool.position for tool in recording.scene.tools.values() if not isinstance(tool, PlaneTool)]
    np.testing.assert_array_equal(first.tool_position[1:], solid)
    frames = [message for message in others if isinstance(message, Frame)]
    assert not any(frame.start for frame in frames)
    assert len(frames) == sum(isinstance(message, StepReport) for message in others) == 3
    times = [time_of(frame, recording.scene.step) for frame in (first, *frames)]
    np.testing.assert_allclose(np.diff(times), recording.scene.step)


def test_it_is_simulated_again_to_the_bit(recording: Recording) -> None:
    again = verify(recording)
    assert again.same and again.frames == 3


def test_a_replay_shows_them_at_time_zero(recording: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is logged before the next moment: the body in each of its views, and where every tool is."""
    seen: list[tuple[float, str]] = []
    stream = rr.RecordingStream("softseam", recording_id="start")
    now = [-1.0]
    set_time, log = stream.set_time, stream.log

    def timed(timeline: str, **at: Any) -> None:
        if timeline == "sim_time":
            now[0] = at["duration"]
        set_time(timeline, **at)

    def logged(path: str, *what: Any, **how: Any) -> None:
        if not how.get("static"):
            seen.append((now[0], path))
        log(path, *what, **how)

    monkeypatch.setattr(stream, "set_time", timed)
    monkeypatch.setattr(stream, "log", logged)
    convert.convert(recording, stream)
    first = {path for time, path in seen if time == 0.0}
    assert {"/world/bodies/body/far", "/world/bodies/body/stress"} < first
    assert {f"/world/tools/{name}" for name in recording.scene.tools} < first
    assert min(time for time, _ in seen) == 0.0
