"""What the participants estimate of their errors, and what the two parts at the seam differ in, cell by cell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.traction import face_normals, face_tractions, traction_jump
from softseam_protocol.messages.participant import Fields
from softseam_protocol.messages.session import Indicators
from softseam_protocol.models import facts_of
from softseam_services.body.body import Body
from softseam_services.orchestrator.parts import Parts
from softseam_services.orchestrator.seam_faces import face_corners, seam_faces

Floats = NDArray[np.float64]


def measure(body: Body, parts: Parts, neighbours: NDArray[np.int32], fields: Mapping[str, Fields]) -> Indicators:
    """The indicators of the whole body; fields were asked for with indicators, neighbours (C, 6) as in `CellGrid`."""
    model, mesh, jump, gap = np.zeros((4, body.n_cells))
    for name, side in fields.items():
        if facts_of(parts.models[name]).errs_by == "model":
            model[parts.cells[name]] = told(side.model_error, len(parts.cells[name]))
        else:
            mesh[parts.cells[name]] = told(side.mesh_error, len(parts.cells[name]))
    if len(parts.seam):
        jump[:] = _jumps(body, parts, neighbours, fields)
        gap[:] = _gaps(body, parts, fields)
    return Indicators(model, mesh, jump, gap)


def told(errors: Floats, n_cells: int) -> Floats:
    """A part's errors by cell (n_cells,) [J]; 0 of a part that does not estimate them."""
    return errors if len(errors) else np.zeros(n_cells)


def energy_error(energy: Floats, strain: float) -> float:
    """Error in the energy norm, relative to the strain energy [J], of the energies of cells' errors (C,) [J]."""
    return float(np.sqrt(energy.sum() / strain)) if strain > 0.0 else 0.0


def root_mean_square(jump: Floats) -> float:
    """Of the jumps (C,) of cells that have one; 0 where none has."""
    at_seam = jump[jump > 0.0]
    return float(np.sqrt((at_seam**2).mean())) if len(at_seam) else 0.0


def _jumps(body: Body, parts: Parts, neighbours: NDArray[np.int32], fields: Mapping[str, Fields]) -> Floats:
    """Root mean square over each cell's faces at the seam (C,) [Pa]."""
    square, count = np.zeros((2, body.n_cells))
    x = np.empty((body.n_nodes, 3))
    a, b = parts.names
    for name in (b, a):
        x[fields[name].nodes] = fields[name].x
    sample = {name: facts_of(parts.models[name]).stress_at for name in parts.names}
    for face, cells, others in seam_faces(body, parts, neighbours):
        normal = face_normals(x[body.cell_nodes[cells][:, face_corners(face)]])
        tractions = []
        for name, mine, side in ((a, cells, face), (b, others, face ^ 1)):
            cauchy = fields[name].cauchy[np.searchsorted(parts.cells[name], mine)]
            tractions.append(face_tractions(cauchy, side, sample[name], normal))
        jump = traction_jump(*tractions) ** 2
        for mine in (cells, others):
            np.add.at(square, mine, jump)
            np.add.at(count, mine, 1.0)
    return np.asarray(np.sqrt(square / np.maximum(count, 1.0)))


def _gaps(body: Body, parts: Parts, fields: Mapping[str, Fields]) -> Floats:
    """Largest gap at each cell's seam nodes (C,) [m]."""
    at = [fields[name].x[np.searchsorted(fields[name].nodes, parts.seam)] for name in parts.names]
    gap = np.zeros(body.n_nodes)
    gap[parts.seam] = np.linalg.norm(at[0] - at[1], axis=1)
    return np.asarray(gap[body.cell_nodes].max(axis=1))
