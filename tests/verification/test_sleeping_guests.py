"""A pile that bodies of FEM touch sleeps body by body, and so do these guests: each is an obstacle while it sleeps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cubes import EDGE
from trays import MASS, awake, gripped, tray

import softseam
from softseam.observation import Observation
from softseam_protocol.scene.scene import Scene

WEIGHT = 9.81 * MASS
FEM: dict[str, Any] = {"regions": {"default": "fem"}}
_RULES: tuple[dict[str, Any], ...] = {"sleep": "calm"}, {}
"""with sleep, and without"""


def seen(of: Scene) -> list[Observation]:
    with softseam.open(of) as sim:
        sim.reset(seed=0)
        found = [sim.step()]
        while not found[-1].done:
            found.append(sim.step())
    return found


@pytest.fixture(scope="module")
def grips() -> list[list[Observation]]:
    """A cube of FEM that is gripped out of fifteen and lifted, with sleep and without."""
    return [seen(gripped((3, 5, 1), own={"cube120": FEM}, **keys)) for keys in _RULES]


def test_bystanders_sleep_while_a_guest_is_gripped(grips: list[list[Observation]]) -> None:
    """All sleep before, and as plates come down beside it without touching it; then some at the ends do in each step,
    the lifted one never. As it is held at last, those beside it at most are awake with it, and in the end none."""
    counts = [awake(one.report) for one in grips[0]]
    assert not counts[95]
    begins = next(n for n in range(100, 110) if counts[n])
    moved = counts[begins:170]
    assert all("cube120" in names and len(names) < 12 for names in moved)
    assert all(names <= {"cube110", "cube120", "cube130"} for names in counts[170:]) and not counts[-1]
    assert grips[0][-1].bodies["cube120"].positions[:, 2].min() > 0.025


def test_what_grips_a_guest_feels_as_without_sleep(grips: list[list[Observation]]) -> None:
    """Forces of the plates, along the grip and upwards, within .5 % of their largest in each step; so the ground's."""
    for tools, axis in ((("left",), 0), (("left", "right"), 2), (("ground",), 2)):
        force = np.array([[sum(one.wrench[tool][axis] for tool in tools) for one in each[100:]] for each in grips])
        assert np.abs(force[0] - force[1]).max() < 0.005 * np.abs(force[1]).max(), (tools, axis)


def test_no_step_with_sleeping_guests_makes_energy(grips: list[list[Observation]]) -> None:
    for before, one in zip(grips[0], grips[0][1:], strict=False):
        rise = sum(one.energies[key] - before.energies[key] for key in ("kinetic", "strain", "gravity"))
        assert rise <= one.energies["tool_work"] + 1e-8


def pressed(**keys: Any) -> Scene:
    """Two layers of two, of which the lower ones and one of the upper are of FEM; a plate presses the other, at 5 cm/s
    at first and then slowly."""
    plate = {"kind": "box", "size": [0.04, 0.04, 0.01], "position": [0, 0, 2.0 * EDGE + 0.01], "friction": 0.3}
    moves = (
        {"tools": ["plate"], "move": [0, 0, -way], "speed": speed} for way, speed in ((0.004, 0.05), (0.002, 2e-3))
    )
    own = dict.fromkeys(("cube000", "cube100", "cube101"), FEM)
    return tray((2, 1, 2), {"plate": plate}, own=own, motion=[{"hold": 0.5}, *moves], duration=None, **keys)


@pytest.fixture(scope="module")
def presses() -> list[Observation]:
    return seen(pressed(sleep="calm"))


def test_a_guest_below_wakes_by_what_presses_it(presses: list[Observation]) -> None:
    """It sleeps while its neighbour above is awake, and wakes as that presses it by a hundredth of its weight more; the
    ground feels in every step what it feels without sleep, to two hundredths of a weight."""
    found = [presses, seen(pressed())]
    said = [event.message for one in found[0] for event in one.events if event.kind == "sleep"]
    assert any("what presses cube000 changed by" in each for each in said), said
    asleep = next(n for n, one in enumerate(found[0]) if not awake(one.report))
    assert asleep < 100
    ground = np.array([[one.wrench["ground"][2] for one in each[100:]] for each in found])
    assert np.ptp(ground[1]) > WEIGHT
    assert np.abs(ground[0] - ground[1]).max() < 0.02 * WEIGHT
    upper = [awake(one.report) for one in found[0][100:]]
    assert {"cube001"} in upper and any("cube000" in names for names in upper)
    still = found[0][99]
    assert -still.wrench["ground"][2] == pytest.approx(4.0 * WEIGHT, rel=1e-2)


def test_it_goes_on_with_the_same_bits_while_some_sleep(presses: list[Observation]) -> None:
    """From snapshots taken as all move, as they fall asleep, while all sleep, just before a tool wakes one, while some
    sleep, and just before a guest wakes within a step."""
    before = [awake(one.report) for one in presses]
    comes, wakes = (n for n in range(101, len(before)) if len(before[n]) > len(before[n - 1]))
    starts = 3, before.index({"cube100"}), 60, comes - 2, comes + 1, wakes - 1
    assert not before[60] and before[comes + 1] == {"cube001"} and before[wakes] == {"cube000", "cube001"}
    with softseam.open(pressed(sleep="calm")) as sim:
        sim.reset(seed=0)
        first, kept = [], {}
        for n in range(len(before)):
            if n in starts:
                kept[n] = sim.snapshot()
            first.append(sim.step())
        for at, state in kept.items():
            sim.restore(state)
            for one in first[at : at + 12]:
                again = sim.step()
                assert again.energies == one.energies and again.report.interfaces == one.report.interfaces
                np.testing.assert_array_equal(again.report.wrench, one.report.wrench)
                assert [event.message for event in again.events] == [event.message for event in one.events]
                for name, body in one.bodies.items():
                    np.testing.assert_array_equal(again.bodies[name].positions, body.positions)
