"""Multifrontal Cholesky A = L L^T along a tree of fronts, and solves with it.

A factored front holds W = [L11^-1; -L21 L11^-1] in its first columns, so that a solve is one product with W, then one
with its transpose, a front: y_own = L11^-1 b_own, b_boundary += -L21 y_own; x_own = W^T [y_own; x_boundary].

A front of m nodes is a column-major 3m x 3m block of `values`; its first columns belong to the nodes it eliminates.
Factoring adds each front's Schur complement to its parent's front. `tree` is a `dissection.Tree`.
"""

from __future__ import annotations

from numba import njit

from softseam_services.fem.kernels.lapack import (
    apply_panel,
    apply_panel_transposed,
    factor_panel,
    inverse_from_panel,
)


@njit(cache=True, error_model="numpy")
def add_diagonal(tree, values, diagonal, scale):
    """Add scale * diagonal[node] to the three diagonal entries of each free node; diagonal (n,), updated in
    place."""
    for node in range(len(diagonal)):
        place = tree.position[node]
        if place < 0:
            continue
        front = tree.own_front[place]
        m = 3 * tree.meta[front, 2]
        start = tree.meta[front, 4] + 3 * (place - tree.meta[front, 0]) * (m + 1)
        value = scale * diagonal[node]
        values[start] += value
        values[start + m + 1] += value
        values[start + 2 * m + 2] += value


@njit(cache=True, error_model="numpy")
def add_seam_stiffness(tree, values, stiffness):
    """Add stiffness (3s, 3s) to the seam's rows and columns, the trailing ones of its front; `values` in place."""
    for group in range(len(tree.seam_front)):
        front = tree.seam_front[group]
        start, end = tree.seam_ptr[group], tree.seam_ptr[group + 1]
        m = 3 * tree.meta[front, 2]
        first = 3 * (tree.meta[front, 1] - (end - start))
        for b in range(start, end):
            for k in range(3):
                column = tree.meta[front, 4] + (first + 3 * (b - start) + k) * m + first
                for a in range(b, end):
                    for i in range(k if a == b else 0, 3):
                        values[column + 3 * (a - start) + i] += stiffness[
                            3 * tree.seam_index[a] + i, 3 * tree.seam_index[b] + k
                        ]


@njit(cache=True, error_model="numpy")
def factor(tree, values, ints):
    """Factor all fronts in place; returns 0, or 1 + the front where the matrix is not positive definite."""
    for front in range(len(tree.meta)):
        n_own, n_all, parent = tree.meta[front, 1], tree.meta[front, 2], tree.meta[front, 3]
        offset, row = tree.meta[front, 4], tree.meta[front, 5]
        m = 3 * n_all
        if factor_panel(values, offset, m, 3 * n_own, ints) != 0:
            return 1 + front
        if parent < 0:
            continue
        m_parent = 3 * tree.meta[parent, 2]
        target = tree.meta[parent, 4]
        for b in range(n_own, n_all):
            column_b = 3 * tree.to_parent[row + b]
            for k in range(3):
                column = target + (column_b + k) * m_parent
                source = offset + (3 * b + k) * m
                for a in range(b, n_all):
                    to = column + 3 * tree.to_parent[row + a]
                    at = source + 3 * a
                    values[to] += values[at]
                    values[to + 1] += values[at + 1]
                    values[to + 2] += values[at + 2]
    return 0


@njit(cache=True, error_model="numpy")
def solve(tree, values, b, t, ints):
    """b <- A^-1 b in elimination order; b (3 n_free,) updated in place, t (3 widest,) scratch."""
    n_fronts = len(tree.meta)
    for front in range(n_fronts):
        first, n_own, n_all = 3 * tree.meta[front, 0], 3 * tree.meta[front, 1], 3 * tree.meta[front, 2]
        offset, row = tree.meta[front, 4], tree.meta[front, 5]
        if n_own == 0:
            continue
        apply_panel(values, offset, n_all, n_own, b, first, t, ints)
        for i in range(n_own):
            b[first + i] = t[i]
        for i in range(n_own, n_all, 3):
            to = 3 * tree.rows[row + i // 3]
            b[to] += t[i]
            b[to + 1] += t[i + 1]
            b[to + 2] += t[i + 2]
    for front in range(n_fronts - 1, -1, -1):
        first, n_own, n_all = 3 * tree.meta[front, 0], 3 * tree.meta[front, 1], 3 * tree.meta[front, 2]
        offset, row = tree.meta[front, 4], tree.meta[front, 5]
        if n_own == 0:
            continue
        for i in range(n_own):
            t[i] = b[first + i]
        for i in range(n_own, n_all, 3):
            at = 3 * tree.rows[row + i // 3]
            t[i] = b[at]
            t[i + 1] = b[at + 1]
            t[i + 2] = b[at + 2]
        apply_panel_transposed(values, offset, n_all, n_own, t, b, first, ints)


@njit(cache=True, error_model="numpy")
def seam_inverse(tree, values, block, inverse, ints):
    """inverse (3s, 3s) <- seam rows and columns of A^-1, updated in place.

    The seam nodes end the last front of their component, so (A^-1)_ss = (L_s L_s^T)^-1; components do not interact.
    block (at least the square of 3 times the largest component's seam,) scratch
    """
    inverse[:] = 0.0
    for group in range(len(tree.seam_front)):
        front = tree.seam_front[group]
        start, end = tree.seam_ptr[group], tree.seam_ptr[group + 1]
        n = 3 * (end - start)
        first = 3 * tree.meta[front, 1] - n
        inverse_from_panel(values, tree.meta[front, 4], 3 * tree.meta[front, 2], first, n, block, ints)
        for a in range(start, end):
            for b in range(start, end):
                for i in range(3):
                    for k in range(3):
                        at = (3 * (a - start) + i) * n + 3 * (b - start) + k
                        inverse[3 * tree.seam_index[a] + i, 3 * tree.seam_index[b] + k] = block[at]
