"""XPBD bodies whose stress relaxes: beside the point and its integrals, with FEM, with every joule found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pbd_run import PbdRun, block_scene
from relaxing import CASES, POISSON, TWO, YOUNG, Point, said

EDGE = 0.05
RAMP, SQUEEZE = 0.4, 0.25

Branches = tuple[tuple[float, float], ...]


def material(branches: Branches = TWO, **own: Any) -> dict[str, Any]:
    return {"young": YOUNG, "poisson": POISSON, "density": 10.0, "relaxation": said(branches)} | own


def plates(friction: float) -> dict[str, Any]:
    plate = {"kind": "box", "size": (0.01, 0.2, 0.2), "friction": friction}
    left, right = ({"position": (side * (0.5 * EDGE + 0.005), 0.0, 0.025)} for side in (-1.0, 1.0))
    return {"left": plate | left, "right": plate | right}


def cube(friction: float = 0.0, step: float = 0.01, cell: float = EDGE, pbd: Any = None, **own: Any) -> PbdRun:
    body = {"material": material(**own)}
    return PbdRun(block_scene(cell=cell, step=step, tools=plates(friction), body=body, pbd=pbd))


def squeezed(run: PbdRun, time: float) -> tuple[list[Any], list[float]]:
    """Replies of steps until this time, the ramp at first, and the stretch that the plates give the cube."""
    speed, replies, stretches, dt = 0.5 * SQUEEZE * EDGE / RAMP, [], [], run.scene.step
    for n in range(int(time / dt + 0.5)):
        closing = speed if (n + 0.5) * dt < RAMP else 0.0
        run.velocity[0, 0], run.velocity[1, 0] = closing, -closing
        replies.append(run.step())
        stretches.append(float(np.ptp(run.solver.committed.x[:, 0])) / EDGE)
    return replies, stretches


def force(reply: Any) -> float:
    """With which a plate presses, the mean of a step [N]."""
    return float(abs(reply.wrench[0, 0]))


def mean(values: Any) -> np.ndarray:
    """Of each step, of what is linear in it, from its ends."""
    values = np.asarray(values)
    return np.asarray(0.5 * (values + np.concatenate([[0.0], values[:-1]])))


def test_a_cube_between_plates_is_the_bar_of_the_differential_equation() -> None:
    """Squeezed by 25 % in .4 s and held until 5 s, in steps of 10 ms: .2 % of the integral, and of the point."""
    replies, stretches = squeezed(cube(), 5.0)
    point, times = Point(TWO), 0.01 * (0.5 + np.arange(len(replies)))
    forces, case = np.array([force(reply) for reply in replies]), CASES["relaxation"]
    expected = -np.array(case["P"]) * EDGE**2
    found, held = np.interp(case["t"], times, forces), np.array(case["t"]) > RAMP + 0.05
    alone = mean([-point.pull(stretch, 0.01) * EDGE**2 for stretch in stretches])
    print(np.abs(found / expected - 1)[held].max(), np.abs(forces / alone - 1)[10:].max(), np.abs(forces / alone - 1)[50:].max())
    np.testing.assert_allclose(found[held], expected[held], rtol=2e-3)
    np.testing.assert_allclose(forces[50:], alone[50:], rtol=1e-3)
