"""The bodies of a pile, each a region of its own whose arrays are rows of the pile's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Body, Floats, Region
from softseam_services.body.region import build_region
from softseam_services.jit import Rows

from .field_reader import FieldReader
from .fours import fours_of
from .kernels.lanes import LINE, aligned
from .kernels.summary import N_RESULTS
from .kernels.trust import N_MONITOR
from .model import STRUCTURES, PbdModel, lay_out
from .parameters import PbdParameters, build_parameters
from .records import Member, PbdState, new_state, size_of
from .step import StepScratch

if TYPE_CHECKING:  # which builds by the row that names this file
    from softseam_services.server import Setup

_PADDING = 8
"""rows of nodes that never move, after those of each body"""


@dataclass(frozen=True)
class Piece:
    """One of the bodies."""

    body: Body
    region: Region
    model: PbdModel
    parameters: PbdParameters
    scratch: StepScratch
    reader: FieldReader
    states: tuple[PbdState, PbdState]
    """two, of which one is committed"""

    @property
    def apart(self) -> bool:
        """Whether its steps are not the pile's kernel's: explicit ones, and those of a law with state from outside."""
        blocks = self.parameters.blocks
        return self.parameters.explicit or (blocks.n_state > 0 and blocks.branches == 0)

    def member(self, now: int) -> Member:
        """As kernels take it, where this one of its states is committed."""
        model, parameters, scratch = self.model, self.parameters, self.scratch
        return Member(
            model=model.arrays,
            parameters=parameters.arrays,
            before=self.states[now],
            after=self.states[1 - now],
            scratch=scratch.arrays,
            outputs=scratch.outputs,
            all=np.array([0, model.blocks.n_batches], dtype=np.int32),
            own_mass=parameters.own_mass,
            substeps=scratch.planned,
            plans=parameters.plans,
            sweeps=parameters.spec.sweeps,
            slowly=parameters.slowly,
            roundoff=parameters.roundoff,
            turns=scratch.turning is not None,
        )


class Pieces:
    """All of them, b bodies between the same t tools; what evolves, and what comes of a step, is in arrays of all.

    Raises SettingError where a body cannot be one.
    """

    def __init__(self, setups: Sequence[Setup]) -> None:
        built = [_region(setup) for setup in setups]
        sizes = [_sizes(model, parameters) for _, _, model, parameters in built]
        ends = np.cumsum([size_of(*each) for each in sizes])
        self.buffers = np.zeros(ends[-1]), np.zeros(ends[-1])
        """two states of all bodies, one after the other"""
        self.monitors: NDArray[np.int64] = ends[:, None] + np.arange(-N_MONITOR, 0)
        """places of each body's monitor there (b, N_MONITOR)"""
        b, t = len(setups), built[0][2].n_tools
        self.results: Floats = np.zeros((b, N_RESULTS))
        """of a step, see `kernels.summary`"""
        self.wrenches: Floats = np.zeros((b, t, 6))
        """on each body [N, N m]"""
        nodes = np.cumsum([0, *(each[0] + _PADDING for each in sizes)])
        self.xw: Floats = aligned(int(nodes[-1]), 4)
        """positions [m] and inverse masses [1/kg] within a step, of each body's nodes and then its padding"""
        self.n_rows = int(nodes[-1])
        """of the bodies there"""
        self.first_row = nodes[:-1].astype(np.int32)
        """row of each body's first node there (b,)"""
        self.fours = fours_of([(model, parameters) for _, _, model, parameters in built])
        """those that are swept four at a time"""
        self.each: list[Piece] = []
        """in the order of the bodies"""
        for number, (body, region, model, parameters) in enumerate(built):
            states = [
                new_state(*sizes[number], buffer=buffer[end - size_of(*sizes[number]) : end])
                for buffer, end in zip(self.buffers, (ends[number],) * 2, strict=True)
            ]
            scratch = StepScratch(model, parameters, setups[number].scene.step)
            scratch.write_to(self.results[number], self.wrenches[number], self.xw[nodes[number] : nodes[number + 1]])
            reader = FieldReader(model, body, region, scratch.ws, scratch.arrays.xw)
            self.each.append(Piece(body, region, model, parameters, scratch, reader, (states[0], states[1])))

    def rows(self) -> tuple[Rows, Rows]:
        """As kernels take them: where the first of their states is committed, and where the second is."""
        return Rows([piece.member(0) for piece in self.each]), Rows([piece.member(1) for piece in self.each])


def _region(setup: Setup) -> tuple[Body, Region, PbdModel, PbdParameters]:
    body, tools, spec = setup.body, setup.tools, setup.scene.models.pbd
    if not body.has_cells:
        raise ValueError(f"a {body.kind} is made of particles: it cannot be in a pile")
    region = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32), True)
    model = STRUCTURES.find(lay_out(body, region, tools, spec))
    return body, region, model, build_parameters(model, body, region, tools, spec)


def _sizes(model: PbdModel, parameters: PbdParameters) -> tuple[int, int, int, int, int]:
    """Of a state, see `new_state`."""
    return model.n_nodes, model.blocks.n_batches, model.n_points, model.n_tools, parameters.blocks.n_state


assert LINE % 4 == 0  # rows of nodes begin at a vector
