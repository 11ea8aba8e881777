"""Derivatives of numbers that are read off a recorded run: back through its steps, or forward along them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softseam_services.differentiable import Differential, NotSmooth
from softseam_services.orchestrator.rollout import Floats, NotDifferentiable, Rollout
from softseam_services.orchestrator.simulation import Simulation

TOLERANCE = 1e-7
"""of the linear equations of a step, relative"""


class Crossing(NamedTuple):
    """A contact that nearly changed its state as a step ended: beyond it the derivative is another one."""

    step: int
    tool: str
    margin: float
    """relative change of forces that it takes [1]"""


@dataclass(frozen=True)
class Pulled:
    """What one number owes to each input of a run with s steps, n nodes and t tools."""

    young: float
    """per pascal of the body's Young's modulus"""
    friction: Floats
    """per unit of each tool's coefficient (t,)"""
    way: Floats
    """per metre of each tool's way in each step (s, t, 3)"""
    velocity: Floats
    """per m/s of each node as the run begins (n, 3)"""
    position: Floats
    """per metre of each node's place then, clamped nodes left out (n, 3)"""
    crossed: tuple[Crossing, ...]
    iterations: int
    factors: int


def pull(simulation: Simulation, rollout: Rollout, by_force: Floats, by_positions: Floats, near: float) -> Pulled:
    """Of a number with derivatives by forces on tools (s, t, 3) [1/N] and positions after each step (s, n, 3) [1/m].

    near: contacts within such a relative change of forces are crossed. Raises NotDifferentiable.
    """
    derivative, names = rollout.tape.derivatives(TOLERANCE), simulation.tools.names
    owed: Differential = derivative.zero()
    by_place, crossed = np.zeros_like(rollout.tool_position), []
    for step in range(rollout.n_steps - 1, -1, -1):
        owed.tool_force[:] = by_force[step]
        owed.x[:] += by_positions[step]
        owed.tool_start[:], owed.tool_end[:] = 0.0, 0.0
        try:
            crossed += [Crossing(step, names[n.tool], n.margin) for n in derivative.look(step, near)]
            derivative.pull(owed)
        except NotSmooth as error:
            raise NotDifferentiable(str(error)) from None
        by_place[step] += owed.tool_start
        by_place[step + 1] += owed.tool_end
    way = np.cumsum(by_place[:0:-1], axis=0)[::-1].copy()
    young = float(owed.young[0]) / _young(simulation)
    return Pulled(
        young, owed.friction, way, owed.v, owed.x, tuple(crossed[::-1]), derivative.iterations, derivative.factors
    )


class Direction(NamedTuple):
    """A change of inputs that stay as they are over a run."""

    young: float = 0.0
    """[Pa]"""
    friction: Mapping[str, float] = {}
    """of tools"""


def push(simulation: Simulation, rollout: Rollout, directions: list[Direction]) -> Floats:
    """How forces on tools change along the run for a unit of each direction (d, s, t, 3) [N].

    Raises NotDifferentiable.
    """
    derivative, names = rollout.tape.derivatives(TOLERANCE), simulation.tools.names
    changes: list[Differential] = [derivative.zero() for _ in directions]
    for change, direction in zip(changes, directions, strict=True):
        change.young[0] = direction.young / _young(simulation)
        for name, value in direction.friction.items():
            change.friction[names.index(name)] = value
    found = np.zeros((len(directions), *rollout.force.shape))
    for step in range(rollout.n_steps):
        try:
            derivative.look(step, 0.0)
            for change, forces in zip(changes, found, strict=True):
                derivative.push(change)
                forces[step] = change.tool_force
        except NotSmooth as error:
            raise NotDifferentiable(str(error)) from None
    return found


def _young(simulation: Simulation) -> float:
    """Of the body [Pa]."""
    young: float = simulation.body.material.young  # type: ignore[union-attr]  # of cells, or it had not been recorded
    return young
