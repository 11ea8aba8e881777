"""Reads a region's fields, and the errors of its mesh and its model, out of a state."""

import numpy as np

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import Fields
from softseam_services.body.body import Body, Floats, Region
from softseam_services.pbd.model_error import ModelError

from .face_forces import surface_point_of_node
from .kernels.fields import read_fields
from .region_tables import RegionTables
from .state import FemState
from .work import Work

_NOTHING = np.zeros(0)


class FieldReader:
    """Of one region. What estimates the errors is built when it is first asked for."""

    def __init__(self, body: Body, region: Region, tables: RegionTables, hourglass: str) -> None:
        self._body, self._region, self._tables, self._hourglass = body, region, tables, hourglass
        self._model, self._parameters = tables.whole
        self._point_of_node = surface_point_of_node(self._model, len(region.points))
        self._other: ModelError | None = None

    def read(self, header: Header, state: FemState, energy: Floats, work: Work, indicators: bool, own: bool) -> Fields:
        """All fields, with each cell's energy (c,) [J]; work: scratch; indicators: with the errors of the mesh and,
        unless `own`, of what PBD would be off by."""
        region, model, parameters = self._region, self._model, self._parameters
        cauchy, n_points = np.empty((len(region.cells), 8, 6)), len(region.points)
        place, force = np.empty((n_points, 3)), np.empty((n_points, 3))
        touched = np.empty(n_points, dtype=np.int32)
        read_fields(state.x, state.contact, model, parameters, self._point_of_node, work, cauchy, place, force, touched)
        return Fields(
            header=header,
            nodes=region.nodes,
            x=state.x.copy(),
            v=state.v.copy(),
            cauchy=cauchy,
            points=region.points,
            point_x=place,
            contact_force=force,
            contact_tool=touched,
            cell_energy=energy,
            model_error=self._model_error(state.x, force) if indicators and not own else _NOTHING,
            mesh_error=self._mesh_error(state.x, cauchy) if indicators else _NOTHING,
            internal=state.material.copy(),
        )

    def _mesh_error(self, x: Floats, cauchy: Floats) -> Floats:
        """What the cells' size is off by; empty where it is not known: of tetrahedra of a file, and of a material with
        state, whose stress at other points than FEM's nothing keeps."""
        unknown = self._body.tetrahedra or self._body.material.n_state > 0
        return _NOTHING if unknown else self._tables.mesh_error.measure(x, cauchy)

    def _model_error(self, x: Floats, contact_force: Floats) -> Floats:
        """What PBD would be off by in these cells; empty where it cannot have them, or their material has state."""
        if not self._body.boxes or self._body.material.n_state > 0:
            return _NOTHING
        if self._other is None:
            self._other = ModelError(self._body, self._region, self._hourglass)
        return self._other.measure(x, contact_force)
