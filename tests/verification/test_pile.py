"""A pile: whole XPBD bodies that step as one part, each as if it were alone, to the bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from cubes import cube, cubes, scene_of, unlike

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import (
    Advance,
    Configure,
    Reply,
    Request,
    Restore,
    Snapshot,
    SnapshotTaken,
)
from softseam_protocol.messages.session import Frame, StepReport
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_protocol.wire.codec import decode, encode
from softseam_services.orchestrator.archive import ArchiveError
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost

FIELDS = ("x", "cauchy", "contact_force", "contact_tool", "cell_energy")
WEIGHT = 1050.0 * 0.05**3 * 9.81
"""of a cube [N]"""


def simulation(scene: Scene, transport: EmbeddedTransport | None = None) -> Simulation:
    return Simulation(bundle_scene(scene), transport or EmbeddedTransport())


def run(sim: Simulation, steps: int) -> tuple[list[StepReport], dict[str, Frame]]:
    reports = [sim.step(fields=n == steps - 1) for n in range(steps)]
    return reports, sim.frames()


def same(one: Frame, other: Frame) -> bool:
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in FIELDS)


def parts(report: StepReport) -> dict[str, object]:
    """All but the wall time."""
    return {name: replace(part, seconds=0.0) for name, part in report.parts.items()}


@pytest.mark.parametrize("asked", [(), ("peak_von_mises", "sag", "constraint_residual")])
def test_bodies_of_a_pile_are_as_if_each_had_a_solver_of_its_own(
    asked: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Positions, stress, quantities and each body's energies to the bit; sums over bodies to rounding. Tools touch one
    of them, whose substeps are other than the others'."""
    scene = unlike(quantities=asked)
    together = simulation(scene)
    assert together.parts == {"pile.pbd"}
    monkeypatch.setattr("softseam_services.orchestrator.bodies.piles_of", lambda *given: {})
    apart = simulation(scene)
    assert apart.parts == {f"{name}.far" for name in scene.bodies}
    assert together.expected_steps is not None
    (reports, frames), (alone, others) = (run(sim, together.expected_steps + 3) for sim in (together, apart))
    assert together.done and max(report.quantities["held.grip_force"] for report in reports) > 1.0
    assert len({part.substeps for part in reports[-1].parts.values()}) > 2
    for one, other in zip(reports, alone, strict=True):
        assert one.quantities == other.quantities and parts(one) == parts(other)
        for name, energy in other.energy.items():
            assert one.energy[name] == pytest.approx(energy, rel=1e-9, abs=1e-13), name
        np.testing.assert_allclose(one.wrench, other.wrench, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(one.momentum, other.momentum, rtol=1e-12, atol=1e-14)
    for name in scene.bodies:
        assert same(frames[name], others[name])
    assert [(event.kind, event.message) for event in together.events] == [
        (event.kind, event.message) for event in apart.events
    ]
    together.close()
    apart.close()


def test_the_ground_carries_all_of_them() -> None:
    sim = simulation(cubes(9, duration=2.0))
    reports, _ = run(sim, 350)
    assert reports[-1].wrench[0, 2] == pytest.approx(-9.0 * WEIGHT, rel=2e-3)
    assert len(reports[-1].parts) == 9 and reports[-1].penetration < 1e-4
    sim.close()


def test_a_snapshot_continues_bit_for_bit() -> None:
    first, second = simulation(unlike()), simulation(unlike())
    run(first, 12)
    state = first.save()
    second.load(state)
    (went_on, one), (resumed, other) = run(first, 12), run(second, 12)
    assert all(same(one[name], other[name]) for name in one)
    assert [report.quantities for report in went_on] == [report.quantities for report in resumed]
    assert [report.energy for report in went_on] == [report.energy for report in resumed]
    with pytest.raises(ArchiveError, match="another scene"):
        simulation(cubes(2)).load(state)
    second.reset()
    again, _ = run(second, 3)
    assert again[-1].header.step == 2


class Losing(EmbeddedTransport):
    """Loses the pile's answer to an Advance of a step, once, after it was taken."""

    at = -1

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        replies = super().exchange(requests)
        for part, request in requests.items():
            if isinstance(request, Advance) and request.header.step == self.at and part == "pile.pbd":
                self.at = -1
                raise ParticipantLost(part, "the cable was cut")
        return replies

    def wait_alive(self, participant: str, timeout: float) -> bool:
        return False


def test_where_the_pile_cannot_take_a_step_no_body_has() -> None:
    """One of the bodies is FEM's, beside the pile; the step is then taken by all, and is what it would have been."""
    bodies = {f"cube{at}": cube(at, 2) for at in range(3)}
    bodies["cube1"]["regions"] = {"default": "fem"}
    scene, ends = scene_of(bodies), []
    for fails in (False, True):
        transport = Losing()
        sim = simulation(scene, transport)
        for n in range(15):
            if fails and n == 8:
                transport.at = n
                with pytest.raises(ParticipantLost):
                    sim.step()
                assert sim.time == pytest.approx(0.005 * n)
            assert sim.step(fields=n == 14).header.step == n
        assert {part.model for part in sim.report.parts.values()} == {"fem", "pbd"} if sim.report else False
        ends.append(sim.frames())
    assert all(same(ends[0][name], ends[1][name]) for name in bodies)


def test_bodies_that_sleep_are_asked_for_nothing_and_wake_with_the_same_bits() -> None:
    """Three of four fall asleep as they come to rest, and stand in reports as they stood; a snapshot keeps them so."""
    bodies = {f"cube{at}": cube(at, 2) for at in range(4)}
    bodies["cube3"] |= {"position": [0.1, 0.1, 0.4]}
    scene = scene_of(bodies, sleep="calm", duration=2.0)
    sim, other = simulation(scene), simulation(scene)
    reports: list[StepReport] = []
    while len(reports) < 300 and sum(part.iterations == 0 for part in sim.step().parts.values()) < 3:
        assert sim.report is not None
        reports.append(sim.report)
    assert sim.report is not None
    asleep = {name for name, part in sim.report.parts.items() if part.iterations == 0}
    assert len(asleep) >= 3
    state = sim.save()
    other.load(state)
    (went_on, one), (resumed, two) = run(sim, 20), run(other, 20)
    assert [report.energy for report in went_on] == [report.energy for report in resumed]
    assert [report.quantities for report in went_on] == [report.quantities for report in resumed]
    assert all(same(one[name], two[name]) for name in bodies)
    for report in went_on:
        assert report.wrench[0, 2] == pytest.approx(-4.0 * WEIGHT, rel=0.3) or "cube3.far" not in asleep


class Encoded(EmbeddedTransport):
    """Sends every message through its bytes, as on a bus."""

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        sent = {part: decode(encode(request), type(request)) for part, request in requests.items()}
        return {part: decode(encode(reply), type(reply)) for part, reply in super().exchange(sent).items()}


def test_its_messages_lose_no_bit() -> None:
    """With fields in every step, a snapshot and a restore in between, and bodies that sleep at the end."""
    ends = []
    for transport in (EmbeddedTransport(), Encoded()):
        sim = simulation(cubes(3, sleep="calm"), transport)
        reports = [sim.step(fields=True) for _ in range(20)]
        sim.load(sim.save())
        reports += [sim.step() for _ in range(99)]
        ends.append((reports, sim.frames()))
    (one, frames), (other, others) = ends
    assert [report.energy for report in one] == [report.energy for report in other]
    assert [report.quantities for report in one] == [report.quantities for report in other]
    assert all(same(frames[name], others[name]) for name in frames)


def test_what_is_no_pile_is_refused() -> None:
    """A model that takes one body a part; a snapshot of other bodies, which changes nothing."""
    bundle = bundle_scene(cubes(2))
    transport, header = EmbeddedTransport(), Header(SCHEMA_VERSION, "refused", "pile.fem", 0, 0, 0, 0.0)
    none, names = np.zeros(0, dtype=np.int32), ["cube0", "cube1"]
    with pytest.raises(ParticipantFailed, match="one body a part"):
        transport.exchange({"pile.fem": Configure(header, bundle, "fem", none, none, bodies=names)})
    transport.exchange({"pile": Configure(header, bundle, "pbd", none, none, bodies=names)})
    taken = transport.exchange({"pile": Snapshot(header)})["pile"]
    assert isinstance(taken, SnapshotTaken)
    for wrong in (taken.state[:-3], b"", taken.state.replace(b"pbd", b"xyz")):
        with pytest.raises(ParticipantFailed, match="snapshot"):
            transport.exchange({"pile": Restore(header, wrong)})
    again = transport.exchange({"pile": Snapshot(replace(header, exchange=1))})["pile"]
    assert isinstance(again, SnapshotTaken) and again.state == taken.state


def test_another_scene_takes_the_pile_over() -> None:
    """Another number of bodies in the same part; then one body, which is no pile, and the part is let go."""
    transport = EmbeddedTransport()
    sim = simulation(cubes(3), transport)
    run(sim, 4)
    for count in (4, 1, 2):
        sim = sim.with_scene(bundle_scene(cubes(count)))
        reports, frames = run(sim, 6)
        own = simulation(cubes(count))
        expected, others = run(own, 6)
        assert [parts(one) for one in reports] == [parts(one) for one in expected]
        assert all(same(frames[name], others[name]) for name in frames)
        own.close()
    sim.close()
