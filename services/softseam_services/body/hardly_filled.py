"""Stress of octants that the body hardly fills: that of better filled ones around them.

An octant with next to nothing of the body in it has next to no stiffness, or the floor's (`filled.FILL_FLOOR`), so its
nodes go where tools and neighbours push them: its strain, and its stress, say nothing of the body. Where an octant is
filled by less than `slivers.THIN` of what one of its 26 neighbours is, or by less than a hundredth, its stress is

    sigma_o = sum_n f_n sigma_n / sum_n f_n                                                                        (1)

over its well-filled neighbours n of its own material, f their fills; those without such a neighbour take theirs after
it, ring by ring. A mean, so that no stress, nor any convex measure of it such as von Mises', exceeds that of all
well-filled octants: their peak is the field's. Well-filled octants keep what they have, to the bit.
"""

import numpy as np
from scipy.sparse import csr_array, diags_array

from softseam_services.body.body import Body, Floats
from softseam_services.body.lattice import octants_around
from softseam_services.body.slivers import THIN

_OF_WHOLE = 0.01


class HardlyFilled:
    """The octants of a body that it hardly fills: none of a block's."""

    def __init__(self, body: Body) -> None:
        self._octants = np.zeros(0, dtype=np.int64)
        fill = body.fill.reshape(-1)
        if not body.boxes or fill.min() == 1.0:
            return
        around, material = octants_around(body.cell_grid), body.octant_material.reshape(-1)
        there = around >= 0
        alike = there & (material[around] == material[:, None])
        known = (fill >= THIN * np.where(alike, fill[around], 0.0).max(axis=1)) & (fill >= _OF_WHOLE)
        if not known.any():
            return
        self._octants = np.flatnonzero(~known)
        reached: csr_array = diags_array(known.astype(np.float64), format="csr")
        for reach in (alike, there):  # those that no chain of their own material leads to take any
            while True:
                weight = np.where(reach & known[around], fill[around], 0.0)
                total = weight.sum(axis=1)
                ring = ~known & (total > 0.0)
                if not ring.any():
                    break
                row, place = np.nonzero(weight * ring[:, None])
                mean = (weight[row, place] / total[row], (row, around[row, place]))
                reached = csr_array(reached + csr_array(mean, shape=reached.shape) @ reached)
                known |= ring
        self._means = csr_array(reached[self._octants])
        """from the stress of all octants to theirs, eq. (1)"""

    def replaced(self, cauchy: Floats) -> Floats:
        """Stress of all octants (C, 8, 6), by eq. (1) of those hardly filled; the array itself where there are none."""
        if not len(self._octants):
            return cauchy
        found = cauchy.reshape(-1, 6).copy()
        found[self._octants] = self._means @ found
        return found.reshape(cauchy.shape)
