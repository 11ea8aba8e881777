"""Why a step of FEM failed, in a word and in words."""

from softseam_protocol.messages.outcomes import Status
from softseam_services.body.body import Floats, Ints

from .kernels.newton import INDEFINITE, LEAST_J, NOT_FINITE, STALLED, WORST_CELL

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
