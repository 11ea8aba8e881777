"""Two models that overlap in a layer, where they share the energy and are glued: a seam that has a thickness.

In the layer the near side keeps a share alpha of the mass and stiffness of each cell, the far side 1 - alpha, and
multipliers tie the displacements of both at the near side's nodes there:

    E = sum_near alpha_e E_e + sum_far (1 - alpha_e) E_e,   L_near u_near + L_far u_far = 0                    (1)

(H. Ben Dhia, G. Rateau, Int. J. Numer. Meth. Engng 62, 2005, 1442-1462, doi:10.1002/nme.1229). With sides and links of
this form any scheme of analysis.linear_study couples them; position continuity with a constant multiplier does
no work and does not drift. A study so far: the running loop has no overlap.

alpha is constant in each cell of the coarser side, and goes down by equal steps. Where it varies within such a cell, as
the ramp of the textbooks does, the finer cells between two tied nodes are springs of unequal stiffness in a row: they
yield more than their mean says, constant strain does not pass, and the layer reflects more than a sharp seam.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.linear_study.integrators import LinearSide

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Cells:
    """One side's cells, k nodes each; e cells."""

    nodes: Ints
    """(e, k)"""
    mass: Floats
    """lumped at each node (e, k) [kg]"""
    stiffness: Floats
    """(e, k, k) [N/m]"""
    share: Floats
    """of its energy that a cell keeps, in (0, 1] (e,) [1]"""

    def assembled(self) -> tuple[Floats, Floats]:
        """Mass and stiffness (n, n)."""
        if not ((self.share > 0.0) & (self.share <= 1.0)).all():
            raise ValueError("a cell's share must lie in (0, 1]: one without energy has nodes that nothing holds")
        n = int(self.nodes.max()) + 1
        mass, stiffness = np.zeros(n), np.zeros((n, n))
        np.add.at(mass, self.nodes, self.share[:, None] * self.mass)
        np.add.at(
            stiffness,
            (self.nodes[:, :, None], self.nodes[:, None, :]),
            self.share[:, None, None] * self.stiffness,
        )
        return np.diag(mass), stiffness


def shares(n_cells: int) -> Floats:
    """alpha of the layer's coarse cells, from the near side to the far side: 1 - (i + 1/2)/n (n,) [1]."""
    return 1.0 - (np.arange(n_cells) + 0.5) / n_cells


def overlapping(near: Cells, far: Cells, tied: Ints) -> tuple[LinearSide, LinearSide]:
    """Both sides of eq. (1); tied (s, 2): nodes of the near and of the far side that are at the same place."""
    sides = []
    for cells, ids, sign in ((near, tied[:, 0], 1.0), (far, tied[:, 1], -1.0)):
        mass, stiffness = cells.assembled()
        link = np.zeros((len(tied), len(mass)))
        link[np.arange(len(tied)), ids] = sign
        sides.append(LinearSide(mass, stiffness, link))
    return sides[0], sides[1]
