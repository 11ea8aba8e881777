"""PBD's row in the table of solvers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Configure, Configured
from softseam_protocol.participant.solver import Solver
from softseam_protocol.scene.file import scene_from_bundle
from softseam_protocol.scene.interfaces import contacts_among
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body.body import Body, Region
from softseam_services.body.particles import ParticleBody
from softseam_services.body.region import build_region
from softseam_services.built import Built
from softseam_services.pbd import cost
from softseam_services.solver_row import SolverRow
from softseam_services.tools.tool_set import ToolSet

if TYPE_CHECKING:  # which builds by this row
    from softseam_services.pbd.model_error import ModelError
    from softseam_services.server import Setup


def build(setup: Setup, request: Configure, built: Built) -> tuple[Solver, Configured]:
    """A part of cells, or a body of particles."""
    if not setup.body.has_cells:
        return _build_particles(setup, setup.body, request)
    from softseam_services.pbd.model import STRUCTURES, lay_out
    from softseam_services.pbd.solver import PbdSolver

    region = build_region(setup.body, request.cells, request.coupling_nodes, request.owns_coupling_points)
    structure = STRUCTURES.find(lay_out(setup.body, region, setup.tools, setup.scene.models.pbd))
    solver = PbdSolver(setup.scene, setup.body, region, setup.tools, request.state, structure)
    size, moving = (len(region.nodes), len(region.cells)), solver.moving
    return solver, Configured(request.header, *size, solver.substeps, solver.strain, *moving, 0.0, solver.capabilities)


def build_pile(setups: Sequence[Setup], guests: Sequence[Setup], request: Configure) -> tuple[Solver, Configured]:
    """A pile of bodies in cells."""
    from softseam_services.pbd.pile import PileSolver
    from softseam_services.pbd.surfaces import Contact

    names, scene = [*request.bodies, *request.guests], scene_from_bundle(request.bundle)
    places = {name: place for place, name in enumerate(names)}
    contacts = {
        name: Contact((places[spec.between[0]], places[spec.between[1]]), spec.friction)
        for name, spec in contacts_among(names, scene.interfaces).items()
    }
    finest = min(0.5 * setup.body.resolution for setup in setups if setup.body.has_cells)
    solver = PileSolver(setups, request.states, contacts, [setup.touched(finest) for setup in guests])
    n_nodes = sum(piece.model.n_nodes for piece in solver.pieces)
    n_cells = sum(piece.body.n_cells for piece in solver.pieces)
    begun = solver.begun
    sums = float(begun.strain.sum()), float(begun.kinetic.sum()), float(begun.gravity.sum())
    sizes = n_nodes, n_cells, solver.substeps
    return solver, Configured(request.header, *sizes, *sums, 0.0, solver.capabilities, begun)


def _build_particles(setup: Setup, body: ParticleBody, request: Configure) -> tuple[Solver, Configured]:
    """A sheet or rope is one region, whole."""
    from softseam_services.pbd.particles.model import STRUCTURES, lay_out
    from softseam_services.pbd.particles.solver import ParticleSolver

    structure = STRUCTURES.find(lay_out(body, setup.scene.models.pbd))
    solver = ParticleSolver(setup.scene, body, setup.tools, request.state, structure)
    return solver, Configured(request.header, body.n_nodes, 0, solver.substeps, solver.strain, *solver.moving)


def coarse_cells(body: Body, models: ModelsSpec, tools: ToolSet) -> NDArray[np.bool_]:
    """Cells that it takes as one block in place of eight (C,)."""
    from softseam_services.pbd import levels

    return levels.coarse_cells(body, models.pbd.coarse, tools)


def model_indicator(body: Body, region: Region, models: ModelsSpec) -> ModelError:
    """Beside finite elements on the same nodes."""
    from softseam_services.pbd.model_error import ModelError

    return ModelError(body, region, models.pbd.hourglass)


MODEL = "pbd"
ROW = SolverRow(
    build,
    cost.of_cells,
    cost_at_rest=cost.of_cells,
    kernels="softseam_services.pbd.kernels",
    coarse_cells=coarse_cells,
    model_indicator=model_indicator,
    build_pile=build_pile,
)
