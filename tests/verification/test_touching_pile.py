"""A pile whose bodies touch: it rests, sleeps, wakes and is restored; who touches nothing is as without contact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from cubes import EDGE, FIRM, SOFT, cube, piled, scene_of

import softseam
from softseam_services.pbd.fours import Built, fours_of
from softseam_services.pbd.kernels.fours import Fours

MASS = 1000.0 * EDGE**3


def test_a_pile_of_eight_rests() -> None:
    """The ground carries the weights to 1e-9, kinetic energy is below 1e-12 m g h and nothing moves by 1e-12 m."""
    with softseam.open(piled(2, 2)) as sim:
        sim.reset(seed=0)
        seen = [sim.step() for _ in range(200)]
    still = seen[-1]
    assert len(still.report.interfaces) == 12
    assert -still.wrench["ground"][2] == pytest.approx(8.0 * MASS * 9.81, rel=1e-9)
    assert still.energies["kinetic"] < 1e-12 * MASS * 9.81 * EDGE
    for name, body in still.bodies.items():
        assert np.abs(body.positions - seen[-20].bodies[name].positions).max() < 1e-12


def test_what_a_landing_gains_is_paid_for_as_long_as_it_lasts() -> None:
    """Two soft cubes that land take shorter substeps, and those that are planned once they have settled down; the
    ground bears their weight, in the mean of steps to rounding."""
    with softseam.open(piled(1, 2, 1, material=SOFT)) as sim:
        sim.reset(seed=0)
        seen = [sim.step() for _ in range(60)]
    substeps = [max(part.substeps for part in one.report.parts.values()) for one in seen]
    planned = substeps[0]
    assert max(substeps[:10]) > planned and substeps[30:] == [planned] * 30
    force = np.mean([one.wrench["ground"] for one in seen[30:]], axis=0)
    speeds = [np.array(one.report.momentum) for one in (seen[29], seen[-1])]
    weight = 2.0 * 1050.0 * EDGE**3 * 9.81
    assert -force[2] == pytest.approx(weight + (speeds[1] - speeds[0])[2] / (30 * 0.005), rel=1e-9)


def test_a_pile_of_eight_sleeps_and_wakes() -> None:
    """Until a ball comes near three of its bodies, and presses; those wake the others, one after the other."""
    ball = {"kind": "sphere", "radius": 0.01, "position": [0.03, 0.03, 0.18]}
    tools = {"ground": {"kind": "plane", "friction": 0.5}, "ball": ball}
    motion = [{"hold": 1.0}, {"tools": ["ball"], "move": [0, 0, -0.075], "speed": 0.5}]
    scene = piled(2, 2, sleep="calm", tools=tools, motion=motion)
    with softseam.open(scene.model_copy(update={"duration": 1.3})) as sim:
        sim.reset(seed=0)
        still = [sim.step() for _ in range(199)][-1]
        later = [sim.step() for _ in range(60)]
    worked = [one.report.parts["cube000.far"].iterations for one in (still, *later)]
    assert worked[0] == 0 < max(worked)
    assert -still.wrench["ground"][2] == pytest.approx(8.0 * MASS * 9.81, rel=1e-6)
    events = [event.message for one in later for event in one.events if event.kind == "sleep"]
    assert events[0].count("ball moves near") == 3 and "cube000" not in events[0]
    assert all(any(f"{name}: " in event for event in events) for name in still.bodies)
    assert abs(later[-1].wrench["ball"][2]) > 1e-3


def test_bodies_that_do_not_touch_are_as_without_contact() -> None:
    """To the bit, though interfaces name them: beside a pair that does touch."""
    apart = {"free0": cube(1, 4), "free1": cube(2, 4, velocity=[0.0, 0.0, 0.1])}
    pair = {"low": cube(0, 4, position=[0.0, 0.0, 0.0]), "high": cube(0, 4, position=[0.01, 0.0, EDGE + 1e-4])}
    touch = {"kind": "contact"}
    with softseam.open(scene_of(pair | apart)) as sim:
        without = sim.run(max_steps=40, fields=True)
    named = {"a": touch | {"between": ["low", "high"]}, "b": touch | {"between": ["free0", "free1"]}}
    with softseam.open(scene_of(pair | apart, interfaces=named)) as sim:
        seen = sim.run(max_steps=40, fields=True)
    for name in apart:
        np.testing.assert_array_equal(seen.bodies[name].positions, without.bodies[name].positions)
    middles = [one.bodies["high"].positions[:, 2].mean() for one in (without, seen)]
    assert middles[0] < 1.4 * EDGE < middles[1] and seen.report.interfaces["b"].n_nodes == 0


def test_bodies_that_are_swept_four_at_a_time_have_their_own_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three rows of three cubes that tip over: six are alike but for one's density, two are stiffer, and one has more
    cells. To the bit as if each were swept by itself."""
    stiff, light = {"material": SOFT | {"young": 4.0e4}}, {"material": SOFT | {"density": 800.0}}
    own: dict[int, dict[str, Any]] = {0: stiff, 1: stiff, 2: {"cell": EDGE / 2}, 4: light}
    places = {f"cube{at}": [0.03 * (at % 3), 0.0502 * (at // 3), 0.001 + 0.0502 * (at % 3)] for at in range(9)}
    bodies = {name: cube(0, 1, 1, position=place) | own.get(at, {}) for at, (name, place) in enumerate(places.items())}
    touch = {f"{a}_{b}": {"kind": "contact", "between": [a, b]} for a in bodies for b in bodies if a < b}
    kinds = []

    def one_by_one(built: Sequence[Built]) -> Fours:
        kinds.append(fours_of(built).kind)
        return fours_of(built)._replace(kind=np.full(len(built), -1, dtype=np.int32))

    with softseam.open(scene_of(bodies, interfaces=touch)) as sim:
        found = sim.run(max_steps=30, fields=True)
    monkeypatch.setattr("softseam_services.pbd.pile_pieces.fours_of", one_by_one)
    with softseam.open(scene_of(bodies, interfaces=touch)) as sim:
        single = sim.run(max_steps=30, fields=True)
    assert {tuple(kind.tolist()) for kind in kinds} == {(0, 0, -1, 1, 1, 1, 1, 1, 1)}
    for name in bodies:
        np.testing.assert_array_equal(found.bodies[name].positions, single.bodies[name].positions)


def test_groups_come_and_go_with_the_same_bits() -> None:
    """Four that fall one on the other, saved before and while they touch."""
    bodies = {f"cube{k}": cube(0, 1, position=[2e-3 * k, 0.0, (EDGE + 0.01) * k], material=FIRM) for k in range(4)}
    touch = {f"t{k}": {"kind": "contact", "between": [f"cube{k}", f"cube{k + 1}"]} for k in range(3)}
    with softseam.open(scene_of(bodies, interfaces=touch)) as sim:
        sim.reset(seed=0)
        first, kept = [], []
        for _ in range(40):
            kept.append(sim.snapshot())
            first.append(sim.step())
        points = [tuple(report.n_nodes for report in one.report.interfaces.values()) for one in first]
        assert (0, 0, 0) in points and len({tuple(n > 0 for n in each) for each in points}) > 2
        for at in (3, 16, 30):
            sim.restore(kept[at])
            for one in first[at : at + 6]:
                again = sim.step()
                for name in bodies:
                    np.testing.assert_array_equal(again.bodies[name].positions, one.bodies[name].positions)
                assert again.report.interfaces == one.report.interfaces


def test_a_step_that_diverges_leaves_no_force_that_is_no_number() -> None:
    """A cube that comes so fast that its step overflows stays where it was, says so, and the pile can be stepped on."""
    low = cube(0, 4, position=[0.0, 0.0, 0.0])
    high = cube(0, 4, position=[0.01, 0.0, EDGE + 1e-4], velocity=[0.0, 0.0, -1e160])
    touch = {"touch": {"kind": "contact", "between": ["low", "high"]}}
    with softseam.open(scene_of({"low": low, "high": high}, interfaces=touch)) as sim:
        sim.reset(seed=0)
        seen = [sim.step() for _ in range(3)]
    assert any("diverged" in event.message for one in seen for event in one.events)
    for one in seen:
        report = one.report.interfaces["touch"]
        assert np.isfinite([report.gap, report.force, report.work]).all()
