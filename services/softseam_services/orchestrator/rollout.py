"""A run that is kept whole, so that it can be differentiated: the states between its steps, and where tools were."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.command import Command
from softseam_protocol.scene.motion import ClosePhase, TurnPhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import SolidTool
from softseam_services.body.build import AnyBody
from softseam_services.differentiable import Differentiable, Tape
from softseam_services.orchestrator.simulation import Simulation

Floats = NDArray[np.float64]


class NotDifferentiable(ValueError):
    """Gradients do not go through this scene, or this run of it; the text names the key and a remedy."""


@dataclass(frozen=True)
class Rollout:
    """s steps of one body with n nodes between t tools."""

    dt: float
    """[s]"""
    tape: Tape
    """of the solver that took them"""
    force: Floats
    """of the body on each tool as each step ends (s, t, 3) [N]"""

    @property
    def n_steps(self) -> int:
        return len(self.force)

    @property
    def positions(self) -> Floats:
        """Of all nodes, before the first step and after each (s + 1, n, 3) [m]."""
        return self.tape.positions

    @property
    def tool_position(self) -> Floats:
        """Likewise (s + 1, t, 3) [m]."""
        return self.tape.tool_position


def check_differentiable(scene: Scene, body: AnyBody) -> None:
    """Raises NotDifferentiable where gradients do not go through a scene."""
    if len(scene.bodies) > 1:
        raise NotDifferentiable("`bodies`: gradients go through one body: leave one in the scene")
    if not body.has_cells:
        raise NotDifferentiable(f"`body.kind`: gradients go through cells, not through a {body.kind}")
    fem = scene.models.fem
    if fem.integrator != "implicit_euler":
        raise NotDifferentiable(
            f"`models.fem.integrator`: gradients go through implicit_euler, not through {fem.integrator}"
        )
    if fem.step_error is not None:
        raise NotDifferentiable("`models.fem.step_error`: gradients go through whole steps: leave it out")
    if scene.symmetry:
        raise NotDifferentiable("`symmetry`: gradients go through whole bodies: leave it out")
    if body.material.n_state:
        raise NotDifferentiable(
            f"`body.material.kind`: {body.material.kind} remembers, which gradients do not follow: take an elastic law"
        )
    if body.material.retardation_time > scene.step:
        raise NotDifferentiable(
            f"`body.material.retardation_time` is longer than a step, so that it damps, which gradients do not follow: "
            f"at most {scene.step:g}, or 0"
        )
    if body.damping > 0.0:
        raise NotDifferentiable("`body.damping`: gradients do not follow drag: leave it out")
    for name, tool in scene.tools.items():
        if isinstance(tool, SolidTool) and tool.force_limit is not None:
            raise NotDifferentiable(f"`tools.{name}.force_limit`: gradients go through motions that no force decides")
    for number, phase in enumerate(scene.motion):
        if isinstance(phase, TurnPhase):
            raise NotDifferentiable(
                f"`motion.{number}.turn`: gradients go through tools that do not turn: leave it out"
            )
        if isinstance(phase, ClosePhase) and (phase.force is not None or phase.until.force is not None):
            raise NotDifferentiable(
                f"`motion.{number}` depends on a force, and gradients go through motions that no force decides: end it "
                "by `until: {compression: ...}` or `until: {time: ...}`"
            )


def roll_out(simulation: Simulation, commands: Sequence[Command] | None, most: int | None) -> Rollout:
    """Run a simulation from its start, by these tool velocities step by step, or by the scene's own motion.

    most: steps to take of that motion, None for all. Raises NotDifferentiable, and what steps raise.
    """
    check_differentiable(simulation.scene, simulation.body)
    simulation.reset()
    solver = simulation.solver
    if not isinstance(solver, Differentiable):
        raise NotDifferentiable("`regions`: gradients go through fem alone: open the scene with model='fem'")
    tape, turn = solver.begin_tape(simulation.tools, simulation.scene.step), simulation.tools.orientation.copy()
    forces: list[Floats] = []
    limit = len(commands) if commands is not None else most
    while (commands is not None or not simulation.done) and (limit is None or len(forces) < limit):
        report = simulation.step(None if commands is None else commands[len(forces)])
        number, (part,) = len(forces), report.parts.values()
        if part.substeps > 1:
            raise NotDifferentiable(
                f"step {number} was taken in {part.substeps} parts, which gradients do not go through: shorten `step`"
            )
        if not np.array_equal(report.tool_orientation, turn):
            raise NotDifferentiable(f"step {number} turned a tool: gradients go through tools that do not turn")
        tape.keep(report.tool_position)
        forces.append(report.wrench[:, :3].copy())
    if not forces:
        raise NotDifferentiable("the run has no steps: give the scene a `motion` or a `duration`, or commands")
    return Rollout(simulation.scene.step, tape, np.stack(forces))
