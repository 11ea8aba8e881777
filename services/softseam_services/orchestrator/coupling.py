"""What couples the parts of a cut for one epoch: the loop that the scene names, built from the parts and their tie."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.loops import LOOPS
from softseam_coupling.loops.loop import Loop, LoopSetup, Unsuited
from softseam_coupling.mortar import SeamTie
from softseam_services.body.body import Body
from softseam_services.orchestrator.body_turn import BodyTurn, keeps_momentum
from softseam_services.orchestrator.parts import Parts, side_mass
from softseam_services.orchestrator.subdivided_step import Subdivision
from softseam_services.server import Setup

Floats = NDArray[np.float64]

__all__ = ["Coupling", "Unsuited", "couple"]

_PACE, _TURN = "pace", "turn"
"""names of those entries among what a loop saves"""


@dataclass(frozen=True)
class Coupling:
    """A loop, and how finely its steps are subdivided at present."""

    loop: Loop
    pace: Subdivision = field(default_factory=Subdivision)
    turn: BodyTurn = field(default_factory=BodyTurn)
    """of the body that is in these parts"""

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, in arrays that nobody writes to, for a snapshot."""
        pace = np.array(self.pace.to_list(), dtype=np.float64)
        return {**self.loop.to_arrays(), _PACE: pace, _TURN: self.turn.to_array()}

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self.pace.take(arrays[_PACE].tolist())
        self.turn.take(arrays[_TURN])
        self.loop.take({name: array for name, array in arrays.items() if name not in (_PACE, _TURN)})


def couple(setup: Setup, body: Body, parts: Parts, tie: SeamTie, first: Floats | None) -> Coupling:
    """What ties two parts as an interface, and the loop that the scene asks for.

    first  multiplier that belongs to the parts' state (s, 3) [N], zero if absent

    Raises Unsuited where that loop cannot couple them.
    """
    seam, turn = setup.scene.seam, BodyTurn(keeps_momentum(setup.spec, setup.scene.models))
    (a, b), nodes = parts.names, np.arange(len(parts.seam), dtype=np.int32)
    built = LoopSetup(
        interfaces=(Interface(parts.interface, (a, b), (nodes, nodes), (None, tie.p), tie.c),),
        mobility={name: 1.0 / side_mass(body, parts.cells[name])[parts.seam] for name in (a, b)},
        tolerance=seam.tolerance * body.resolution,
        cell=body.resolution,
        exchanges=seam.exchanges,
        first=first,
    )
    return Coupling(LOOPS[seam.scheme](built), turn=turn)
