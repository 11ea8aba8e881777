"""What softseam's services know of a solver: how it builds a part, and what a step of one is expected to cost;
and what it offers to weigh the error of one number, the goal, so that who weighs it knows no solver."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import BodyState, Configure, Configured
from softseam_protocol.participant.solver import Solver
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body.body import Body, Floats, Region
from softseam_services.built import Built
from softseam_services.tools.tool_set import ToolSet


class Adjoint(Protocol):
    """Of a whole body with N nodes, C cells and t tools: what every force on it does to a number J that is read off it.
    Where J changes by g . dx, and the body answers a force f with A dx = f: A z = g, dJ = z . f."""

    def factor(self, state: BodyState, position: Floats, orientation: Floats) -> bool:
        """Make A at a state of the body between tools at (t, 3) [m], (t, 4); False where A is not positive definite."""

    def solve(self, g: Floats) -> Floats:
        """z (N, 3) for g (N, 3), with the factor at hand; 0 at clamped nodes."""

    def push(self, direction: Floats) -> Floats:
        """g (N, 3) [N/m] of J = sum over tools of direction (t, 3) . force of the body on the tool."""

    def forces(self) -> Floats:
        """Forces of each cell on its nodes (C, 27, 3) [N] at the state of `factor`, which came just before."""

    def stress(self, x: Floats) -> Floats:
        """Cauchy stress of all octants at x (N, 3), xx yy zz yz xz xy (C, 8, 6) [Pa]."""


class MeshIndicator(Protocol):
    """What the cells of one region, n nodes and c cells, are off by because they are no smaller."""

    def product(self, x: Floats, cauchy: Floats, y: Floats, other: Floats) -> Floats:
        """int_e (sigma* - sigma)_x : C^-1 : (sigma* - sigma)_y dV (c,) [J] of the errors at positions x and y (n, 3),
        with the stresses that the cells report there, cauchy and other (c, 8, 6)."""


class ModelIndicator(Protocol):
    """What a model is off by in one region, n nodes, c cells and p surface points, beside finite elements there."""

    def pull(self, x: Floats) -> Floats:
        """What the model pulls the nodes with at x (n, 3) [m], in equilibrium with it (n, 3) [N]."""

    def measure(self, x: Floats, contact_force: Floats, *, bounded: bool) -> Floats:
        """Energy of its error in each cell (c,) [J] under contact forces (p, 3) [N]; bounded: at a bounded cost, and a
        little too small."""


if TYPE_CHECKING:  # which builds by these rows
    from softseam_services.server import Setup

Build = Callable[["Setup", Configure, Built], tuple[Solver, Configured]]
BuildPile = Callable[[Sequence["Setup"], Sequence["Setup"], Configure], tuple[Solver, Configured]]


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
    build_pile         the solver of a pile of bodies, which meets guests, and its answer, where MODELS says that the
                       model `piles`
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
