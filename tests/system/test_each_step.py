"""Requests for steps: nothing that was simulated is lost, or simulated twice, where a participant is lost meanwhile."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from real_services import free_port, squeezed_bar
from trajectory import first_difference

from softseam.errors import FieldsNotObserved
from softseam.observation import observation_from
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Advance, Correct, Observe, Reply, Request
from softseam_protocol.messages.session import Observation, Observations, Open, Step
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode
from softseam_services.orchestrator import client_session
from softseam_services.orchestrator.bus_transport import BusTimes
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.kept_session import KeptSession
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.transport import ParticipantLost

LAST = 3
"""steps that succeed"""


class Losing(EmbeddedTransport):
    """Loses its participants for good once they have taken LAST steps, where they are asked for a kind of request.

    They leave the step that would begin with the correction of the one before.
    """

    kinds: tuple[type[Request], ...] = (Advance,)
    waits = 0
    """how often anybody waited for a participant to come back"""

    def __init__(self, bus: Bus, keys: Keys, services: Mapping[str, str] | None) -> None:
        super().__init__()
        self.times = BusTimes()

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        for name, request in requests.items():
            if isinstance(request, self.kinds) and request.header.step >= LAST:
                raise ParticipantLost(name, "the cable was cut")
        alone = {name: replace(one, then=None) if isinstance(one, Correct) else one for name, one in requests.items()}
        return super().exchange(alone)

    def wait_alive(self, participant: str, timeout: float) -> bool:
        Losing.waits += 1
        return False


class LosingFields(Losing):
    """Its participants take steps, and are lost for good where they are asked for fields after LAST of them."""

    kinds = (Observe,)


@pytest.fixture
def bus() -> Iterator[Bus]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with Router(endpoint), Bus(endpoint, role=SERVICE) as opened:
        yield opened


def request(count: int, *, each: bool = False, fields: bool = False) -> Step:
    return Step(Header(SCHEMA_VERSION, "s", "", 0, 0, 1, 0.0), count, True, {}, fields=fields, each=each)


def asked(quantities: tuple[str, ...] = ()) -> Open:
    header = Header(SCHEMA_VERSION, "s", "", 0, 0, 1, 0.0)
    return Open(header, bundle_scene(squeezed_bar().model_copy(update={"quantities": quantities})))


def opened(bus: Bus, quantities: tuple[str, ...] = ()) -> client_session.ClientSession:
    """A session; some quantities are asked for in a request of their own."""
    one = client_session.ClientSession(bus, Keys("each"), "s", lambda: False, KeptSession(None, "s"))
    one.open(asked(quantities))
    return one


def test_a_failure_is_told_after_the_steps_before_it(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first answer has the steps that were taken, the next is the failure; after a reset all is as before."""
    monkeypatch.setattr(client_session, "BusTransport", Losing)
    one = opened(bus)
    for _ in range(2):
        taken: list[Observation] = []
        with pytest.raises(ParticipantLost, match="come back"):
            for _ in range(LAST + 1):  # a slow machine takes one step a turn
                answer = one.step(request(10, each=True))
                assert isinstance(answer, Observations)
                taken += answer.steps
        assert [observation.header.step for observation in taken] == [1, 2, 3]
        assert all(not observation.frames for observation in taken)
        one.reset(0)
    plain = one.step(request(LAST))
    assert isinstance(plain, Observation) and plain.header.step == LAST


def test_a_step_whose_fields_are_lost_is_taken_once(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is answered without them, and says why; they are waited for once. The next request is for the next step."""
    monkeypatch.setattr(client_session, "BusTransport", LosingFields)
    one = opened(bus, ("model_error",))
    one.step(request(LAST - 1))
    assert one.save()
    monkeypatch.setattr(Losing, "waits", 0)
    for taken in (LAST, LAST + 1):
        answer = one.step(request(1, fields=True))
        assert isinstance(answer, Observation) and not answer.frames
        assert answer.header.step == taken and answer.report.header.step == taken - 1
        assert [event.message for event in answer.events if event.kind == "lost"] == [
            f"step {taken - 1} is taken, but what follows it was not done: participant 'body.near' is lost: it did not "
            "come back within 60 s: is its service running and supervised?"
        ]
        assert Losing.waits == taken - LAST + 1
    with pytest.raises(FieldsNotObserved, match=f"step {LAST} is taken, but"):
        assert isinstance(answer, Observation) and observation_from(answer, ("left", "right")).positions
    monkeypatch.setattr(LosingFields, "kinds", ())
    whole = one.step(request(1, fields=True))
    assert isinstance(whole, Observation) and whole.frames and whole.header.step == LAST + 2


def test_steps_before_one_that_fails_are_counted(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who asks for several at once is told how many were taken."""
    monkeypatch.setattr(client_session, "BusTransport", Losing)
    one = opened(bus)
    with pytest.raises(StepFailed, match=rf"come back .* \({LAST} of the 10 steps asked for were taken\)"):
        one.step(request(10))
    with pytest.raises(ParticipantLost, match=r"supervised\?$"):
        one.step(request(10))


def test_a_session_that_cannot_be_seen_is_not_open(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be opened again under its name."""
    monkeypatch.setattr(client_session, "BusTransport", LosingFields)
    monkeypatch.setattr("test_each_step.LAST", -1)
    one = client_session.ClientSession(bus, Keys("each"), "s", lambda: False, KeptSession(None, "s"))
    with pytest.raises(ParticipantLost):
        one.open(asked())
    assert not one.opened
    monkeypatch.setattr(LosingFields, "kinds", ())
    again = one.open(asked())
    assert again.frames and not again.events


def test_a_session_that_is_closed_while_it_is_taken_up_is_taken_up_whole(
    bus: Bus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else its recording would end before what was recorded of it when its orchestrator was lost."""
    monkeypatch.setattr(client_session, "BusTransport", LosingFields)
    monkeypatch.setattr(LosingFields, "kinds", ())
    steps = request(LAST + 2)
    first, second = (
        client_session.ClientSession(bus, Keys("each"), "s", lambda: False, KeptSession(tmp_path, "s"))
        for _ in range(2)
    )
    first.open(asked())
    first.note(asked(), b"")
    answer = encode(first.step(steps))
    first.note(steps, answer)
    second.cancelled = True
    second.take_up()
    assert second.answer is not None and second.steps == LAST + 2
    assert (
        first_difference([decode(answer, Observation).report], [decode(second.answer.payload, Observation).report])
        == ""
    )
    with pytest.raises(client_session.Stopped):
        second.step(request(1))
