"""Bodies that sleep: what they carry stands, nothing is asked of them, and what wakes them finds them as they were."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import joining
import numpy as np
import pytest
from joining import EDGE, WEIGHT, tower

import softseam
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.scene.scene import Scene

PLATE = {"kind": "box", "size": [0.06, 0.06, 0.01], "position": [0, 0, 2 * EDGE + 0.03], "friction": 0.3}


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    with joining.added():
        yield


def pressed(**keys: Any) -> Scene:
    """A tower of two, which has a second to come to rest before a plate comes down on it."""
    motion = [{"hold": 1.0}, {"tools": ["plate"], "move": [0, 0, -0.03], "speed": 0.1}, {"hold": 0.1}]
    tools = {"table": {"kind": "plane", "friction": 0.5}, "plate": PLATE}
    return tower(("fem", "pbd"), 0.001, tools=tools, motion=motion, duration=None, **keys)


def test_a_tower_sleeps_and_wakes_when_a_plate_comes() -> None:
    """Asleep it costs nothing and the table carries it; the plate's force at the end is that of a run without sleep, to
    .1 %: it slept at less than 1 mm/s."""
    found = {}
    for rule in ("calm", None):
        with softseam.open(pressed(sleep=rule)) as sim:
            sim.reset(seed=0)
            seen = []
            while not sim.done:
                seen.append(sim.step())
        found[rule] = seen
    asleep = [sum(part.iterations for part in one.parts.values()) == 0 for one in found["calm"]]
    (woke,) = (event for one in found["calm"] for event in one.events if event.kind == EventKind.SLEEP)
    assert "cube0, cube1: plate moves near cube1" in woke.message
    first, last = asleep.index(True), woke.header.step
    assert first < 190 < 200 <= last < 260 and all(asleep[first:last]) and not any(asleep[last : last + 10])
    for one in found["calm"][first:last]:
        assert -one.wrench["table"][2] == pytest.approx(2.0 * WEIGHT, rel=1e-3)
        assert abs(one.energies["dissipation"]) < 1e-12 and one.report.interfaces["on_cube0"].work == 0.0
    pressed_by = [found[rule][-1].wrench["plate"][2] for rule in found]
    assert pressed_by[0] > 1.0 and pressed_by[0] == pytest.approx(pressed_by[1], rel=1e-3)


def test_a_snapshot_of_what_sleeps_goes_on_with_the_same_bits() -> None:
    with softseam.open(pressed(sleep="calm")) as sim:
        sim.reset(seed=0)
        while sum(part.iterations for part in sim.step().parts.values()):
            pass
        kept = sim.snapshot()
        after = [sim.step() for _ in range(240)]
        sim.restore(kept)
        again = [sim.step() for _ in range(240)]
    assert any(event.kind == EventKind.SLEEP for one in after for event in one.events)
    for one, other in zip(after, again, strict=True):
        assert one.energies == other.energies and one.quantities == other.quantities
        for name in ("cube0", "cube1"):
            np.testing.assert_array_equal(one.bodies[name].positions, other.bodies[name].positions)
    with softseam.open(pressed()) as awake, pytest.raises(softseam.BadSnapshot):
        awake.restore(kept)


def test_what_moves_does_not_sleep() -> None:
    """A block that falls, and one that spins, have speed; a block that a tool moves near is kept awake."""
    free = tower(("fem",), tools={}, sleep="calm", duration=0.3)
    spun = {name: body.model_copy(update={"spin": (0.0, 0.0, 3.0)}) for name, body in free.many.items()}
    for one in (free, free.model_copy(update={"gravity": (0.0, 0.0, 0.0), "many": spun})):
        with softseam.open(one) as sim:
            sim.reset(seed=0)
            while not sim.done:
                assert all(part.iterations for part in sim.step().parts.values())


def test_a_rule_that_is_not_there_is_named() -> None:
    with pytest.raises(
        softseam.SceneRefused, match=r"sleep: table of rules of sleep: no row 'clam'; did you mean 'calm'"
    ):
        softseam.open(tower(("fem",), sleep="clam"))
