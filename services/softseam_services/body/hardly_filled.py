"""Stress of octants that the body hardly fills: that of better filled ones around them.

An octant with next to nothing of the body in it has next to no stiffness, or the floor's (`filled.FILL_FLOOR`), so its
nodes go where tools and neighbours push them: its strain, and its stress, say nothing of the body. Where an octant is
filled by less than a tenth of what one of its 26 neighbours is, or by less than a hundredth, its stress sigma_o is

    sigma_o = sum_n f_n sigma_n / sum_n f_n                                                                        (1)

over its well-filled neighbours n of its own material, f their fills; those without such a neighbour take theirs after
it, ring by ring. A mean, so that no stress, nor any convex measure of it such as von Mises', exceeds that of all
well-filled octants: their peak is the field's. Well-filled octants keep what they have, to the bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from softseam_services.body.body import Body, Floats

_OF_NEIGHBOURS, _OF_WHOLE = 0.1, 0.01
_OCTANT = np.array([(o & 1, o >> 1 & 1, o >> 2 & 1) for o in range(8)], dtype=np.int32)


class HardlyFilled:
    """The octants of a body that it hardly fills: none of a block's."""

    def __init__(self, body: Body) -> None:
        self._octants = np.zeros(0, dtype=np.int64)
        fill = body.fill.reshape(-1)
        if not body.boxes or fill.min() == 1.0:
            return
        around, material = _octants_around(body), body.octant_material.reshape(-1)
        there = around >= 0
        alike = there & (material[around] == material[:, None])
        known = (fill >= _OF_NEIGHBOURS * np.where(alike, fill[around], 0.0).max(axis=1)) & (fill >= _OF_WHOLE)
        if not known.any():
            return
        self._octants = np.flatnonzero(~known)
        told: csr_array = diags_array(known.astype(np.float64), format="csr")
        for reach in (alike, there):  # those that no chain of their own material leads to take any
            while True:
                weight = np.where(reach & known[around], fill[around], 0.0)
                total = weight.sum(axis=1)
                ring = ~known & (total > 0.0)
                if not ring.any():
                    break
                row, place = np.nonzero(weight * ring[:, None])
                mean = (weight[row, place] / total[row], (row, around[row, place]))
                told = csr_array(told + csr_array(mean, shape=told.shape) @ told)
                known |= ring
        self._means = csr_array(told[self._octants])
        """from the stress of all octants to theirs, eq. (1)"""

    def replaced(self, cauchy: Floats) -> Floats:
        """Stress of all octants (C, 8, 6), by eq. (1) of those hardly filled; the array itself where there are none."""
        if not len(self._octants):
            return cauchy
        found = cauchy.reshape(-1, 6).copy()
        found[self._octants] = self._means @ found
        return found.reshape(cauchy.shape)


def _octants_around(body: Body) -> NDArray[np.int64]:
    """The octants of each one's 3 x 3 x 3 in the grid, its own among them, -1 for none (8 C, 27)."""
    at = (2 * body.cell_grid[:, None] + _OCTANT).reshape(-1, 3)
    at = at - at.min(axis=0) + 1
    number = np.full(at.max(axis=0) + 2, -1, dtype=np.int64)
    number[tuple(at.T)] = np.arange(len(at))
    around = at[:, None] + np.array(list(np.ndindex(3, 3, 3))) - 1
    return np.asarray(number[around[..., 0], around[..., 1], around[..., 2]])
