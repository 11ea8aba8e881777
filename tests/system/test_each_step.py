"""A request for the observations of several steps: nothing that was simulated is lost where a step fails."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import pytest
from real_services import free_port, squeezed_bar

from softseam_protocol.bus import Bus, Router
from softseam_protocol.messages import SCHEMA_VERSION, Advance, Header, Observation, Observations, Reply, Request, Step
from softseam_protocol.scene_file import bundle_scene
from softseam_protocol.topics import Keys
from softseam_services.orchestrator import desk
from softseam_services.orchestrator.bus_transport import BusTimes
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.transport import ParticipantLost

LAST = 3
"""steps that succeed"""


class Losing(EmbeddedTransport):
    """Loses its participants for good once they have taken LAST steps."""

    def __init__(self, bus: Bus, keys: Keys) -> None:
        super().__init__()
        self.times = BusTimes()

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        for name, request in requests.items():
            if isinstance(request, Advance) and request.header.step >= LAST:
                raise ParticipantLost(name, "the cable was cut")
        return super().exchange(requests)

    def wait_alive(self, participant: str, timeout: float) -> bool:
        return False


@pytest.fixture
def bus() -> Iterator[Bus]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with Router(endpoint), Bus(endpoint) as opened:
        yield opened


def request(count: int, *, each: bool) -> Step:
    return Step(Header(SCHEMA_VERSION, "s", "", 0, 0, 1, 0.0), count, True, {}, fields=False, each=each)


def test_a_failure_is_told_after_the_steps_before_it(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first answer has the steps that were taken, the next is the failure; after a reset all is as before."""
    monkeypatch.setattr(desk, "BusTransport", Losing)
    one = desk.Desk(bus, Keys("each"), "s", lambda: False)
    one.open(bundle_scene(squeezed_bar()), record=False)
    for _ in range(2):
        taken: list[Observation] = []
        with pytest.raises(ParticipantLost, match="come back"):
            for _ in range(LAST + 1):  # a slow machine takes one step a turn
                answer = one.step(request(10, each=True))
                assert isinstance(answer, Observations)
                taken += answer.steps
        assert [observation.header.step for observation in taken] == [1, 2, 3]
        assert all(observation.frame is None for observation in taken)
        one.reset(0)
    plain = one.step(request(LAST, each=False))
    assert isinstance(plain, Observation) and plain.header.step == LAST
