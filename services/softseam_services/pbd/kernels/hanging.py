"""Nodes that hang on others, see `levels`: they follow once a step, for nothing within a step looks at them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.jit import njit, record


@record
class Hanging(NamedTuple):
    """Sparse rows: node[i] is the sum of weight * that of master over indptr[i] .. indptr[i + 1] - 1."""

    node: NDArray[np.int32]
    """(k,)"""
    indptr: NDArray[np.int32]
    """(k + 1,)"""
    master: NDArray[np.int32]
    weight: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def follow(x, v, hanging):
    """Places and velocities (n, 3) of the nodes that hang; updated in place."""
    for at in range(len(hanging.node)):
        i = hanging.node[at]
        for c in range(3):
            place = speed = 0.0
            for entry in range(hanging.indptr[at], hanging.indptr[at + 1]):
                place += hanging.weight[entry] * x[hanging.master[entry], c]
                speed += hanging.weight[entry] * v[hanging.master[entry], c]
            x[i, c], v[i, c] = place, speed
