"""The linear algebra of a linked round; equations and signs are those of `orchestrator.linked`.

With H the compliance of the far side as the near side's nodes see it, S its inverse, Y the near side's yield beside S:

    c = P x_far + H lambda_told                         where the far side's image would be without a force     (1)
    m = P x_far - a                                     what the near side was told wrong, with the anchor a
    dx = Y S m,  lambda = lambda' + S (m - dx)          the near side's linear answer                           (2)
    P dx_far = -H (lambda - lambda_told)                the far side's                                          (3)

Both sides were told the same multiplier.

What earlier rounds taught of the far side's line is kept beside H (`learned_line`: pairs of changes D and defects E):

    H' = H + E (D^T H D)^-1 (H D)^T                                                                             (4)

in place of H in (2) and (3) makes of m in (2) m + E z, where with G = S - S Y S

    (D^T H D + (H D)^T G E) z = (H D)^T (lambda_told - lambda' - G m)                                           (5)
"""

from __future__ import annotations

import numpy as np

from softseam_coupling.kept_kernels import njit
from softseam_coupling.kernels.learned_line import dot, multiply_one, solve_small, yield_to
from softseam_coupling.kernels.quasi_newton import largest_node


@njit(cache=True, error_model="numpy")
def foretell(h, line, multiplier, yielded, anchor):
    """anchor (n,) <- c - H lambda, where the image of the far side will be, and yielded (n,) <- H lambda."""
    multiply_one(h, multiplier, yielded)
    for i in range(len(anchor)):
        anchor[i] = line[i] - yielded[i]


@njit(cache=True, error_model="numpy")
def link_round(
    h, s, y, rooted, x_near, found, image, anchor, yielded, told,
    kept, changes, defects, along, pushes, moves, answers, line, push, moved, multiplier, given,
):  # fmt: skip
    """Eqs. (1) to (5) for one round; h, s, y (n, n), the others (n,) in the order x, y, z of each node.

    y, rooted                   Y, or R with Y = R R^T
    x_near, found               what the near side answered to the anchor and its multiplier: x_near and lambda'
    image                       what the far side answered to `told`: P x_far
    told, yielded               the multiplier that both were told, and H times it
    kept ... answers            pairs of rounds, as in `learned_line`
    line, push, moved, multiplier, given    updated in place: c, S m, dx, lambda, -P dx_far
    Returns the lengths of the gap that is left, of what the far side is moved by and of m [m].
    """
    n, k = len(line), len(kept)
    away, lost = np.empty(n), np.empty(n)
    for i in range(n):
        line[i] = image[i] + yielded[i]
        away[i] = image[i] - anchor[i]
    multiply_one(s, away, push)
    yield_to(y, rooted, push.reshape(1, n), moved.reshape(1, n))
    multiply_one(s, moved, lost)
    for i in range(n):
        multiplier[i] = found[i] + push[i] - lost[i]
        lost[i] = told[i] - multiplier[i]
    share, system = np.empty(k), np.empty((k, k))
    for r in range(k):
        share[r] = dot(along[kept[r]], lost)
        for c in range(k):
            system[r, c] = dot(along[kept[r]], changes[kept[c]]) + dot(along[kept[r]], answers[kept[c]])
    if not solve_small(system, share):
        share[:] = 0.0
    for r in range(k):
        z, pair = share[r], kept[r]
        for i in range(n):
            away[i] += z * defects[pair, i]
            line[i] += z * defects[pair, i]
            push[i] += z * pushes[pair, i]
            moved[i] += z * moves[pair, i]
            multiplier[i] += z * answers[pair, i]
    for i in range(n):
        lost[i] = multiplier[i] - told[i]
    multiply_one(h, lost, given)
    for r in range(k):
        for i in range(n):
            given[i] -= share[r] * defects[kept[r], i]
    for i in range(n):
        lost[i] = x_near[i] + moved[i] - image[i] + given[i]
    return largest_node(lost), largest_node(given), largest_node(away)


@njit(cache=True, error_model="numpy")
def settled(x, moved, before, start, force, final, dt, momentum, angular):
    """x (s, 3) += moved, and momentum and angular momentum (3,) by the impulse of final - force; updated in place.

    before, start (s, 3) [m] are where the last step and this one began, force and final (s, 3) [N] what acts on the
    seam's nodes as the step was solved and as it is settled. Returns the seam's work, and by how much the kinetic and
    the strain energy are others. The step's impulses balance, so to second order, with d = final - force,

        d(K + U) = force . moved + dt v . d + 1/2 d . moved                                                     (6)

    where v is the velocity at the start, taken as that of the seam; the term with v is what changes K.
    """
    work = kinetic = strain = 0.0
    for node in range(len(x)):
        ax, ay, az = start[node, 0], start[node, 1], start[node, 2]
        px = dt * (final[node, 0] - force[node, 0])
        py = dt * (final[node, 1] - force[node, 1])
        pz = dt * (final[node, 2] - force[node, 2])
        for k in range(3):
            x[node, k] += moved[node, k]
            work += final[node, k] * (x[node, k] - start[node, k])
            strain += 0.5 * (final[node, k] + force[node, k]) * moved[node, k]
            kinetic += (final[node, k] - force[node, k]) * (start[node, k] - before[node, k])
        momentum[0] += px
        momentum[1] += py
        momentum[2] += pz
        angular[0] += ay * pz - az * py
        angular[1] += az * px - ax * pz
        angular[2] += ax * py - ay * px
    return work, kinetic, strain
