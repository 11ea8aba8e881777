"""Multifrontal Cholesky A = L L^T along a tree of fronts, and solves with it.

`values` holds the panels (panel.py) of all fronts: A is assembled into them, each entry into the panel of the front
that eliminates its earlier node. A front adds to its panel what its children left over, eliminates its own rows, and
leaves over its Schur complement: the sum of -L2 L2^T and of the children's other rows. Those blocks live in `rest`,
at places that are used again: they stay in the cache, and need a small part of the memory that whole fronts would.
`tree` is a `tree.Tree`.
"""

from softseam_services.jit import njit

from .lapack import product
from .panel import ascend, descend, factor_panel, inverse_triangle

LANES = 32
"""nodes of a cell, padded so that loops over them fill vector registers"""
# columns of tree.meta
FIRST, OWN, ALL, PARENT, VALUES, ROW, REST, CHILD, SIBLING, RUN, RUN_END = range(11)

_HELD = 1e15
"""what is held takes part with this share of rounding"""


@njit(cache=True, error_model="numpy")
def add_diagonal(tree, values, diagonal, scale):
    """Add scale * diagonal[node] to the three diagonal entries of each free node; diagonal (n,), values in place."""
    for node in range(len(diagonal)):
        place = tree.position[node]
        if place < 0:
            continue
        front = tree.own_front[place]
        m = 3 * tree.meta[front, ALL]
        start = tree.meta[front, VALUES] + 3 * (place - tree.meta[front, FIRST]) * (m + 1)
        value = scale * diagonal[node]
        values[start] += value
        values[start + m + 1] += value
        values[start + 2 * m + 2] += value


@njit(cache=True, error_model="numpy")
def add_block_row(tree, values, cell, a, row, lanes):
    """Add the blocks (a, b), b >= a, of a cell's matrix; row[(3 i + k) lanes + b] its entry (a i, b k).

    a and b count the cell's free nodes in elimination order, see `Tree.cell_local`. By symmetry a row of blocks is a
    column of the lower triangle, so it is written downwards. `values` in place
    """
    start, height, places = tree.cell_column[cell, a], tree.cell_height[cell, a], tree.cell_row[cell, a]
    n_free = tree.cell_free[cell]
    for i in range(3):
        column = start + i * height
        at = 3 * i * lanes
        for b in range(a, n_free):
            to = column + places[b]
            values[to] += row[at + b]
            values[to + 1] += row[at + lanes + b]
            values[to + 2] += row[at + 2 * lanes + b]


@njit(cache=True, error_model="numpy")
def add_block(tree, values, cell, a, b, weight, block):
    """Add weight * block, a symmetric (3, 3), at the nodes a and b of a cell, counted as in `add_block_row`, a <= b."""
    start, height = tree.cell_column[cell, a] + tree.cell_row[cell, a, b], tree.cell_height[cell, a]
    for i in range(3):
        for k in range(3):
            values[start + i * height + k] += weight * block[i, k]


@njit(cache=True, error_model="numpy")
def add_seam_stiffness(tree, values, stiffness):
    """Add stiffness (3s, 3s) to the last front, which owns the seam's nodes; `values` in place."""
    n = len(tree.seam_place)
    if n == 0:
        return
    front = tree.seam_front
    m = 3 * tree.meta[front, ALL]
    offset = tree.meta[front, VALUES]
    for b in range(n):
        for k in range(3):
            column = offset + (3 * tree.seam_place[b] + k) * m
            for a in range(n):
                if tree.seam_place[a] >= tree.seam_place[b]:
                    to = column + 3 * tree.seam_place[a]
                    for i in range(3):
                        values[to + i] += stiffness[3 * a + i, 3 * b + k]


@njit(cache=True, error_model="numpy")
def hold(tree, values, rollers):
    """Make the diagonal of each node and axis in rollers (h, 2) so large that it does not move; `values` in place."""
    for h in range(len(rollers)):
        place = tree.position[rollers[h, 0]]
        if place >= 0:
            front = tree.own_front[place]
            m = 3 * tree.meta[front, ALL]
            own = 3 * (place - tree.meta[front, FIRST]) + rollers[h, 1]
            values[tree.meta[front, VALUES] + own * (m + 1)] *= _HELD


@njit(cache=True, error_model="numpy")
def _add_to_panel(meta, runs, values, rest, child, front):
    """Add the rows and columns of a child's rest that `front` eliminates."""
    n_own, m = meta[front, OWN], 3 * meta[front, ALL]
    offset, source = meta[front, VALUES], meta[child, REST]
    size = 3 * (meta[child, ALL] - meta[child, OWN])
    last = meta[child, RUN_END]
    for one in range(meta[child, RUN], last):
        own = min(runs[one, 1], n_own - runs[one, 2])
        for b in range(3 * own):
            at = source + (3 * runs[one, 0] + b) * size
            to = offset + (3 * runs[one, 2] + b) * m
            for other in range(one, last):
                below = b if other == one else 0
                start = 3 * runs[other, 0]
                shift = to + 3 * runs[other, 2] - at - start
                for i in range(at + start + below, at + start + 3 * runs[other, 1]):
                    values[i + shift] += rest[i]
        if own < runs[one, 1]:
            return


@njit(cache=True, error_model="numpy")
def _add_to_rest(meta, runs, rest, child, front):
    """Add the rows and columns of a child's rest that `front` leaves over, too."""
    n_own, m = meta[front, OWN], 3 * (meta[front, ALL] - meta[front, OWN])
    offset, source = meta[front, REST], meta[child, REST]
    size = 3 * (meta[child, ALL] - meta[child, OWN])
    last = meta[child, RUN_END]
    for one in range(meta[child, RUN], last):
        own = 3 * max(0, min(runs[one, 1], n_own - runs[one, 2]))
        for b in range(own, 3 * runs[one, 1]):
            at = source + (3 * runs[one, 0] + b) * size
            to = offset + (3 * (runs[one, 2] - n_own) + b) * m
            for other in range(one, last):
                below = b if other == one else 0
                start = 3 * runs[other, 0]
                shift = to + 3 * (runs[other, 2] - n_own) - at - start
                for i in range(at + start + below, at + start + 3 * runs[other, 1]):
                    rest[i + shift] += rest[i]


@njit(cache=True, error_model="numpy")
def factor(tree, values, scratch):
    """Factor all fronts in place; returns 0, or 1 + the one where the matrix is not positive definite."""
    meta, runs, rest = tree.meta, tree.runs, scratch.rest
    tile, strip, ints = scratch.tile, scratch.strip, scratch.ints
    for front in range(len(meta)):
        child = meta[front, CHILD]
        while child >= 0:
            _add_to_panel(meta, runs, values, rest, child, front)
            child = meta[child, SIBLING]
        k, m = 3 * meta[front, OWN], 3 * meta[front, ALL]
        if not factor_panel(values, meta[front, VALUES], m, k, rest, meta[front, REST], tile, strip, ints):
            return 1 + front
        if m > k:
            child = meta[front, CHILD]
            while child >= 0:
                _add_to_rest(meta, runs, rest, child, front)
                child = meta[child, SIBLING]
    return 0


@njit(cache=True, error_model="numpy")
def solve(tree, values, b, scratch):
    """b <- A^-1 b in elimination order; b (3 n_free,) updated in place."""
    meta, t, s, ints = tree.meta, scratch.t, scratch.tile, scratch.ints
    for front in range(len(meta)):
        first, k, m = 3 * meta[front, FIRST], 3 * meta[front, OWN], 3 * meta[front, ALL]
        row = meta[front, ROW]
        for i in range(k):
            t[i] = b[first + i]
        for i in range(k, m):
            t[i] = 0.0
        descend(values, meta[front, VALUES], m, k, t, s, ints)
        for i in range(k):
            b[first + i] = t[i]
        for i in range(k, m, 3):
            to = 3 * tree.rows[row + i // 3]
            b[to] += t[i]
            b[to + 1] += t[i + 1]
            b[to + 2] += t[i + 2]
    _ascend_all(tree, values, b, t, s, ints)


@njit(cache=True, error_model="numpy")
def _ascend_all(tree, values, b, t, s, ints):
    """b <- L^-T b, from the last front to the first."""
    meta = tree.meta
    for front in range(len(meta) - 1, -1, -1):
        first, k, m = 3 * meta[front, FIRST], 3 * meta[front, OWN], 3 * meta[front, ALL]
        row = meta[front, ROW]
        for i in range(k):
            t[i] = b[first + i]
        for i in range(k, m, 3):
            at = 3 * tree.rows[row + i // 3]
            t[i] = b[at]
            t[i + 1] = b[at + 1]
            t[i + 2] = b[at + 2]
        ascend(values, meta[front, VALUES], m, k, t, s, ints)
        for i in range(k):
            b[first + i] = t[i]


@njit(cache=True, error_model="numpy")
def solve_seam(tree, values, b, scratch):
    """`solve` for a b that is zero but at the seam's nodes; where the last front owns these, the same bits in half the
    time."""
    meta, t, s, ints = tree.meta, scratch.t, scratch.tile, scratch.ints
    last = tree.seam_front
    if last < 0:
        solve(tree, values, b, scratch)
        return
    first, k = 3 * meta[last, FIRST], 3 * meta[last, OWN]
    for i in range(k):
        t[i] = b[first + i]
    descend(values, meta[last, VALUES], k, k, t, s, ints)
    for i in range(k):
        b[first + i] = t[i]
    _ascend_all(tree, values, b, t, s, ints)


@njit(cache=True, error_model="numpy", nogil=True)
def seam_root(tree, values, block, root, ints):
    """root (3s, 3s) <- R, the seam's rows of A^-1 in its columns being R R^T; updated in place, block as below."""
    n = 3 * len(tree.seam_place)
    if n == 0:
        return
    inverse_triangle(values, tree.meta[tree.seam_front, VALUES], n, block[0], ints)
    for a in range(len(tree.seam_place)):
        for i in range(3):
            column = (3 * tree.seam_place[a] + i) * n
            for j in range(n):
                root[3 * a + i, j] = block[0, column + j]


@njit(cache=True, error_model="numpy")
def seam_inverse(tree, values, block, inverse, ints):
    """inverse (3s, 3s) <- seam rows and columns of A^-1, updated in place; block (2, 9 s^2) scratch.

    The last front owns the seam's nodes and nothing else, so (A^-1)_ss = L_s^-T L_s^-1.
    """
    n = 3 * len(tree.seam_place)
    if n == 0:
        return
    inverse_triangle(values, tree.meta[tree.seam_front, VALUES], n, block[0], ints)
    for j in range(n):
        for i in range(n):
            block[1, i * n + j] = block[0, j * n + i]
    # rows of L^-T in block[1] are columns of L^-1: (L^-T)(L^-T)^T
    product(n, n, n, 1, block[1], 0, n, block[1], 0, n, True, False, block[0], 0, n, ints)
    for a in range(len(tree.seam_place)):
        for b in range(len(tree.seam_place)):
            at = 3 * tree.seam_place[a] * n + 3 * tree.seam_place[b]
            for i in range(3):
                for k in range(3):
                    inverse[3 * a + i, 3 * b + k] = block[0, at + i * n + k]
