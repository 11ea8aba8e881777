"""A step that follows for certain begins with the correction of the one before: the same bits, fewer exchanges."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from softseam.variants import with_model
from softseam_protocol.messages.participant import Advance, Advanced, Correct, Reply, Request
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene, load_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.fem.solver import FemSolver
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost

SCENES = Path(__file__).parents[2] / "scenes"


class Counting(EmbeddedTransport):
    """Counts exchanges, and steps that were begun ahead; leaves them to who asks, or loses a participant, if told."""

    def __init__(self, leaves: tuple[str, ...] = ()) -> None:
        super().__init__()
        self.leaves = leaves
        self.n_exchanges = self.n_ahead = 0
        self.lost: str | None = None

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        self.n_exchanges += 1
        ahead = any(isinstance(request, Correct) and request.then is not None for request in requests.values())
        self.n_ahead += ahead
        if ahead and self.lost is not None:
            name, self.lost = self.lost, None
            super().exchange({other: request for other, request in requests.items() if other != name})
            raise ParticipantLost(name, "the cable was cut")
        asked = {
            name: replace(request, then=None) if isinstance(request, Correct) and name in self.leaves else request
            for name, request in requests.items()
        }
        return super().exchange(asked)

    def wait_alive(self, participant: str, timeout: float) -> bool:
        return False


def _scene(name: str, duration: float, **changes: object) -> Scene:
    scene = with_model(load_scene(SCENES / f"{name}.yaml").scene, "hybrid")
    return scene.model_copy(update={"duration": duration, **changes})


def _run(scene: Scene, transport: Counting, more: bool) -> tuple[list[StepReport], Simulation]:
    simulation, reports = Simulation(bundle_scene(scene), transport), []
    while not simulation.done:
        reports.append(simulation.step(more=more))
    return reports, simulation


def _same(one: list[StepReport], other: list[StepReport]) -> None:
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert (a.phase, a.energy, a.quantities, a.interfaces) == (b.phase, b.energy, b.quantities, b.interfaces)
        np.testing.assert_array_equal(a.wrench, b.wrench)
        np.testing.assert_array_equal(a.tool_position, b.tool_position)


@pytest.mark.parametrize(
    ("name", "duration", "least"),
    [("cantilever", 0.7, 0.95), ("tofu_grasp", 0.9, 0.25), ("tofu_slab", 0.8, 0.5)],
    ids=["beam", "grip", "slab"],
)
def test_the_bits_are_the_same_in_fewer_exchanges(name: str, duration: float, least: float) -> None:
    """Also where cells switch, phases end, fields are looked at and checkpoints are made meanwhile.

    least: share of the steps that are begun ahead; the slab rocks on the table for .3 s, by more than 1e-3 rad a step,
    which no step is begun ahead of
    """
    plain, ahead = Counting(), Counting()
    scene = _scene(name, duration)
    one, first = _run(scene, plain, more=False)
    other, second = _run(scene, ahead, more=True)
    _same(one, other)
    assert first.frame().x.tobytes() == second.frame().x.tobytes()
    assert plain.n_ahead == 0 and ahead.n_ahead > least * len(other)
    assert ahead.n_exchanges <= plain.n_exchanges - 0.95 * ahead.n_ahead


@pytest.mark.parametrize(("stress", "quantities"), [(1500.0, ()), (None, ("grip_force", "model_error"))])
def test_steps_after_which_fields_are_looked_at_are_ended_first(stress: float | None, quantities: tuple[str]) -> None:
    """By the rule that makes cells near, or by quantities that need the errors of cells."""
    scene = _scene("tofu_grasp", 0.9, quantities=quantities)
    near = scene.regions.near
    assert near is not None
    regions = scene.regions.model_copy(update={"near": near.model_copy(update={"stress": stress})})
    scene = scene.model_copy(update={"regions": regions})
    plain, ahead = Counting(), Counting()
    _same(_run(scene, plain, more=False)[0], _run(scene, ahead, more=True)[0])
    assert ahead.n_ahead > 5 and ahead.n_exchanges <= plain.n_exchanges - ahead.n_ahead


@pytest.mark.parametrize("leaves", [("body.near",), ("body.far",), ("body.near", "body.far")])
def test_a_participant_may_leave_the_step_that_follows(leaves: tuple[str, ...]) -> None:
    """It is asked for it by a request of its own."""
    scene = _scene("cantilever", 0.2)
    _same(_run(scene, Counting(), more=False)[0], _run(scene, Counting(leaves), more=True)[0])


@pytest.mark.parametrize("lost", ["body.near", "body.far"])
@pytest.mark.parametrize(("name", "steps"), [("cantilever", 7), ("tofu_grasp", 70)])
def test_who_has_gone_on_is_brought_back_where_another_is_lost(name: str, steps: int, lost: str) -> None:
    """It has committed the step that failed: it is built anew, to the last bit, and the tools have not moved."""
    scene, transport = _scene(name, 0.3 if name == "cantilever" else 0.8), Counting()
    expected, _ = _run(scene, Counting(), more=False)
    simulation = Simulation(bundle_scene(scene), transport)
    reports = [simulation.step(more=True) for _ in range(steps)]
    transport.lost = lost
    with pytest.raises(ParticipantLost):
        simulation.step(more=True)
    while not simulation.done:
        reports.append(simulation.step(more=True))
    _same(expected, reports)


@pytest.mark.parametrize(
    "act", [Simulation.frames, Simulation.save, Simulation.estimate, Simulation.step, Simulation.reset]
)
def test_a_step_that_was_begun_and_is_not_wanted_is_taken_back(act: Callable[[Simulation], object]) -> None:
    """Whatever is asked in its place is answered of the step that was committed."""
    scene = _scene("tofu_grasp", 1.0)
    plain, ahead = (Simulation(bundle_scene(scene), Counting()) for _ in range(2))
    for _ in range(70):
        plain.step()
        ahead.step(more=True)
    assert ahead.only.participants.is_ahead
    if act is Simulation.step:
        still = {"left": (0.0, 0.0, 0.01)}
        for one in (plain, ahead):
            one.step(still)
    else:
        act(plain), act(ahead)
    assert ahead.time == plain.time
    np.testing.assert_allclose(ahead.frame().x, plain.frame().x, atol=2e-7)
    ahead.step(more=True), plain.step()
    np.testing.assert_allclose(ahead.frame().x, plain.frame().x, atol=2e-7)


def test_nothing_is_begun_ahead_of_what_depends_on_the_step() -> None:
    """Not by hand, at the end, before a checkpoint, where fields are looked at by the rule, or a force decides."""
    scene, transport = _scene("cantilever", 0.6), Counting()
    simulation = Simulation(bundle_scene(scene), transport)
    ahead = []
    while not simulation.done:
        before = transport.n_ahead
        simulation.step(more=True)
        ahead.append(transport.n_ahead > before)
    assert not ahead[-1] and not ahead[49] and all(ahead[10:49])
    simulation.reset()
    before = transport.n_ahead
    simulation.step({}, more=True)
    assert transport.n_ahead == before


def test_what_follows_must_be_the_first_request_of_the_next_step() -> None:
    """Of the same part: a participant serves it in its place in the order, and refuses any other untouched."""
    scene = _scene("cantilever", 0.3)
    seen: list[Correct] = []

    class Watching(Counting):
        def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
            for request in requests.values():
                if isinstance(request, Correct) and request.then is not None and request.header.step == 3:
                    now = request.then.header
                    others = [replace(now, step=7), replace(now, exchange=1), replace(now, epoch=9)]
                    for header in (*others, replace(now, part="body.elsewhere")):
                        wrong = replace(request.then, header=header)
                        with pytest.raises(ParticipantFailed, match="not the first Advance of the step that follows"):
                            super().exchange({request.header.part: replace(request, then=wrong)})
                    seen.append(request)
            return super().exchange(requests)

    _same(_run(scene, Counting(), more=False)[0], _run(scene, Watching(), more=True)[0])
    assert len(seen) == 2


def test_where_what_follows_fails_the_correction_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """The answer is of the correction alone, and the rest is asked for again."""
    scene, advance = _scene("cantilever", 0.3), FemSolver.advance
    expected = _run(scene, Counting(), more=False)[0]
    failed: list[int] = []

    def fails_once(solver: FemSolver, request: Advance) -> Advanced:
        if request.header.step % 10 == 3 and request.header.step not in failed:
            failed.append(request.header.step)
            raise MemoryError
        return advance(solver, request)

    monkeypatch.setattr(FemSolver, "advance", fails_once)
    _same(expected, _run(scene, Counting(), more=True)[0])
    assert failed == list(range(3, 150, 10))


def test_who_is_still_away_is_waited_for() -> None:
    """A participant that is lost for good, and again as it is built anew, is waited for as any that is lost."""

    class Away(Counting):
        here, waits = True, 0

        def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
            if not self.here and "body.near" in requests:
                raise ParticipantLost("body.near", "the cable was cut")
            return super().exchange(requests)

        def wait_alive(self, participant: str, timeout: float) -> bool:
            self.waits += 1
            self.here = self.waits > 1
            return self.here

    scene, transport = _scene("cantilever", 0.3), Away()
    expected, _ = _run(scene, Counting(), more=False)
    simulation = Simulation(bundle_scene(scene), transport)
    reports = [simulation.step(more=True) for _ in range(7)]
    transport.here, transport.lost = False, "body.near"
    with pytest.raises(ParticipantLost):
        simulation.step(more=True)
    while not simulation.done:
        reports.append(simulation.step(more=True))
    assert transport.waits == 2
    _same(expected, reports)
