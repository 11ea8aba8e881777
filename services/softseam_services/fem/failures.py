"""Why a step of FEM failed, in a word and in words, and what is to be doubted of one that did not."""

import numpy as np

from softseam_protocol.messages.outcomes import Status
from softseam_services.body.body import Floats, Ints

from .kernels.newton import INDEFINITE, LEAST_J, NOT_FINITE, STALLED, WORST_CELL
from .kernels.point_volumes import loses_volume
from .model import FemModel
from .work import Work

STATUS = {
    STALLED: Status.UNCONVERGED,
    INDEFINITE: Status.UNCONVERGED,
    NOT_FINITE: Status.DIVERGED,
}
"""by what `kernels.newton` returns"""

_FAILURES = {
    STALLED: "Newton's method did not converge",
    INDEFINITE: "the stiffness matrix stayed indefinite",
    NOT_FINITE: "forces grew beyond all bounds",
}


def why(status: int, memo: Floats, cells: Ints, divided: bool) -> str:
    """What happened, where it was worst, and what may help.

    status   of `kernels.newton`
    memo     (N_MEMO,) of the last Newton's method
    cells    global ids of the region's cells (c,)
    divided  the step was also tried in parts
    """
    cell = int(memo[WORST_CELL])
    where = f"cell {cells[cell]} (J = {memo[LEAST_J]:.3g})" if cell >= 0 else "no cell"
    also = ", also in 32 sub-steps" if divided else ""
    return (
        f"{_FAILURES[status]}{also}; worst is {where}: shorten the step, move the tools more slowly, or refine the "
        "cells there"
    )


_ALONG = 5
"""points that a cell is looked at in along each axis, from face to face"""


def _slopes() -> Floats:
    """Derivatives of the 27 shape functions along x, y and z of a cell from -1 to 1, x fastest (125, 3, 27) [1]."""
    t = np.linspace(-1.0, 1.0, _ALONG)
    value = np.stack([0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)], axis=1)  # (point, node)
    slope = np.stack([t - 0.5, -2.0 * t, t + 0.5], axis=1)
    of_axis = [[slope if axis == along else value for axis in range(3)] for along in range(3)]
    found = [np.einsum("zc,yb,xa->zyxcba", z, y, x).reshape(-1, 27) for x, y, z in of_axis]
    return np.ascontiguousarray(np.stack(found, axis=1))


SLOPES = _slopes()


def alarm(x: Floats, model: FemModel, work: Work, times: int) -> str:
    """What is wrong with cells that have a point without positive volume at a step's end x (n, 3); '' where none has.

    Only whole cells that are crushed or lose volume between points of split quadrature are looked at.

    times  times that each cell stands for one of the body
    """
    if not (work.mixed[0] or work.watches[0]) or not loses_volume(model):
        return ""
    cells = np.flatnonzero(model.whole & ((work.full > 0.0) | work.watched))
    places = x[model.cell_nodes[cells]]
    volume = np.linalg.det(SLOPES @ places[:, np.newaxis])  # of each point, in the cell's own measure
    count = times * int((volume.min(axis=1, initial=np.inf) <= 0.0).sum())
    if not count:
        return ""
    return f"{count} cells are inside out, the forces are wrong: squeeze less, move the tools slowly, or start anew"
