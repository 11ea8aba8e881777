"""Runs of a scene in this process that are differentiated: backward for a loss, forward for curves of forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from softseam.embedded import pull, push, roll_out
from softseam.errors import BadInput
from softseam.gradient import Asked, Crossed, Floats, Gradient, checked_slope
from softseam.losses import Run

if TYPE_CHECKING:
    from softseam_services.orchestrator.gradient import Pulled
    from softseam_services.orchestrator.rollout import Rollout
    from softseam_services.orchestrator.simulation import Simulation


def differentiate(simulation: Simulation, asked: Asked) -> Gradient:
    """The gradient of a loss of a run from the start of the scene. Raises BadInput, and what the services raise."""
    _check_body(simulation, asked.names)
    began = perf_counter()
    rollout = roll_out(simulation, asked.commands, asked.steps)
    forward, run = perf_counter() - began, _run_of(simulation, rollout)
    value, slope = asked.loss(run)
    if not np.isfinite(value):
        raise BadInput(f"the loss is {value}: it must be finite")
    by_force, by_positions, by_start = checked_slope(slope, run)
    began = perf_counter()
    pulled = pull(simulation, rollout, by_force, by_positions, asked.within)
    by = {name: _entry(name, pulled, by_start, list(run.force)) for name in asked.names}
    crossed = tuple(Crossed(*one) for one in pulled.crossed)
    return Gradient(float(value), by, crossed, run, forward, perf_counter() - began)


def forces_with_slopes(
    simulation: Simulation, directions: Sequence[tuple[float, Mapping[str, float]]]
) -> tuple[Run, Floats]:
    """A run of the scene's own motion, and how forces on tools change along it (d, s, t, 3) [N].

    directions: changes of Young's modulus [Pa], and of tools' friction [1]. Raises what the services raise
    """
    rollout = roll_out(simulation, None, None)
    return _run_of(simulation, rollout), push(simulation, rollout, directions)


def _check_body(simulation: Simulation, names: Sequence[str]) -> None:
    """Raises BadInput where a body has no single derivative by one of these."""
    if len(simulation.bodies) > 1:
        return  # refused where it is rolled out
    body = simulation.body
    if "young" in names and len(getattr(body, "materials", ())) > 1:
        raise BadInput("`body.inclusions`: a body of several materials has no one Young's modulus: leave 'young' out")
    if "position" in names and np.any(getattr(body, "fixed", False)):
        raise BadInput("`body.fixed`: a clamped body does not begin anywhere else: leave 'position' out")


def _run_of(simulation: Simulation, rollout: Rollout) -> Run:
    """What a loss sees."""
    tools, positions = simulation.tools.names, rollout.positions
    time = np.arange(1, rollout.n_steps + 1) * np.float64(rollout.dt)
    for array in (time, positions, rollout.force, rollout.tool_position):
        array.setflags(write=False)
    force = {name: rollout.force[:, tool] for tool, name in enumerate(tools)}
    place = {name: rollout.tool_position[1:, tool] for tool, name in enumerate(tools)}
    return Run(time, force, positions[1:], positions[0], place)


def _entry(name: str, pulled: Pulled, by_start: Floats, tools: Sequence[str]) -> float | Floats:
    what, _, tool = name.partition(".")
    if what == "young":
        return pulled.young
    if what == "friction":
        return float(pulled.friction[tools.index(tool)] if tool else pulled.friction.sum())
    if what == "way":
        return np.ascontiguousarray(pulled.way[:, tools.index(tool)])
    return np.asarray((pulled.velocity if what == "velocity" else pulled.position + by_start).sum(axis=0))
