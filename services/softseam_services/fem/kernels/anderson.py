"""Anderson acceleration of corrections by a kept factor."""

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def dot(a, b):
    """Sum of a[i] b[i], in four sums."""
    s0 = s1 = s2 = s3 = 0.0
    whole = len(a) - len(a) % 4
    for i in range(0, whole, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(whole, len(a)):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)


@njit(cache=True, error_model="numpy")
def add_scaled(a, scale, b):
    """a += scale b, in place."""
    for i in range(len(a)):
        a[i] += scale * b[i]


@njit(cache=True, error_model="numpy")
def accelerate(known, d, d_last, step, q, s):
    """Anderson acceleration of x <- x + d, d = A^-1 r; `step` is the last step, and the next one on return.

    With D = (differences of d), S = (differences of x) + D over the last iterations, the step is d - S g with g the
    least-squares solution of D g = d (Walker & Ni, SIAM J. Numer. Anal. 49, 2011, eq. 2.1). The rows of q are D made
    orthonormal, those of s are S transformed alike, so g = q d. Every column keeps the sum of M x, so momentum stays
    exact. Returns how many columns are known; `known` < 0 starts afresh.
    """
    memory, n = len(q), len(d)
    if known < 0:
        known = 0
    else:
        column = known % memory
        for i in range(n):
            q[column, i] = d[i] - d_last[i]
            s[column, i] = step[i] + q[column, i]
        before = np.sqrt(dot(q[column], q[column]))
        for other in range(min(known + 1, memory)):
            if other != column:
                along = dot(q[other], q[column])
                add_scaled(q[column], -along, q[other])
                add_scaled(s[column], -along, s[other])
        size = np.sqrt(dot(q[column], q[column]))
        keep = size > 1e-6 * before
        scale = 1.0 / size if keep else 0.0
        for i in range(n):
            q[column, i] *= scale
            s[column, i] *= scale
        known += keep
    for i in range(n):
        d_last[i] = d[i]
        step[i] = d[i]
    for column in range(min(known, memory)):
        add_scaled(step, -dot(q[column], d), s[column])
    return known
