"""A tangent matrix too large to factor: conjugate gradients with two grids as preconditioner.

The coarse space is trilinear on the corners of the cells, which is nested in whatever lives on their 27 nodes, so that
coarse matrices are P^T A P whatever the element and material, contact and far side included. One cycle, symmetric:
  z = (D + L)^-1 r,   z += P A_c^-1 P^T (r - A z),   z += (D + L^T)^-1 (r - A z)                                (1)
A_c is factored by fronts. After the iteration one coarse correction more makes P^T (r - A x) vanish: P holds the
translations, so that the momentum of a free body is as exact as with a factor.
"""

from __future__ import annotations

import numpy as np

from softseam_services.fem.kernels.fronts import ALL, ROW, VALUES, add_seam_stiffness, solve
from softseam_services.fem.kernels.lapack import multiply
from softseam_services.fem.kernels.pair import factor
from softseam_services.fem.kernels.sparse import above, backward, dot, forward, invert_diagonal, product
from softseam_services.jit import njit

NONE, MULTIGRID, BLOCK_JACOBI, SWEEPS = 0, 1, 2, 3
"""kinds of solution: a factor of the matrix itself, or conjugate gradients with a preconditioner"""
_MOST = 1000


@njit(cache=True, error_model="numpy")
def coarse_matrix(tree, values, grid):
    """grid.values <- P^T A P, blocks of the lower triangle."""
    coarse, target = grid.tree, grid.values
    target[:] = 0.0
    for node in range(len(tree.meta)):
        m, at, row = 3 * tree.meta[node, ALL], tree.meta[node, VALUES], tree.meta[node, ROW]
        for e in range(m // 3):
            cell, one, two = tree.pair[row + e, 0], tree.pair[row + e, 1], tree.pair[row + e, 2]
            free = coarse.cell_free[cell]
            for p in range(grid.parents[one]):
                rank_p = coarse.cell_rank[cell, grid.parent[one, p]]
                if rank_p >= free:
                    continue
                for q in range(grid.parents[two]):
                    rank_q = coarse.cell_rank[cell, grid.parent[two, q]]
                    if rank_q >= free:
                        continue
                    w = grid.share[one, p] * grid.share[two, q]
                    source = at + 3 * e
                    # (q, p) is the block of row `two` and column `one`; where it lies above, its transpose lies below
                    if rank_q >= rank_p:
                        height = coarse.cell_height[cell, rank_p]
                        to = coarse.cell_column[cell, rank_p] + coarse.cell_row[cell, rank_p, rank_q]
                        for i in range(3):
                            for k in range(3):
                                target[to + i * height + k] += w * values[source + i * m + k]
                    if e > 0 and rank_p >= rank_q:
                        height = coarse.cell_height[cell, rank_q]
                        to = coarse.cell_column[cell, rank_q] + coarse.cell_row[cell, rank_q, rank_p]
                        for i in range(3):
                            for k in range(3):
                                target[to + i * height + k] += w * values[source + k * m + i]


@njit(cache=True, error_model="numpy")
def _coarse_seam(grid, stiffness):
    """Add P^T S P of the seam's stiffness S (3s, 3s), but for its diagonal blocks, to the coarse matrix."""
    grid.seam[:] = 0.0
    for a in range(len(stiffness) // 3):
        for p in range(grid.seam_ptr[a], grid.seam_ptr[a + 1]):
            for b in range(len(stiffness) // 3):
                if b == a:
                    continue
                for q in range(grid.seam_ptr[b], grid.seam_ptr[b + 1]):
                    w = grid.seam_share[p] * grid.seam_share[q]
                    for i in range(3):
                        for k in range(3):
                            to = 3 * grid.seam_node[p] + i, 3 * grid.seam_node[q] + k
                            grid.seam[to] += w * stiffness[3 * a + i, 3 * b + k]
    add_seam_stiffness(grid.tree, grid.values, grid.seam)


@njit(cache=True, error_model="numpy")
def prepare(tree, values, coupled, stiffness, seam_at, grid):
    """Get ready for solves with the matrix in `values`; False where it is seen not to be positive definite.

    The diagonal blocks of the seam's stiffness join `values`, so that the sweeps know how stiff the seam is.
    """
    if coupled:
        for a in range(len(seam_at)):
            at, m = tree.meta[seam_at[a], VALUES], 3 * tree.meta[seam_at[a], ALL]
            for i in range(3):
                for k in range(3):
                    values[at + i * m + k] += stiffness[3 * a + k, 3 * a + i]
    if not invert_diagonal(tree, values, grid.inverse):
        return False
    if tree.kind != MULTIGRID:
        return True
    coarse_matrix(tree, values, grid)
    if coupled:
        _coarse_seam(grid, stiffness)
    return factor(grid.tree, grid.values, grid.factoring) == 0


@njit(cache=True, error_model="numpy")
def _correct(grid, r, z, add):
    """z <- [z +] P A_c^-1 P^T r."""
    b = grid.b
    b[:] = 0.0
    for node in range(len(r) // 3):
        for e in range(grid.up_ptr[node], grid.up_ptr[node + 1]):
            w, to = grid.up_share[e], 3 * grid.up_node[e]
            b[to] += w * r[3 * node]
            b[to + 1] += w * r[3 * node + 1]
            b[to + 2] += w * r[3 * node + 2]
    solve(grid.tree, grid.values, b, grid.factoring)
    if not add:
        z[:] = 0.0
    for node in range(len(r) // 3):
        for e in range(grid.up_ptr[node], grid.up_ptr[node + 1]):
            w, at = grid.up_share[e], 3 * grid.up_node[e]
            z[3 * node] += w * b[at]
            z[3 * node + 1] += w * b[at + 1]
            z[3 * node + 2] += w * b[at + 2]


@njit(cache=True, error_model="numpy")
def _precondition(tree, values, grid, r, z):
    """z <- about A^-1 r, symmetric and positive definite."""
    if tree.kind == BLOCK_JACOBI:
        for node in range(len(r) // 3):
            d, i = grid.inverse[node], 3 * node
            for k in range(3):
                z[i + k] = d[k, 0] * r[i] + d[k, 1] * r[i + 1] + d[k, 2] * r[i + 2]
        return
    w, s = grid.w, grid.s
    for i in range(len(r)):
        w[i] = r[i]
    forward(tree, values, grid.inverse, w, z)
    if tree.kind == SWEEPS:
        product(tree, values, z, s)
        for i in range(len(r)):
            w[i] = r[i] - s[i]
        backward(tree, values, grid.inverse, w, s)
        for i in range(len(r)):
            z[i] += s[i]
        return
    above(tree, values, z, w)
    for i in range(len(r)):
        w[i] = -w[i]
    _correct(grid, w, s, False)
    for i in range(len(r)):
        z[i] += s[i]
    product(tree, values, s, grid.e)
    for i in range(len(r)):
        w[i] -= grid.e[i]
    backward(tree, values, grid.inverse, w, s)
    for i in range(len(r)):
        z[i] += s[i]


@njit(cache=True, error_model="numpy")
def apply_matrix(tree, values, grid, coupled, stiffness, seam_at, x, y, ints):
    """y <- (A + S) x with the seam's stiffness S where `coupled`; seam_at (s,) elimination places."""
    product(tree, values, x, y)
    if coupled:
        n = len(seam_at)
        for a in range(n):
            for i in range(3):
                grid.seam_x[3 * a + i, 0] = x[3 * seam_at[a] + i]
        multiply(stiffness, grid.seam_x, grid.seam_y, 3 * n, 1, 3 * n, False, ints)
        for a in range(n):
            for i in range(3):
                own = 0.0  # is in `values`
                for k in range(3):
                    own += stiffness[3 * a + i, 3 * a + k] * grid.seam_x[3 * a + k, 0]
                y[3 * seam_at[a] + i] += grid.seam_y[3 * a + i, 0] - own


@njit(cache=True, error_model="numpy")
def conjugate_gradients(tree, values, grid, coupled, stiffness, seam_at, tolerance, b, ints):
    """b <- x with (A + S) x = b to `tolerance` in the norm of the preconditioner; b (3 n_free,) updated in place.

    Returns the iterations; negative where the matrix is not positive definite, or after _MOST of them.
    """
    x, r, z, p, q = grid.x, grid.r, grid.z, grid.p, grid.q
    for i in range(len(b)):
        x[i] = 0.0
        r[i] = b[i]
    _precondition(tree, values, grid, r, z)
    for i in range(len(b)):
        p[i] = z[i]
    size = first = dot(r, z)
    if size == 0.0:
        return 0
    rounding = 1e-15 * np.sqrt(dot(b, b))
    for iteration in range(1, _MOST + 1):
        apply_matrix(tree, values, grid, coupled, stiffness, seam_at, p, q, ints)
        curvature = dot(p, q)
        if not (curvature > 0.0 and size > 0.0):
            return -iteration
        alpha = size / curvature
        for i in range(len(b)):
            x[i] += alpha * p[i]
            r[i] -= alpha * q[i]
        if tree.kind == MULTIGRID and np.sqrt(dot(r, r)) <= rounding:
            size = 0.0
        else:
            _precondition(tree, values, grid, r, z)
            last, size = size, dot(r, z)
        if abs(size) <= tolerance * tolerance * first:
            if tree.kind == MULTIGRID:
                _correct(grid, r, x, True)
            for i in range(len(b)):
                b[i] = x[i]
            return iteration
        beta = size / last
        for i in range(len(b)):
            p[i] = z[i] + beta * p[i]
    return -_MOST
