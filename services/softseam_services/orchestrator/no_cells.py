"""A body without cells: one region, which no tool divides."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Advanced, Fields
from softseam_protocol.models import PARTICLES_DEFAULT
from softseam_services.orchestrator.near_cells import Unmet
from softseam_services.orchestrator.sides import Sides


class NoCells:
    """Stands for `NearCells` where there are no cells."""

    model = PARTICLES_DEFAULT
    looks_for = (False, False)
    looks_for_goal = False
    enough = ""
    unmet = Unmet(0, 0, 0)
    neighbours: NDArray[np.int32] = np.zeros((0, 6), dtype=np.int32)

    def __init__(self) -> None:
        self.mask: NDArray[np.bool_] = np.zeros(0, dtype=np.bool_)

    def reset(self) -> None:
        """Nothing evolves."""

    def follow(
        self,
        sides: Sides,
        replies: Mapping[str, Advanced],
        seen: Mapping[str, Fields] | None = None,
        blame: NDArray[np.float64] | None = None,
    ) -> str:
        """Never a reason to switch."""
        return ""

    def refused(self) -> None:
        """Nothing switches."""

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        return {"cut": np.zeros(0, dtype=np.int32)}

    def take(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Nothing evolves."""
