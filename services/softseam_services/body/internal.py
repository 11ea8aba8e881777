"""What a material with internal state remembers in the cells of a part, as it is handed over between solvers.

It is the n numbers of the law in each octant of a cell, whatever solver has the cell: along the axes of the body at
rest, of no element and no block.
"""

import numpy as np

from softseam_protocol.messages.participant import BodyState
from softseam_services.body.body import Body, Floats, Ints


def internal_of(body: Body, state: BodyState | None, cells: Ints) -> Floats:
    """The numbers in these cells (c, 8, n), of a state of the whole body; zeros where it brings none.

    Raises ValueError where it brings another count of numbers, or those of another count of cells.
    """
    n = body.material.n_state
    if state is None or state.internal.size == 0:
        return np.zeros((len(cells), 8, n))
    if state.internal.shape != (body.n_cells, 8, n):
        raise ValueError(
            f"the state has {state.internal.shape[2]} internal numbers in an octant of {len(state.internal)} cells, "
            f"{body.material.kind} has {n} in an octant of {body.n_cells}: send those of this body, or none"
        )
    return np.ascontiguousarray(state.internal[cells])
