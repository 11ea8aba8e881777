"""What softseam's services know of a solver: how it builds a part, and what a step of one is expected to cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from softseam_protocol.messages.participant import Configure, Configured
from softseam_protocol.participant.solver import Solver
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body.body import Body
from softseam_services.built import Built

if TYPE_CHECKING:  # which builds by these rows
    from softseam_services.server import Setup

Build = Callable[["Setup", Configure, Built], tuple[Solver, Configured]]


@dataclass(frozen=True)
class StepWork:
    """Of one part of a body.

    dt         of the step [s]
    touched    there are tools
    n_cells    of the part, n_coarse of which are one block for models that can take them so
    n_nodes    of the part
    n_coupled  unknowns at its coupling nodes
    """

    body: Body
    models: ModelsSpec
    dt: float
    touched: bool
    n_cells: int
    n_coarse: int = 0
    n_nodes: int = 0
    n_coupled: int = 0


Cost = Callable[[StepWork], float]


def no_cost(work: StepWork) -> float:
    """Of what costs nothing, or nobody knows what [us]."""
    return 0.0


@dataclass(frozen=True)
class SolverRow:
    """How a model is solved here.

    build              the solver of a part that a Configure asks for, of what is built already, and its answer; it
                       imports the solver, so that a service loads one model and no more
    cost_of_cells      what a step of the part's cells is expected to cost, in a grip [us]
    cost_of_equations  and what solving its equations as a whole costs [us]
    cost_at_rest       what both cost while no tool is near, of a body that is not round [us]
    kernels            package of its kernels, which are compiled before a run that needs them; '' for none
    """

    build: Build
    cost_of_cells: Cost = no_cost
    cost_of_equations: Cost = no_cost
    cost_at_rest: Cost = no_cost
    kernels: str = ""
