"""Rules of sleep and reasons to wake, which look at all bodies at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softseam_coupling.sleep import CALM, STEADY, Neighbourhood, calm, force_changed, neighbour_comes, tool_comes


def row_of(n: int, gap: float = 1e-4) -> Neighbourhood:
    """Unit boxes in a row that sleep, and a ball far away that stands still."""
    low = np.zeros((n, 3))
    low[:, 0] = (1.0 + gap) * np.arange(n)
    pairs = np.stack((np.arange(n - 1), np.arange(1, n)), axis=1)
    return Neighbourhood(
        names=[f"body{k}" for k in range(n)],
        kinetic=np.zeros(n),
        speed=np.zeros(n),
        low=low,
        high=low + 1.0,
        weight=np.full(n, 10.0),
        calm_steps=np.arange(n),
        asleep=np.ones(n, dtype=np.bool_),
        pairs=pairs,
        changed=np.zeros(n),
        tools=["ball"],
        position=np.array([[0.5, 0.5, 3.0]]),
        reach=np.array([0.2]),
        moving=np.zeros(1, dtype=np.bool_),
        dt=0.005,
    )


def test_what_sleeps_has_no_reason() -> None:
    around = row_of(12)
    assert not tool_comes(around) and not neighbour_comes(around) and not force_changed(around)
    assert np.flatnonzero(calm(around)).tolist() == [8, 9, 10, 11]


def test_one_that_moves_wakes_those_beside_it() -> None:
    """If it is awake, not calm, and as near as it goes in a step."""
    around = row_of(5)
    speed, asleep = around.speed.copy(), around.asleep.copy()
    speed[2], asleep[2] = 0.03, False
    assert neighbour_comes(replace(around, speed=speed, asleep=asleep)) == {
        1: "body2 moves beside body1",
        3: "body2 moves beside body3",
    }
    assert not neighbour_comes(replace(around, speed=speed))
    assert not neighbour_comes(replace(row_of(5, gap=2e-4), speed=speed, asleep=asleep))
    assert not neighbour_comes(replace(around, speed=np.minimum(speed, 0.99 * CALM), asleep=asleep))


def test_a_tool_wakes_what_it_moves_near() -> None:
    around = replace(row_of(3), position=np.array([[1.4, 0.5, 1.15]]))
    assert not tool_comes(around)
    assert tool_comes(replace(around, moving=np.array([True]))) == {1: "ball moves near body1"}
    plane = replace(around, moving=np.array([True]), reach=np.array([np.inf]))
    assert sorted(tool_comes(plane)) == [0, 1, 2]


def test_a_force_that_changed_wakes_a_sleeper() -> None:
    changed = 10.0 * STEADY * np.array([0.99, 1.01, 2.0])
    around = replace(row_of(3), changed=changed, asleep=np.array([True, True, False]))
    assert list(force_changed(around)) == [1]
