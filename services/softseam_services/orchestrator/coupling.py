"""What couples the parts of a cut for one epoch: the loop that the scene names, built from sides and their tie."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.loops import LOOPS
from softseam_coupling.loops.loop import Loop, LoopSetup, Unsuited
from softseam_coupling.mortar import SeamTie
from softseam_protocol.scene.regions import SeamSpec
from softseam_services.body.body import Body
from softseam_services.orchestrator.body_turn import BodyTurn
from softseam_services.orchestrator.sides import Sides, side_mass
from softseam_services.orchestrator.subdivision import Subdivision

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
        """Everything that evolves, for a snapshot."""
        pace = np.array(self.pace.to_list(), dtype=np.float64)
        return {**self.loop.to_arrays(), _PACE: pace, _TURN: self.turn.to_array()}

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self.pace.take(arrays[_PACE].tolist())
        self.turn.take(arrays[_TURN])
        self.loop.take({name: array for name, array in arrays.items() if name not in (_PACE, _TURN)})


def couple(seam: SeamSpec, body: Body, sides: Sides, tie: SeamTie, first: Floats | None) -> Coupling:
    """Sides as parts, what ties them as an interface, and the loop that the scene asks for.

    first  multiplier that belongs to the sides' state (s, 3) [N], zero if absent

    Raises Unsuited where that loop cannot couple them.
    """
    nodes = np.arange(len(sides.seam), dtype=np.int32)
    setup = LoopSetup(
        interfaces=(Interface(sides.interface, (sides.near, sides.far), (nodes, nodes), (None, tie.p), tie.c),),
        mobility={name: 1.0 / side_mass(body, sides.cells[name])[sides.seam] for name in (sides.near, sides.far)},
        tolerance=seam.tolerance * body.resolution,
        cell=body.resolution,
        exchanges=seam.exchanges,
        first=first,
    )
    return Coupling(LOOPS[seam.scheme](setup))
