"""Reads a region's fields, and the errors of its mesh and its model, out of a state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages import Fields, Header
from softseam_protocol.scene_models import ModelsSpec
from softseam_services.body.body import Body, Floats, Region
from softseam_services.fem.face_forces import gathered_at_nodes, gathering, point_positions
from softseam_services.fem.kernels.elements import cauchy_stress, strain_energy
from softseam_services.fem.mesh_error import MeshError
from softseam_services.fem.model import FemModel
from softseam_services.fem.state import FemState
from softseam_services.fem.work import Work
from softseam_services.pbd.model_error import ModelError


class FieldReader:
    """Of one region. What estimates the errors is built when it is first asked for."""

    def __init__(self, body: Body, region: Region, model: FemModel, spec: ModelsSpec) -> None:
        self._body, self._region, self._model, self._spec = body, region, model, spec
        self._gather = gathering(model, len(region.points))
        self._mesh: MeshError | None = None
        self._other: ModelError | None = None

    def read(self, header: Header, state: FemState, work: Work, indicators: bool, own: bool) -> Fields:
        """All fields; indicators: with the errors of the mesh and, unless `own`, of what PBD would be off by."""
        region, model = self._region, self._model
        cauchy = np.zeros((len(region.cells), 8, 6))
        strain_energy(state.x, model, work)
        cauchy_stress(state.x, model, work, cauchy)
        force = gathered_at_nodes(self._gather, state.contact[:, :, :3])
        size = np.einsum("pti,pti->pt", force, force)
        return Fields(
            header=header,
            nodes=region.nodes,
            x=state.x.copy(),
            v=state.v.copy(),
            cauchy=cauchy,
            points=region.points,
            point_x=point_positions(model, state.x)[: len(region.points)],
            contact_force=force.sum(axis=1),
            contact_tool=_touched(size),
            cell_energy=work.energy.copy(),
            model_error=self._model_error(state.x, force.sum(axis=1)) if indicators and not own else np.zeros(0),
            mesh_error=self._mesh_error(state.x, cauchy) if indicators else np.zeros(0),
        )

    def _mesh_error(self, x: Floats, cauchy: Floats) -> Floats:
        if self._mesh is None:
            self._mesh = MeshError(self._body, self._region, self._spec.fem.element)
        return self._mesh.measure(x, cauchy)

    def _model_error(self, x: Floats, contact_force: Floats) -> Floats:
        """What PBD would be off by in these cells; empty where it cannot have them."""
        if not self._body.boxes:
            return np.zeros(0)
        if self._other is None:
            self._other = ModelError(self._body, self._region, self._spec.pbd.hourglass)
        return self._other.measure(x, contact_force)


def _touched(size: Floats) -> NDArray[np.int32]:
    """Tool with the largest force on each point, -1 for none; size (p, t) >= 0."""
    if size.shape[1] == 0:
        return np.full(len(size), -1, dtype=np.int32)
    return np.where(size.max(axis=1) > 0.0, size.argmax(axis=1), -1).astype(np.int32)
