"""FEM's row in the table of solvers."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from softseam_protocol.messages.participant import Configure, Configured
from softseam_protocol.participant.solver import Solver
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body.body import Body, Region
from softseam_services.body.region import build_region
from softseam_services.built import Built
from softseam_services.solver_row import SolverRow
from softseam_services.tools.tool_set import ToolSet

from . import cost

if TYPE_CHECKING:  # which builds by this row
    from softseam_services.server import Setup

    from .adjoint import FemAdjoint
    from .mesh_error import MeshError


def build(setup: Setup, request: Configure, built: Built) -> tuple[Solver, Configured]:
    """A part of cells, with the tables of its region where these are kept."""
    from .region_tables import RegionTables
    from .solver import FemSolver

    body = cast(Body, setup.body)  # it takes no particles: who asks has refused them
    region = build_region(body, request.cells, request.coupling_nodes, request.owns_coupling_points)
    tables = built.find(body, request)
    tables = tables or RegionTables(body, region, setup.tools, setup.scene, built.structures)
    solver = FemSolver(setup.scene, body, region, setup.tools, request.state, tables)
    built.keep(body, request, solver.tables)
    size, moving = (len(region.nodes), len(region.cells)), solver.moving
    return solver, Configured(request.header, *size, 1, solver.strain, *moving, 0.0, solver.capabilities)


def adjoint(body: Body, whole: Region, tools: ToolSet, models: ModelsSpec) -> FemAdjoint:
    """Of the whole body, undivided."""
    from .adjoint import FemAdjoint

    return FemAdjoint(body, whole, tools, models.fem)


def mesh_indicator(body: Body, region: Region, models: ModelsSpec) -> MeshError:
    """Of the scene's element."""
    from .mesh_error import MeshError

    return MeshError(body, region, models.fem.element)


MODEL = "fem"
ROW = SolverRow(
    build,
    cost.of_cells,
    cost.of_equations,
    cost.at_rest,
    kernels="softseam_services.fem.kernels",
    adjoint=adjoint,
    mesh_indicator=mesh_indicator,
)
