"""Bodies that interfaces join: they rest on one another, swing, spin, and their steps are taken by all or by none."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import joining
import numpy as np
import pytest
from joining import EDGE, WEIGHT, tower

import softseam
from softseam_protocol.messages.participant import Advance, Reply, Request
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.interfaces import INTERFACES
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.archive import ArchiveError, pack, unpack
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantLost

PAIRS = [("fem", "fem"), ("fem", "pbd"), ("pbd", "fem"), ("pbd", "pbd")]


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    with joining.added():
        yield


def run(scene: Scene, transport: EmbeddedTransport | None = None) -> list[StepReport]:
    """All its steps."""
    simulation = Simulation(bundle_scene(scene, {}), transport or EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(simulation.step())
    simulation.close()
    return reports


@pytest.mark.parametrize("models", PAIRS)
@pytest.mark.parametrize("lift", [0.0, 0.004])
def test_the_table_carries_both_cubes(models: tuple[str, str], lift: float) -> None:
    """At rest, to 1e-9; the lower carries the upper, to 1e-9; a cube that falls on the other bounces, and is held."""
    reports = run(tower(models, lift))
    last = reports[-1]
    assert last.wrench[0, 2] == pytest.approx(-2.0 * WEIGHT, rel=1e-9)
    on = [report.interfaces["on_cube0"] for report in reports]
    assert max(each.gap for each in on) < 1e-3 * EDGE / 2
    assert np.mean([each.exchanges for each in on]) < 1.2
    assert on[-1].n_nodes == 25 and on[-1].force > WEIGHT / 25
    assert last.momentum == pytest.approx([0, 0, 0], abs=1e-6)


def test_a_tower_of_three_models_carries_itself() -> None:
    """Three cubes in one island, which is computed from two interfaces: 3 weights on the table, 2 and 1 above."""
    models = ("fem", "pbd", "fem")
    simulation = Simulation(bundle_scene(tower(models, 0.001), {}), EmbeddedTransport())
    while not simulation.done:
        report = simulation.step()
    assert report.wrench[0, 2] == pytest.approx(-3.0 * WEIGHT, rel=1e-8)
    works = [report.interfaces[name].work for name in ("on_cube0", "on_cube1")]
    assert np.abs(works).max() < 1e-9
    simulation.close()


@pytest.mark.parametrize("models", PAIRS)
def test_rows_that_come_and_go_change_nothing(models: tuple[str, str]) -> None:
    """A cube falls on another, bounces and falls again: rows of nodes that are away would be open, so it goes as with
    all of them, to what loops leave; and from a snapshot taken while there are none, the same bits."""
    every, near = (tower(models, 0.004, {"kind": kind}, duration=0.15) for kind in ("rest", "near"))
    reports = {"rest": run(every), "near": run(near)}
    seen = [report.interfaces["on_cube0"] for report in reports["near"]]
    counts = [each.n_nodes for each in seen]
    assert counts[0] == 0 and max(counts) == 25 and counts.index(25) > 2
    wrench = {kind: np.array([report.wrench[0, 2] for report in own]) for kind, own in reports.items()}
    np.testing.assert_allclose(wrench["near"], wrench["rest"], atol=2e-3 * np.abs(wrench["rest"]).max())
    with softseam.open(near) as sim:
        sim.reset(seed=0)
        kept = sim.snapshot()
        first = [sim.step() for _ in range(20)]
        late = sim.snapshot()
        after = [sim.step() for _ in range(4)]
        sim.restore(kept)
        again = [sim.step() for _ in range(20)]
        sim.restore(late)
        later = [sim.step() for _ in range(4)]
    for one, other in zip([*first, *after], [*again, *later], strict=True):
        for name in ("cube0", "cube1"):
            np.testing.assert_array_equal(one.bodies[name].positions, other.bodies[name].positions)


def test_nothing_pulls() -> None:
    """A cube that is thrown up leaves at once, and flies as one that is alone."""
    scene = tower(("fem", "fem"), duration=0.1)
    thrown = scene.many["cube1"].model_copy(update={"velocity": (0.0, 0.0, 1.0)})
    reports = run(scene.with_body(thrown, "cube1"))
    assert max(report.interfaces["on_cube0"].force for report in reports) == 0.0
    alone = scene.model_copy(update={"many": {"cube1": thrown}, "joints": {}, "tools": {}})
    free = run(alone)
    flown = [each[-1].parts["cube1.far"].gravity for each in (reports, free)]
    assert flown[0] == pytest.approx(flown[1], rel=1e-9)


def test_what_interfaces_do_stands_in_the_ledger() -> None:
    """Each step: what kinetic, strain and gravity energy change by is the work of tools and interfaces, less what is
    dissipated; a spring gives what it took."""
    spring = {"kind": "spring", "stiffness": 50.0}
    reports = run(tower(("fem", "pbd"), 0.01, spring, gravity=[0, 0, 0], tools={}, step=5e-4, duration=0.04))
    energies = [report.energy for report in reports]
    total = np.array([sum(each[name] for name in ("kinetic", "strain", "gravity")) for each in energies])
    put = np.array([each["interface_work"] - each["dissipation"] for each in energies])
    np.testing.assert_allclose(np.diff(total), put[1:], atol=1e-12)
    first, last = 0.5 * 50.0 * 0.01**2, 0.5 / 50.0 * reports[-1].interfaces["on_cube0"].force ** 2
    given = sum(each["interface_work"] for each in energies)
    assert given == pytest.approx(first - last, rel=0.1)  # a spring of implicit Euler gives less than it took
    assert given < first - last
    assert sum(report.interfaces["on_cube0"].work for report in reports) == pytest.approx(given, rel=1e-6)


@pytest.mark.parametrize("models", PAIRS)
def test_each_body_keeps_its_spin(models: tuple[str, str]) -> None:
    """Joined by next to nothing: angular momentum of 12 rad/s to 1e-6 in a second at 10 ms."""
    spring = {"kind": "spring", "stiffness": 1e-6}
    scene = tower(models, 0.02, spring, gravity=[0, 0, 0], tools={}, step=0.01, duration=1.0)
    many = {name: body.model_copy(update={"spin": (0.0, 12.0, 3.0)}) for name, body in scene.many.items()}
    reports = run(scene.model_copy(update={"many": many}))
    size = float(np.linalg.norm(reports[0].angular_momentum))
    drift = np.array([report.angular_momentum - reports[0].angular_momentum for report in reports])
    assert np.abs(drift).max() < 1e-6 * size


class Failing(EmbeddedTransport):
    """Loses a part for good, or fails in it, once it is asked for a step a second time in the same step."""

    def __init__(self, part: str, step: int, error: type[Exception]) -> None:
        super().__init__()
        self.part, self.at, self.error, self.armed = part, step, error, True

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        asked = requests.get(self.part)
        if self.armed and isinstance(asked, Advance) and asked.header.step == self.at:
            self.armed = False
            raise self.error(*((self.part, "the cable was cut") if self.error is ParticipantLost else ("it fails",)))
        return super().exchange(requests)

    def wait_alive(self, participant: str, timeout: float) -> bool:
        return False


@pytest.mark.parametrize("part", ["cube1.far", "lone.far"])
def test_a_step_that_fails_is_taken_by_none(part: str) -> None:
    """Of the island, or of a body beside it: the next try goes on as if nothing had been."""
    scene = tower(("fem", "pbd"), 0.002)
    block = json.loads(scene.many["cube0"].model_dump_json())
    lone = block | {"position": [0.2, 0, 0], "regions": {"default": "fem"}}
    data: dict[str, Any] = json.loads(scene.model_dump_json())
    for order in (0, 1):
        items = list((data["bodies"] | {"lone": lone}).items())
        both = Scene.model_validate(data | {"bodies": dict(items if order else items[::-1])})
        transport = Failing(part, 7, StepFailed)
        simulation = Simulation(bundle_scene(both, {}), transport)
        for _ in range(7):
            simulation.step()
        with pytest.raises(StepFailed, match="it fails"):
            simulation.step()
        after = [simulation.step() for _ in range(5)]
        simulation.close()
        wanted = run(both)[7:12]
        for one, other in zip(after, wanted, strict=True):
            assert one.energy == other.energy
            np.testing.assert_array_equal(one.wrench, other.wrench)


def test_snapshots_and_bodies_in_any_order_change_no_bit() -> None:
    scene = tower(("fem", "pbd"), 0.002)
    with softseam.open(scene) as sim:
        sim.reset(seed=0)
        for _ in range(20):
            sim.step()
        kept = sim.snapshot()
        after = [sim.step() for _ in range(10)]
        sim.restore(kept)
        again = [sim.step() for _ in range(10)]
    for one, other in zip(after, again, strict=True):
        assert one.energies == other.energies
        for name in ("cube0", "cube1"):
            np.testing.assert_array_equal(one.bodies[name].positions, other.bodies[name].positions)
    with softseam.open(scene.model_copy(update={"joints": {}})) as apart, pytest.raises(softseam.BadSnapshot):
        apart.restore(kept)


REFUSED = {
    "no body": ({"between": ["cube1", "cup"]}, r"no body is called 'cup'; the scene has: cube0, cube1"),
    "itself": ({"between": ["cube1", "cube1"]}, "a body meets another one here"),
    "kind": ({"kind": "rset"}, "rset|rest"),
    "key": ({"stiffness": 3}, "stiffness"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_joined_is_refused(case: str) -> None:
    changes, words = REFUSED[case]
    data = json.loads(tower(("fem", "fem")).model_dump_json())
    data["interfaces"]["on_cube0"] |= changes
    with pytest.raises(ValueError, match=words):
        Scene.model_validate(data)


def test_a_body_in_two_models_or_of_particles_is_refused() -> None:
    data = json.loads(tower(("fem", "fem")).model_dump_json())
    cut = {"default": "pbd", "near": {"model": "fem", "within": 0.01}}
    data["bodies"]["cube0"]["regions"] = cut
    with pytest.raises(ValueError, match="'cube0' is cut in two models, which interfaces do not join yet"):
        Scene.model_validate(data)
    sheet = {"kind": "sheet", "size": [0.1, 0.1], "divisions": [4, 4], "density": 0.1, "stretch": 100}
    data["bodies"]["cube0"] = sheet
    with pytest.raises(ValueError, match="'cube0' is made of particles, which have no faces"):
        Scene.model_validate(data)


def test_an_interface_on_clamped_nodes_is_refused() -> None:
    """The kind leaves them out; where nothing is left, or it does not, the scene is refused by name."""
    data = json.loads(tower(("fem", "fem")).model_dump_json())
    data["bodies"]["cube0"]["fixed"] = [{"min": [-1, -1, EDGE - 1e-6], "max": [1, 1, 1]}]
    with pytest.raises(softseam.SceneRefused, match=r"interfaces.on_cube0: it acts on no node of 'cube0'"):
        softseam.open(Scene.model_validate(data))


def test_a_kind_that_makes_no_rows_fails_at_start() -> None:
    INTERFACES.add("forgotten", joining.RestSpec)
    try:
        with pytest.raises(softseam.BadInput, match="table of interfaces: no row 'forgotten'"):
            softseam.open(tower(("fem", "fem")))
    finally:
        INTERFACES.remove("forgotten")


@pytest.mark.parametrize("models", PAIRS)
def test_bodies_that_swing_about_one_another_keep_their_turning(models: tuple[str, str]) -> None:
    """At 15 rad/s about one another, beside spins of their own: angular momentum to 1e-6 in a second at 10 ms."""
    spring = {"kind": "spring", "stiffness": 200.0}
    scene = tower(models, 0.0, spring, gravity=[0, 0, 0], tools={}, step=0.01, duration=1.0)
    moves = {"cube0": (-0.3, 0.0, 0.0), "cube1": (0.3, 0.0, 0.0)}
    many = {
        name: body.model_copy(update={"spin": (0.0, 12.0, 3.0), "velocity": moves[name]})
        for name, body in scene.many.items()
    }
    reports = run(scene.model_copy(update={"many": many}))
    size = float(np.linalg.norm(reports[0].angular_momentum))
    drift = np.array([report.angular_momentum - reports[0].angular_momentum for report in reports])
    assert np.abs(drift).max() < 1e-6 * size


def test_a_state_that_is_refused_changes_nothing() -> None:
    """Of bodies that sleep, with tools of another scene: refused last of all, it leaves those that move awake, and the
    run goes on with the same bits."""
    bundle = bundle_scene(tower(("fem", "pbd"), 0.002, sleep="calm"), {})
    one, other = Simulation(bundle, EmbeddedTransport()), Simulation(bundle, EmbeddedTransport())
    while one.step().parts["cube0.far"].iterations:
        pass
    broken = pack(unpack(one.save()) | {"drives": np.zeros((7, 3))})
    for simulation in (one, other):
        simulation.reset()
        for _ in range(6):
            simulation.step()
    with pytest.raises(ArchiveError):
        one.load(broken)
    for _ in range(5):
        mine, wanted = one.step(), other.step()
        assert mine.energy == wanted.energy and mine.parts["cube0.far"].iterations
        np.testing.assert_array_equal(mine.wrench, wanted.wrench)
