"""Which cells have a reason to be near, counted step by step."""

from softseam_coupling.kept_kernels import njit


@njit(cache=True, error_model="numpy")
def count_reasons(
    distance, ahead, urgency, kept, pinned, near, within, release, may_lower, patience, idle, wanted, reason
):  # fmt: skip
    """Mark the cells with a reason to be near and count the steps since; whether any cell is to be raised or let go.

    distance, ahead  (C,)  least distance to a tool, now and soon [m]
    urgency          (C,)  above 1 a cell is wanted near, a near one has a reason above `kept`
    pinned, near     (C,)  cells that are always near, that are near now
    within, release        distances that make a cell near and that let it go [m]
    may_lower              whether cells may be let go in this step
    patience               steps that a cell stays near after its last reason
    idle             (C,)  steps since each cell's last reason, updated in place
    wanted, reason   (C,)  out
    """
    moves = False
    for cell in range(len(distance)):
        wanted[cell] = pinned[cell] or ahead[cell] < within or urgency[cell] > 1.0
        reason[cell] = wanted[cell] or (near[cell] and (distance[cell] < release or urgency[cell] > kept))
        idle[cell] = 0 if reason[cell] else idle[cell] + 1
        if near[cell]:
            moves |= may_lower and idle[cell] >= patience
        else:
            moves |= wanted[cell]
    return moves
