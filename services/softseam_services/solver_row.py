"""What softseam's services know of a solver: how it builds a part, and what a step of one is expected to cost."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Configure, Configured
from softseam_protocol.participant.solver import Solver
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body.body import Body, Region
from softseam_services.built import Built
from softseam_services.tools.tool_set import ToolSet
from softseam_services.weighing import Adjoint, MeshIndicator, ModelIndicator

if TYPE_CHECKING:  # which builds by these rows
    from softseam_services.server import Setup

Build = Callable[["Setup", Configure, Built], tuple[Solver, Configured]]
BuildPile = Callable[[Sequence["Setup"], Configure], tuple[Solver, Configured]]


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


def none_coarse(body: Body, models: ModelsSpec, tools: ToolSet) -> NDArray[np.bool_]:
    """Of a model that takes every cell as it is (C,)."""
    return np.zeros(body.n_cells, dtype=np.bool_)


@dataclass(frozen=True)
class SolverRow:
    """How a model is solved here.

    build              the solver of a part that a Configure asks for, of what is built already, and its answer; it
                       imports the solver, so that a service loads one model and no more
    cost_of_cells      what a step of the part's cells is expected to cost, in a grip [us]
    cost_of_equations  and what solving its equations as a whole costs [us]
    cost_at_rest       what both cost while no tool is near, of a body that is not round [us]
    kernels            package of its kernels, which are compiled before a run that needs them; '' for none
    coarse_cells       cells of a body that it takes as one block (C,), by tools where they are at the start
    adjoint            of a body, whose region it is given whole; None: it has none
    mesh_indicator     of a region; None: it measures no error of its mesh
    model_indicator    of a region of box cells; None: it measures no error of its model
    build_pile         the solver of a pile of bodies, and its answer, where MODELS says that the model `piles`
    """

    build: Build
    cost_of_cells: Cost = no_cost
    cost_of_equations: Cost = no_cost
    cost_at_rest: Cost = no_cost
    kernels: str = ""
    coarse_cells: Callable[[Body, ModelsSpec, ToolSet], NDArray[np.bool_]] = none_coarse
    adjoint: Callable[[Body, Region, ToolSet, ModelsSpec], Adjoint] | None = None
    mesh_indicator: Callable[[Body, Region, ModelsSpec], MeshIndicator] | None = None
    model_indicator: Callable[[Body, Region, ModelsSpec], ModelIndicator] | None = None
    build_pile: BuildPile | None = None
