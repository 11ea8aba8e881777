"""The force that settles the far side: it moves its image as a round asks for, with the impulse that it has to have."""

from __future__ import annotations

import numpy as np

from softseam_coupling.kept_kernels import njit
from softseam_coupling.kernels.learned_line import dot, multiply_one, multiply_symmetric
from softseam_coupling.kernels.quasi_newton import largest_node

LEAST_PIVOT = 1e-10
"""of a motion's own stiffness, below which it is one of the motions before it [1]"""


@njit(cache=True, error_model="numpy")
def solve_semidefinite(matrix, b):
    """b (k,) <- z with matrix z = b, for a symmetric positive semi-definite matrix (k, k) and a b in its range.

    Unknowns that others stand for, as turns about the line on which all nodes lie, are zero. Both updated in place.
    """
    k = len(b)
    whole = np.empty(k)
    for c in range(k):
        whole[c] = matrix[c, c]
    for c in range(k):
        if not matrix[c, c] > LEAST_PIVOT * whole[c]:
            matrix[c, c] = 0.0
            continue
        for r in range(c + 1, k):
            factor = matrix[r, c] / matrix[c, c]
            for j in range(c, k):
                matrix[r, j] -= factor * matrix[c, j]
            b[r] -= factor * b[c]
    for c in range(k - 1, -1, -1):
        if matrix[c, c] == 0.0:
            b[c] = 0.0
            continue
        for j in range(c + 1, k):
            b[c] -= matrix[c, j] * b[j]
        b[c] /= matrix[c, c]


@njit(cache=True, error_model="numpy")
def balance(force, wanted, x, stiffness):
    """Give `force` (n,) [N], in place, the resultant and the moment of `wanted` (n,) [N], at least energy.

    Rigid motions T (n, 6) of the seam at x (n,) [m] cost S T, with S = stiffness (n, n) [N/m]:

        force += S T (T^T S T)^-1 T^T (wanted - force)                                                              (1)
    """
    n = len(x)
    rigid, costs, missing = np.zeros((6, n)), np.empty((6, n)), np.empty(n)
    for axis in range(3):
        middle = 0.0
        for i in range(axis, n, 3):
            middle += x[i]
            rigid[axis, i] = 1.0
        middle /= n // 3
        one, other = (axis + 1) % 3, (axis + 2) % 3
        for i in range(0, n, 3):  # the arm along this axis, turned about the two others
            arm = x[i + axis] - middle
            rigid[3 + one, i + other] = -arm
            rigid[3 + other, i + one] = arm
    multiply_symmetric(stiffness, rigid, costs)
    share, system = np.empty(6), np.empty((6, 6))
    for _ in range(2):  # the second takes what the first rounds off
        for i in range(n):
            missing[i] = wanted[i] - force[i]
        for r in range(6):
            share[r] = dot(rigid[r], missing)
            for c in range(6):
                system[r, c] = dot(rigid[r], costs[c])
        solve_semidefinite(system, share)
        for r in range(6):
            for i in range(n):
                force[i] += share[r] * costs[r, i]


@njit(cache=True, error_model="numpy")
def push_far(bent, free, change, image, stiffness, p, yields, x_near, moved_near, force, moved):
    """The far side's nodal forces that belong to `bent` on its image, how they move it, and the gap that is left.

    bent                (n,)    force on the image [N], balanced in place
    free                        whether it is to have the impulse of the multiplier's `change` (n,) [N] exactly
    image               (n,)    of the far side as it was solved, P x_far + c [m]
    stiffness           (n, n)  S [N/m]
    p                   (s, s)  P of the tie, or empty where nodes are tied one by one
    yields              (n, n)  H_far transposed [m/N]
    x_near, moved_near  (n,)    the near side as it was solved, and by how much it is moved on [m]
    force, moved        (n,)    updated in place: -P^T bent [N], and H_far times it [m]
    Returns the length of x_near + moved_near - image - P moved [m].
    """
    n, s = len(bent), len(p)
    if free:
        balance(bent, change, image, stiffness)
    along = np.empty(s)
    for axis in range(3 if s else 0):
        along[:] = 0.0
        for a in range(s):
            factor, row = bent[3 * a + axis], p[a]
            for b in range(s):
                along[b] -= factor * row[b]
        for b in range(s):
            force[3 * b + axis] = along[b]
    for i in range(0 if s else n):
        force[i] = -bent[i]
    multiply_one(yields, force, moved)  # by rows of the transpose
    gap = np.empty(n)
    for i in range(n):
        gap[i] = x_near[i] + moved_near[i] - image[i] - (0.0 if s else moved[i])
    for a in range(s):
        x = y = z = 0.0
        row = p[a]
        for b in range(s):
            x += row[b] * moved[3 * b]
            y += row[b] * moved[3 * b + 1]
            z += row[b] * moved[3 * b + 2]
        gap[3 * a] -= x
        gap[3 * a + 1] -= y
        gap[3 * a + 2] -= z
    return largest_node(gap)
