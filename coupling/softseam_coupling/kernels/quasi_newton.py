"""One round of the seam: learn from the last pair, then the quasi-Newton step.

B approximates the inverse of J = dr/dlambda; s = change of lambda, y = change of the residual. Good Broyden (Broyden
1965, doi:10.1090/S0025-5718-1965-0198670-6) takes the least change of J that maps s to y; on the inverse it reads

    B <- B + (s - B y) w^T / (w^T y),   w = B^T s                              (1)

The least change depends on the metric of lambda. In the energy that a multiplier costs, lambda^T J lambda (J is
symmetric positive definite up to friction and unconverged sweeps), J s = y turns w into s:

    B <- B + (s - B y) s^T / (s^T y)                                           (2)

which saves a product and some rounds: 5.1 instead of 6.9 for 75 unknowns, a compliance 30 % wrong and a gap of 1e-7,
6.0 instead of 7.5 where J is also unsymmetric by 30 %. Where s^T y is not safely positive, (1) is used, damped so that
B grows tenfold at most in a round:

    B y <- theta B y + (1 - theta) s,  theta = 0.9 / (1 - w^T y / s^T s)       (3)

Sums run in a fixed order in four lanes: quick without fastmath, and the same bits whatever the machine's BLAS.
"""

from __future__ import annotations

import numpy as np

from softseam_coupling.kept_kernels import njit

DAMPING_FLOOR = 0.1
SAFE_COSINE = 1e-3
"""least cosine of the angle between s and y for the energy metric; a seam of condition c has at least 2/sqrt(c)"""


@njit(cache=True, error_model="numpy")
def multiply(matrix, vector, out):
    """out = matrix @ vector, (n, n) by (n,), in place."""
    n = vector.shape[0]
    whole = n - n % 4
    for i in range(n):
        a = 0.0
        b = 0.0
        c = 0.0
        d = 0.0
        for j in range(0, whole, 4):
            a += matrix[i, j] * vector[j]
            b += matrix[i, j + 1] * vector[j + 1]
            c += matrix[i, j + 2] * vector[j + 2]
            d += matrix[i, j + 3] * vector[j + 3]
        for j in range(whole, n):
            a += matrix[i, j] * vector[j]
        out[i] = (a + b) + (c + d)


@njit(cache=True, error_model="numpy")
def learn(inverse, s, y, inverse_y, weight):
    """Correct the inverse from one pair, in place; returns False where the pair says nothing.

    inverse            (n, n)  [N/m]
    s, y               (n,)    change of lambda [N] and of the residual [m]
    inverse_y, weight  (n,)    work: B y and w
    """
    n = s.shape[0]
    ss = 0.0
    yy = 0.0
    wy = 0.0
    for i in range(n):
        ss += s[i] * s[i]
        yy += y[i] * y[i]
        wy += s[i] * y[i]
    if not (ss > 0.0 and np.isfinite(ss) and np.isfinite(yy)):
        return False
    multiply(inverse, y, inverse_y)
    if wy > SAFE_COSINE * np.sqrt(ss) * np.sqrt(yy):  # eq. (2)
        weight[:] = s
    else:  # eq. (1)
        weight[:] = 0.0
        wy = 0.0
        for i in range(n):
            wy += s[i] * inverse_y[i]
            for j in range(n):
                weight[j] += s[i] * inverse[i, j]
        if wy < DAMPING_FLOOR * ss:  # eq. (3)
            theta = (1.0 - DAMPING_FLOOR) / (1.0 - wy / ss)
            for i in range(n):
                inverse_y[i] = theta * inverse_y[i] + (1.0 - theta) * s[i]
            wy = DAMPING_FLOOR * ss
    for i in range(n):
        factor = (s[i] - inverse_y[i]) / wy
        for j in range(n):
            inverse[i, j] += factor * weight[j]
    return True


@njit(cache=True, error_model="numpy")
def largest_node(vector):
    """Largest Euclidean norm of the triples of a vector (3 s,); NaN if any entry is NaN."""
    largest = 0.0
    for i in range(0, vector.shape[0], 3):
        square = vector[i] * vector[i] + vector[i + 1] * vector[i + 1] + vector[i + 2] * vector[i + 2]
        if not np.isfinite(square):
            return np.nan
        largest = max(largest, square)
    return np.sqrt(largest)


@njit(cache=True, error_model="numpy")
def exchange_round(inverse, tried, work, lambda_, gap, spring, n_tried, noise, lambda_next):
    """Take the answer of one exchange and propose the next multiplier.

    residual r = gap + spring * lambda; lambda_next = lambda_best - B r_best, where best is the smaller of this round's
    residual and the best one before, so that a round that made things worse is learned from and taken back.

    inverse      (n, n)  B, updated in place [N/m]
    tried        (4, n)  last lambda, its residual, best lambda, its residual; updated in place
    work         (4, n)
    lambda_, gap (n,)    what was tried [N] and what came back [m]
    spring               compliance of the seam spring [m/N]
    n_tried              earlier tries whose answers are in `tried`
    noise                a pair teaches nothing where no node's gap changes more [m]
    lambda_next  (n,)    out [N]

    Returns (largest nodal gap, largest nodal residual, kappa = |r| / |r_last|, learned); the first is NaN, and nothing
    is changed, where the gap or the multiplier is not finite; kappa is infinite at the first try.
    """
    n = lambda_.shape[0]
    largest = largest_node(gap)
    if not (np.isfinite(largest) and np.isfinite(largest_node(lambda_))):
        return np.nan, np.nan, np.inf, False
    residual = work[0]
    for i in range(n):
        residual[i] = gap[i] + spring * lambda_[i]
    square = 0.0
    square_last = 0.0
    square_best = 0.0
    for i in range(n):
        square += residual[i] * residual[i]
        square_last += tried[1, i] * tried[1, i]
        square_best += tried[3, i] * tried[3, i]
    kappa = np.inf
    learned = False
    if n_tried > 0:
        kappa = np.sqrt(square / square_last) if square_last > 0.0 else (0.0 if square == 0.0 else np.inf)
        change = work[1]
        answer = work[2]
        for i in range(n):
            change[i] = lambda_[i] - tried[0, i]
            answer[i] = residual[i] - tried[1, i]
        if largest_node(answer) > noise:
            learned = learn(inverse, change, answer, lambda_next, work[3])
    tried[0] = lambda_
    tried[1] = residual
    if n_tried == 0 or square <= square_best:
        tried[2] = lambda_
        tried[3] = residual
    multiply(inverse, tried[3], lambda_next)
    for i in range(n):
        lambda_next[i] = tried[2, i] - lambda_next[i]
    return largest, largest_node(residual), kappa, learned
