"""Bodies of a pile sleep one by one: a sleeper is an obstacle to what is awake, and only what is moved wakes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from cubes import EDGE, cube, scene_of
from trays import MASS, MATERIAL, awake, gripped, pressed, tray

import softseam
from softseam_coupling.sleep import SLEEP, WAKE, Mask, Neighbourhood
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

WEIGHT = 9.81 * MASS
RESTS = 100
"""steps in which a tray comes to rest and falls asleep"""
GROUND, PLATE = 0, 1
"""places of tools, by their names"""

_RULES: tuple[dict[str, Any], ...] = {"sleep": "calm"}, {}
"""with sleep, and without"""


def reports(of: Scene) -> list[StepReport]:
    with softseam.open(of) as sim:
        sim.reset(seed=0)
        seen = []
        while not sim.done:
            seen.append(sim.step().report)
    return seen


@pytest.fixture(scope="module")
def slept() -> list[StepReport]:
    """Of the tray that is pressed."""
    return reports(pressed(sleep="calm"))


def test_only_what_is_pressed_and_its_neighbours_wake(slept: list[StepReport]) -> None:
    """All sleep, and the ground carries their weights to 1e-6, though they swung a little as they fell asleep; the cube
    that is pressed bulges, and wakes the two beside it, and never one that is farther away. No step makes energy."""
    seen = slept
    asleep = next(n for n, one in enumerate(seen) if not awake(one))
    comes = next(n for n in range(asleep, len(seen)) if awake(seen[n]))
    assert asleep < RESTS <= comes
    for one in seen[asleep:comes]:
        assert -one.wrench[GROUND, 2] == pytest.approx(9.0 * WEIGHT, rel=1e-6)
    woken = set().union(*(awake(one) for one in seen[comes:]))
    assert woken == {"cube000", "cube100", "cube010"}
    assert awake(seen[comes]) == {"cube000"}
    assert not awake(seen[-1])
    for before, one in zip(seen[comes - 1 :], seen[comes:], strict=False):
        rise = sum(one.energy[key] - before.energy[key] for key in ("kinetic", "strain", "gravity"))
        assert rise <= one.energy["tool_work"] + 1e-9


def test_what_presses_is_as_without_sleep(slept: list[StepReport]) -> None:
    """The plate's force, within 1 % in every step, and the ground's as all came to rest again."""
    whole = reports(pressed())
    force = np.array([[one.wrench[PLATE, 2] for one in each] for each in (slept, whole)])
    assert np.abs(force[1]).max() > 3.0
    assert np.abs(force[0] - force[1]).max() < 0.01 * np.abs(force[1]).max()
    assert -slept[-1].wrench[:, 2].sum() == pytest.approx(9.0 * WEIGHT, rel=1e-6)


def test_a_tray_goes_on_with_the_same_bits_while_some_sleep() -> None:
    """From snapshots taken as all move, while all sleep, and while some do: positions, energies, contacts, events."""
    with softseam.open(pressed(sleep="calm")) as sim:
        sim.reset(seed=0)
        first, kept = [], []
        while not sim.done:
            kept.append(sim.snapshot())
            first.append(sim.step())
        some = [n for n, one in enumerate(first) if 0 < len(awake(one.report)) < 9]
        starts = [3, some[0], some[len(some) // 2], 150, next(n for n in some if n > 150) - 1, some[-3]]
        for at in starts:
            sim.restore(kept[at])
            for one in first[at : at + 12]:
                again = sim.step()
                assert again.energies == one.energies and again.quantities == one.quantities
                assert again.report.interfaces == one.report.interfaces
                np.testing.assert_array_equal(again.report.wrench, one.report.wrench)
                assert [event.message for event in again.events] == [event.message for event in one.events]
                for name, body in one.bodies.items():
                    np.testing.assert_array_equal(again.bodies[name].positions, body.positions)


def test_fields_are_each_bodys_own_while_some_sleep() -> None:
    """Frames that a step brings, and frames that are asked for after it, of all bodies."""
    one, other = (Simulation(bundle_scene(pressed(sleep="calm")), EmbeddedTransport()) for _ in range(2))
    compared = 0
    while not one.done:
        report = one.step(fields=True)
        other.step()
        if 0 < len(awake(report)) < 9:
            compared += 1
            for name, frame in other.frames().items():
                np.testing.assert_array_equal(one.frames()[name].x, frame.x)
    assert compared > 20


@contextmanager
def lower_sleeps() -> Iterator[None]:
    """A rule by which the body `lower` sleeps from the first step on, and nothing wakes it."""

    def rule(around: Neighbourhood) -> Mask:
        return np.array([name == "lower" for name in around.names])

    reasons = dict(WAKE)
    SLEEP.add("lower_sleeps", rule)
    for name in reasons:
        WAKE.remove(name)
    try:
        yield
    finally:
        SLEEP.remove("lower_sleeps")
        for name, reason in reasons.items():
            WAKE.add(name, reason)


def upon(tilt: float, friction: float, **keys: Any) -> Scene:
    """A cube upon one that sleeps; gravity is tilted [rad]."""
    hard = MATERIAL | {"young": 5e5, "retardation_time": 0.01}
    bodies = {
        "lower": cube(0, 1, position=[0, 0, 0], material=hard),
        "upper": cube(0, 1, position=[-0.004, 0, EDGE + 1e-5], material=hard),
    }
    touch = {"touch": {"kind": "contact", "between": ["upper", "lower"], "friction": friction}}
    gravity = [9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt)]
    return scene_of(bodies, interfaces=touch, gravity=gravity, tools={}, sleep="lower_sleeps", **keys)


def test_a_sleeper_is_an_obstacle() -> None:
    """What is put on it comes to rest, and it does not move nor do work; at 20 degrees friction of .5 holds the other
    to 5 um in a tenth of a second, and .2 lets it slide by a t^2/2 within 3 %."""
    slope = np.radians(20.0)
    with lower_sleeps():
        for tilt, friction, duration in ((0.0, 0.5, 0.5), (slope, 0.5, 0.3), (slope, 0.2, 0.15)):
            with softseam.open(upon(tilt, friction, duration=duration)) as sim:
                sim.reset(seed=0)
                seen = []
                while not sim.done:
                    seen.append(sim.step())
            lower = [one.bodies["lower"].positions for one in seen]
            way = np.array([one.bodies["upper"].positions[:, 0].mean() for one in seen])
            assert all(np.array_equal(each, lower[0]) for each in lower[2:])
            assert awake(seen[-1].report) == {"upper"}
            work = sum(one.report.interfaces["touch"].work for one in seen)
            assert work < 1e-12
            if not tilt:
                assert seen[-1].report.parts["upper.far"].kinetic < 1e-15
            elif friction == 0.5:
                assert abs(way[-1] - way[-20]) < 5e-6
            else:
                a, t = 9.81 * (np.sin(slope) - friction * np.cos(slope)), duration
                assert way[-1] + 0.004 == pytest.approx(0.5 * a * t * t, rel=0.03)


def test_a_slow_press_wakes_what_is_below() -> None:
    """At 1 mm/s nothing is fast: the lower of two wakes as the upper presses it by a hundredth of its weight more. The
    ground's force is that of the run without sleep, to less than two hundredths of a weight in every step."""
    plate = {"kind": "box", "size": [0.04, 0.04, 0.01], "position": [0, 0, 2.0 * EDGE + 0.01], "friction": 0.3}
    moves = ({"tools": ["plate"], "move": [0, 0, -way], "speed": speed} for way, speed in ((0.004, 0.1), (0.002, 1e-3)))
    motion = [{"hold": 0.4}, *moves]
    found = []
    for keys in _RULES:
        with softseam.open(tray((1, 1, 2), {"plate": plate}, motion=motion, duration=None, **keys)) as sim:
            sim.reset(seed=0)
            seen = []
            while not sim.done:
                seen.append(sim.step())
        found.append(seen)
    said = [event.message for one in found[0] for event in one.events if event.kind == "sleep"]
    assert any("cube001: plate moves near cube001" in each for each in said)
    assert any("what presses cube000 changed by" in each for each in said)
    assert not any("moves beside" in each for each in said)
    asleep = next(n for n, one in enumerate(found[0]) if not awake(one.report))
    ground = np.array([[one.wrench["ground"][2] for one in each[asleep + 20 :]] for each in found])
    assert np.abs(ground[0] - ground[1]).max() < 0.02 * WEIGHT
    assert np.ptp(ground[1]) > WEIGHT


@pytest.mark.parametrize("velocity", [(1.0, 0.0, 0.0), (0.0, 0.0, 0.3)])
def test_what_is_hit_wakes_before_it_is_hit(velocity: tuple[float, float, float]) -> None:
    """A cube that slides into one that sleeps, and one that falls on it: energy never rises, and both are within 25 um
    of where they are without sleep, until 8 steps after (then one rocks on the other, which is no measure)."""
    at = [-0.25, 0.01, 1e-4] if velocity[2] == 0.0 else [0.005, 0.01, 0.1]
    bodies = {
        "rests": cube(0, 1, position=[0, 0, 1e-5], material=MATERIAL),
        "comes": cube(0, 1, position=at, velocity=list(velocity), material=MATERIAL),
    }
    tools = {"ground": {"kind": "plane", "friction": 0.1}}
    touch = {"touch": {"kind": "contact", "between": ["comes", "rests"], "friction": 0.3}}
    found = []
    for keys in _RULES:
        with softseam.open(scene_of(bodies, interfaces=touch, tools=tools, duration=0.45, **keys)) as sim:
            sim.reset(seed=0)
            seen = []
            while not sim.done:
                seen.append(sim.step())
        found.append(seen)
    slept = [n for n, one in enumerate(found[0]) if awake(one.report) == {"comes"}]
    hit = next(n for n, one in enumerate(found[1]) if one.report.interfaces["touch"].force > 0.0)
    assert len([n for n in slept if n < hit]) > 10 and len(awake(found[0][hit].report)) == 2
    for one, other in zip(*(each[: hit + 8] for each in found), strict=True):
        for name, body in one.bodies.items():
            assert np.abs(body.positions - other.bodies[name].positions).max() < 2.5e-5
    energy = np.array([sum(one.energies[key] for key in ("kinetic", "strain", "gravity")) for one in found[0]])
    assert np.diff(energy).max() < 1e-9


def test_what_grips_feels_as_without_sleep() -> None:
    """One of fifteen that stand close is gripped and lifted past two others: forces of the plates, along the grip and
    upwards, and of the ground are those of the run without sleep within 1 % of their largest, in every step."""
    found = []
    for keys in _RULES:
        with softseam.open(gripped((3, 5, 1), **keys)) as sim:
            sim.reset(seed=0)
            seen = []
            while not sim.done:
                seen.append(sim.step())
        found.append(seen)
    counts = [len(awake(one.report)) for one in found[0]]
    assert min(counts) == 0 and 0 < max(counts[100:]) < 15
    for tools, axis in ((("left",), 0), (("left", "right"), 2), (("ground",), 2)):
        force = np.array([[sum(one.wrench[tool][axis] for tool in tools) for one in each[100:]] for each in found])
        assert np.abs(force[0] - force[1]).max() < 0.01 * np.abs(force[1]).max()
    assert found[0][-1].bodies["cube120"].positions[:, 2].min() > 0.025


SOFT: dict[str, Any] = {"young": 2e4, "poisson": 0.45, "density": 1050.0, "retardation_time": 0.01}
"""of which forces spread far, and swings last"""


def squeezed(**keys: Any) -> Scene:
    """Eighteen soft cubes in two layers, of which a plate presses the one in the middle of the upper layer by 2 mm."""
    plate = {"kind": "box", "size": [0.03, 0.03, 0.01], "position": [EDGE + 2e-4] * 2 + [0.11], "friction": 0.3}
    moves = (
        {"tools": ["plate"], "move": [0, 0, -way], "speed": speed} for way, speed in ((0.006, 0.05), (0.004, 0.02))
    )
    motion = [{"hold": 1.2}, *moves, {"hold": 0.2}]
    return tray((3, 3, 2), {"plate": plate}, material=SOFT, cells=1, motion=motion, duration=None, **keys)


def test_by_load_more_sleep_and_what_presses_is_within_some_hundredths() -> None:
    """Soft cubes fall asleep sooner, stay so until they are pressed, and fewer of them wake than by their weights; what
    the plate feels of them is off by less than a quarter of a weight in each step, and as it is held by 1 % of its
    largest; the ground carries all."""
    found = [reports(squeezed(**({"sleep": rule} if rule else {}))) for rule in ("by_load", "calm", "")]
    by_load, _, whole = found
    counts = [np.array([len(awake(one)) for one in each]) for each in found]
    first = [int(np.flatnonzero(each == 0)[0]) if (each == 0).any() else len(each) for each in counts]
    comes = next(n for n, one in enumerate(whole) if one.wrench[PLATE, 2] > 0.0)
    assert first[0] < min(first[1], comes) and not counts[0][first[0] : comes - 2].any()
    assert counts[0][comes:].mean() < 0.75 * counts[1][comes:].mean()
    force = np.array([[one.wrench[PLATE, 2] for one in each] for each in (by_load, whole)])
    most = np.abs(force[1]).max()
    weight = 18.0 * 9.81 * SOFT["density"] * EDGE**3
    assert most > 2.0 and np.abs(force[0] - force[1]).max() < 0.25 * weight / 18.0
    assert abs(force[0, -1] - force[1, -1]) < 0.02 * most
    assert -by_load[comes - 3].wrench[GROUND, 2] == pytest.approx(weight, rel=1e-6)


def test_by_load_it_goes_on_with_the_same_bits() -> None:
    """From a snapshot in which some sleep, and are about to wake."""
    with softseam.open(squeezed(sleep="by_load")) as sim:
        sim.reset(seed=0)
        first: list[softseam.Observation] = []
        kept: list[bytes] = []
        while not sim.done:
            kept.append(sim.snapshot() if len(first) % 5 == 0 else b"")
            first.append(sim.step())
        counts = [len(awake(one.report)) for one in first]
        some = [n for n in range(200, len(first) - 12, 5) if 0 < counts[n] < 18]
        for at in (some[0], some[len(some) // 2]):
            sim.restore(kept[at])
            for one in first[at : at + 12]:
                again = sim.step()
                assert again.energies == one.energies and again.report.interfaces == one.report.interfaces
                np.testing.assert_array_equal(again.report.wrench, one.report.wrench)
                assert [event.message for event in again.events] == [event.message for event in one.events]
