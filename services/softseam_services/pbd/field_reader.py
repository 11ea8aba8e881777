"""Reads a region's fields, and what PBD is off by in its cells, out of a state."""

import numpy as np

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import Fields
from softseam_services.body.body import Body, Floats, Region

from .blocks import to_octants
from .kernels.laws import cell_energies, octant_stress
from .kernels.pairs import place_points
from .levels import fill_in
from .model import PbdModel
from .model_error import ModelError
from .parameters import PbdParameters
from .points import Gathering
from .records import PbdState

_GATHERINGS = 8
"""that a structure keeps, of weights that were asked for last"""


class FieldReader:
    """Of one region. What estimates the error is built when it is first asked for."""

    def __init__(self, model: PbdModel, body: Body, region: Region, ws: Floats, xw: Floats) -> None:
        """ws, xw: the region's workspace and room for its nodes (n + 8, 4), overwritten"""
        self._model, self._body, self._region, self._ws, self._xw = model, body, region, ws, xw
        self._measure: ModelError | None = None

    def read(self, header: Header, parameters: PbdParameters, state: PbdState, indicators: bool, own: bool) -> Fields:
        """All fields; indicators: with the errors of the model; own: by fewer products, a little too small."""
        model, region, numbers = self._model, self._region, parameters.blocks
        n = model.n_nodes
        self._xw[:n, :3] = state.x
        numbers.hold(state.memory)
        cauchy = np.zeros((len(region.cells), 8, 6))
        blocks = model.blocks
        octant_stress(self._ws, self._xw, blocks.nodes, blocks.octant, numbers.constants, numbers.law, cauchy)
        energy = np.zeros(len(region.cells))
        cell_energies(
            self._ws, self._xw, blocks.nodes, numbers.volume, blocks.octant, numbers.constants, numbers.law, energy
        )
        point_x = np.zeros((model.n_surface, 3))
        place_points(model.arrays, parameters.arrays, self._xw, point_x)
        force = self._gathering(parameters)(state.force_mean)
        size = np.einsum("ptc,ptc->pt", force, force)
        v = state.v.copy()
        fill_in(model.levels, region, parameters.arrays.mass, state.x, v)
        cauchy[model.levels.coarse] = cauchy[model.levels.coarse, :1]
        tool = np.full(model.n_surface, -1, dtype=np.int32)
        if model.n_tools and model.n_surface:
            touching = (size > 0.0).any(axis=1)
            tool[touching] = size[touching].argmax(axis=1)
        return Fields(
            header=header,
            nodes=region.nodes,
            x=state.x.copy(),
            v=v,
            cauchy=cauchy,
            points=region.points,
            point_x=point_x,
            contact_force=np.einsum("ptc->pc", force),
            contact_tool=tool,
            cell_energy=energy,
            model_error=self._model_error(parameters, state, force, own) if indicators else np.zeros(0),
            internal=to_octants(blocks, model.levels.coarse, state.memory[:, : self._body.material.n_state]),
        )

    def _gathering(self, parameters: PbdParameters) -> Gathering:
        """Bodies that are alike share one."""
        model, weight = self._model, parameters.arrays.weight
        known, key = model.gatherings, weight.tobytes()
        found = known.get(key)
        if found is None:
            if len(known) >= _GATHERINGS:
                known.clear()
            found = known[key] = Gathering((model.indptr, model.node, weight), model.n_surface)
        return found

    def _model_error(self, parameters: PbdParameters, state: PbdState, force: Floats, bounded: bool) -> Floats:
        """Zero where cells are no boxes, or some are one block: scenes that ask for it are refused. Empty where the
        material has state, whose error is not known."""
        model = self._model
        if self._body.material.n_state:
            return np.zeros(0)
        if not self._body.boxes or model.levels.ties is not None:
            return np.zeros(len(self._region.cells))
        if self._measure is None:
            known = model.blocks, parameters.blocks
            self._measure = ModelError(self._body, self._region, parameters.spec.hourglass, known)
        return self._measure.measure(state.x, force.sum(axis=1), state.stress, bounded)
