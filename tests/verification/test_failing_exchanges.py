"""What a step left to be settled is not lost where a participant is, for good, before it was told."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from softseam.variants import with_model
from softseam_protocol.messages import Advance, Commit, Reply, Request
from softseam_protocol.scene_file import bundle_scene, load_scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantLost

CANTILEVER = Path(__file__).parents[2] / "scenes" / "cantilever.yaml"


class Failing(EmbeddedTransport):
    """The near side is lost in the next exchange of requests of a kind; the far side was reached, or was not."""

    kind: type[Request] | None = None
    reaches_far: bool = False

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        if self.kind is not None and isinstance(requests.get("near"), self.kind):
            self.kind = None
            if self.reaches_far:
                super().exchange({"far": requests["far"]})
            raise ParticipantLost("near", "the cable was cut")
        return super().exchange(requests)

    def wait_alive(self, participant: str, timeout: float) -> bool:
        return False


def falling(transport: EmbeddedTransport) -> Simulation:
    """A beam under its weight, whose every step is settled by the next."""
    simulation = Simulation(bundle_scene(with_model(load_scene(CANTILEVER).scene, "hybrid")), transport)
    for _ in range(12):
        report = simulation.step()
    assert report.seam.n_nodes and report.seam.exchanges == 1
    return simulation


@pytest.mark.parametrize("reaches_far", [False, True])
@pytest.mark.parametrize(
    ("kind", "act"), [(Commit, Simulation.frame), (Commit, Simulation.save), (Advance, Simulation.step)]
)
def test_asked_again_the_step_is_settled(
    kind: type[Request], act: Callable[[Simulation], object], reaches_far: bool
) -> None:
    """A frame, a snapshot and the run that follows are those of a run without the failure."""
    transport = Failing()
    failed, whole = falling(transport), falling(EmbeddedTransport())
    transport.kind, transport.reaches_far = kind, reaches_far
    with pytest.raises(ParticipantLost):
        act(failed)
    for simulation in (failed, whole):
        act(simulation)
    assert failed.frame().x.tobytes() == whole.frame().x.tobytes()
    assert failed.save() == whole.save()
    np.testing.assert_array_equal(failed.step().momentum, whole.step().momentum)


def test_a_step_that_failed_half_way_leaves_what_was_committed() -> None:
    """The far side has gone on to a step that is not taken: nobody sees it."""
    transport = Failing()
    failed, whole, loaded = (falling(each) for each in (transport, EmbeddedTransport(), EmbeddedTransport()))
    transport.kind, transport.reaches_far = Advance, True
    with pytest.raises(ParticipantLost):
        failed.step()
    assert failed.frame().x.tobytes() == whole.frame().x.tobytes()
    loaded.load(failed.save())
    whole.save()
    assert loaded.frame().x.tobytes() == whole.frame().x.tobytes()
    np.testing.assert_array_equal(failed.step().momentum, whole.step().momentum)


@pytest.mark.parametrize("act", [Simulation.save, Simulation.estimate])
def test_a_step_that_fails_after_the_last_was_settled_leaves_what_was_committed(
    act: Callable[[Simulation], object],
) -> None:
    """To take it back is another request than the one that settled the step before it, and is not taken for it."""
    transport = Failing()
    failed, whole = falling(transport), falling(EmbeddedTransport())
    for simulation in (failed, whole):
        act(simulation)
    transport.kind, transport.reaches_far = Advance, True
    with pytest.raises(ParticipantLost):
        failed.step()
    assert failed.frame().x.tobytes() == whole.frame().x.tobytes()
    assert failed.save() == whole.save()
    np.testing.assert_array_equal(failed.step().momentum, whole.step().momentum)


def test_a_frame_after_a_snapshot_that_failed_is_of_both_sides() -> None:
    """The far side has answered the request before, which asked for no fields."""
    transport = Failing()
    failed, whole = falling(transport), falling(EmbeddedTransport())
    transport.kind, transport.reaches_far = Commit, True
    with pytest.raises(ParticipantLost):
        failed.save()
    assert failed.frame().x.tobytes() == whole.frame().x.tobytes()
