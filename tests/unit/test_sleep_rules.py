"""Rules of sleep and reasons to wake, which look at all bodies at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softseam_coupling.sleep import STRICT, TOLERANCES, Neighbourhood, calm, force_changed, neighbour_comes, tool_comes


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
        way=np.zeros((n, 2, 3)),
        weight=np.full(n, 10.0),
        load=np.full(n, 30.0),
        calm_steps=np.arange(n),
        asleep=np.ones(n, dtype=np.bool_),
        pairs=pairs,
        changed=np.zeros(n),
        tools=["ball"],
        position=np.array([[0.5, 0.5, 3.0]]),
        reach=np.array([0.2]),
        half=np.array([[0.2, 0.2, 0.2]]),
        moving=np.zeros(1, dtype=np.bool_),
        dt=0.005,
        tolerance=STRICT,
    )


def test_what_sleeps_has_no_reason() -> None:
    around = row_of(12)
    assert not tool_comes(around) and not neighbour_comes(around) and not force_changed(around)
    assert np.flatnonzero(calm(around)).tolist() == [8, 9, 10, 11]


def test_one_that_comes_wakes_those_that_it_comes_to() -> None:
    """If it is awake, not calm, and would be there within the step if it went on; what it leaves, and what is there
    already, has to feel it."""
    around = row_of(5)
    speed, asleep, way = around.speed.copy(), around.asleep.copy(), around.way.copy()
    speed[2], asleep[2], way[2, :, 0] = 0.03, False, 1.2e-4
    comes = replace(around, speed=speed, asleep=asleep, way=way)
    assert neighbour_comes(comes) == {3: "body2 moves beside body3"}
    assert not neighbour_comes(replace(comes, asleep=around.asleep))
    assert not neighbour_comes(replace(comes, way=0.8 * way))
    assert not neighbour_comes(replace(comes, speed=np.minimum(speed, 0.99 * STRICT.speed)))
    assert not neighbour_comes(replace(row_of(5, gap=-1e-6), speed=speed, asleep=asleep, way=way))


def test_a_tool_wakes_what_it_moves_near() -> None:
    around = replace(row_of(3), position=np.array([[1.4, 0.5, 1.15]]))
    assert not tool_comes(around)
    assert tool_comes(replace(around, moving=np.array([True]))) == {1: "ball moves near body1"}
    plane = replace(around, moving=np.array([True]), reach=np.array([np.inf]), half=np.full((1, 3), np.inf))
    assert sorted(tool_comes(plane)) == [0, 1, 2]


def test_a_force_that_changed_wakes_a_sleeper() -> None:
    changed = 10.0 * STRICT.force * np.array([0.99, 1.01, 2.0])
    around = replace(row_of(3), changed=changed, asleep=np.array([True, True, False]))
    assert list(force_changed(around)) == [1]


def test_a_wall_beside_which_a_tool_passes_is_as_thick_as_it_is() -> None:
    """A plate that moves above bodies wakes none, though the ball that holds it reaches into them."""
    around = replace(row_of(3), position=np.array([[1.5, 0.5, 1.15]]), reach=np.array([1.0]))
    wide = replace(around, moving=np.array([True]), half=np.array([[0.9, 0.4, 0.1]]))
    assert not tool_comes(wide)
    assert sorted(tool_comes(replace(wide, half=np.array([[0.9, 0.4, 0.2]])))) == [0, 1, 2]


def test_by_load_a_sleeper_may_feel_a_share_of_what_holds_it() -> None:
    """Of what presses it from all sides, which is more than its weight; so it sleeps after fewer steps."""
    changed = 30.0 * TOLERANCES["by_load"].force * np.array([0.99, 1.01, 0.1])
    around = replace(row_of(3), changed=changed, tolerance=TOLERANCES["by_load"])
    assert list(force_changed(around)) == [1]
    assert list(force_changed(replace(around, tolerance=STRICT))) == [0, 1, 2]
    steps = TOLERANCES["by_load"].steps
    assert calm(replace(around, calm_steps=np.array([steps - 1, steps, steps + 1]))).tolist() == [False, True, True]
