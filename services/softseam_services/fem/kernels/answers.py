"""How some nodes answer to forces on them: rows and columns of A^-1, from a factor in any order of elimination.

Of A = L L^T and the nodes' unit vectors E, E^T A^-1 E = X^T X with X = L^-1 E. A unit vector fills only rows of fronts
above its own: each front is descended with the columns alone that come from its subtree.
"""

import numpy as np

from softseam_services.jit import njit

from .fronts import ALL, CHILD, FIRST, OWN, ROW, SIBLING, VALUES
from .panel import STRIP, descend_many


@njit(cache=True, error_model="numpy", nogil=True)
def descend_units(tree, values, places, ints):
    """X of the module, transposed (3a, 3 n_free), for nodes at these places in the order, ascending (a,)."""
    meta, n = tree.meta, len(places)
    found = np.zeros((3 * n, 3 * len(tree.own_front)))
    for column in range(3 * n):
        found[column, 3 * places[column // 3] + column % 3] = 1.0
    begins = np.empty(len(meta), dtype=np.int64)  # first place of each front's subtree
    t, s = np.empty(9 * tree.widest * n), np.empty(3 * STRIP * n)
    for front in range(len(meta)):
        first, own, row = meta[front, FIRST], meta[front, OWN], meta[front, ROW]
        begins[front], child = first, meta[front, CHILD]
        while child >= 0:
            begins[front] = min(begins[front], begins[child])
            child = meta[child, SIBLING]
        low = 3 * np.searchsorted(places, begins[front])
        c = 3 * np.searchsorted(places, first + own) - low
        if c == 0:
            continue
        k, m = 3 * own, 3 * meta[front, ALL]
        for j in range(c):
            for i in range(k):
                t[j * m + i] = found[low + j, 3 * first + i]
            for i in range(k, m):
                t[j * m + i] = 0.0
        descend_many(values, meta[front, VALUES], m, k, c, t, s, ints)
        for j in range(c):
            for i in range(k):
                found[low + j, 3 * first + i] = t[j * m + i]
            for i in range(k, m, 3):
                to = 3 * tree.rows[row + i // 3]
                for x in range(3):
                    found[low + j, to + x] += t[j * m + i + x]
    return found
