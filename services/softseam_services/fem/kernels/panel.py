"""One front of a multifrontal Cholesky factor: its columns factored, and products with them.

A panel is a column-major m x k block of `values`: the columns of the k rows that the front eliminates, all m rows of
the front. They are taken in strips of up to STRIP columns. With D = L_jj of a strip and B its rows below, the panel
then holds D^-1 where D was, and
  narrow panels   W = -L_Bj D^-1 below: a solve is one product a strip,  y_j = D^-1 b_j, b_B += W b_j            (1)
  wide ones       L_Bj below, which saves making W:                      y_j = D^-1 b_j, b_B -= L_Bj y_j         (2)
All but the small D is done by matrix products: on blocks of this size LAPACK's triangular solves reach a fifth of
their speed.
"""

import numpy as np

from softseam_services.jit import njit

from .lapack import apply, minus_square, product

STRIP = 24
"""columns of a strip, a multiple of 3"""
NARROW = 96
"""columns up to which a panel is kept as eq. (1): its solves are short of calls rather than of memory's speed"""


@njit(cache=True, error_model="numpy")
def invert_triangle(a, at, ld, k, tile):
    """tile[k:, :] <- L^-T of the k x k block at a[at] = L L^T, whose lower triangle counts; False where it has none.

    tile (2 k, k) column-major: the block above, the identity below; eliminating the block's columns three at a time
    from both turns the identity into L^-T. k must be a multiple of 3.
    """
    w = 2 * k
    for j in range(k):
        for i in range(j, k):
            tile[j * w + i] = a[at + j * ld + i]
        for i in range(k, w):
            tile[j * w + i] = 0.0
        tile[j * w + k + j] = 1.0
    for j in range(0, k, 3):
        end = k + j + 3
        x = tile[j * w : j * w + end]
        y = tile[(j + 1) * w : (j + 1) * w + end]
        z = tile[(j + 2) * w : (j + 2) * w + end]
        if not x[j] > 0.0:
            return False
        s0 = 1.0 / np.sqrt(x[j])
        l10, l20 = x[j + 1] * s0, x[j + 2] * s0
        pivot = y[j + 1] - l10 * l10
        if not pivot > 0.0:
            return False
        s1 = 1.0 / np.sqrt(pivot)
        l21 = (y[j + 2] - l20 * l10) * s1
        pivot = z[j + 2] - l20 * l20 - l21 * l21
        if not pivot > 0.0:
            return False
        s2 = 1.0 / np.sqrt(pivot)
        for i in range(j, end):
            x[i] = x[i] * s0
            y[i] = (y[i] - l10 * x[i]) * s1
            z[i] = (z[i] - l20 * x[i] - l21 * y[i]) * s2
        for c in range(j + 3, k):
            f, g, h = x[c], y[c], z[c]
            target = tile[c * w : c * w + end]
            for i in range(c, end):
                target[i] -= f * x[i] + g * y[i] + h * z[i]
    return True


@njit(cache=True, error_model="numpy")
def factor_panel(values, offset, m, k, rest, at_rest, tile, strip, ints):
    """Factor the panel at `offset`, see the module; the lower triangle of rest (m-k, m-k) <- -L2 L2^T, L2 its last
    rows. False where the matrix is not positive definite.

    tile (2 STRIP^2,), strip (m * max(STRIP, k where k <= NARROW),) scratch
    """
    narrow = k <= NARROW
    for a in range(0, k, STRIP):
        n = min(STRIP, k - a)
        height = m - a
        corner = offset + a * m + a
        below = height - n
        # L of the columns before is in `strip` or, of a wide panel, in place
        if a > 0:
            if narrow:
                product(height, n, a, -1, strip, a, m, strip, a, m, True, True, values, corner, m, ints)
            else:
                left = offset + a
                product(height, n, a, -1, values, left, m, values, left, m, True, True, values, corner, m, ints)
        if not invert_triangle(values, corner, m, n, tile):
            return False
        for j in range(n):
            for i in range(j):
                values[corner + j * m + i] = 0.0
            for i in range(j, n):
                values[corner + j * m + i] = tile[i * 2 * n + n + j]
        if below == 0:
            continue
        if narrow:
            at = a * m + a + n
            product(below, n, n, 1, values, corner + n, m, tile, n, 2 * n, False, False, strip, at, m, ints)
            product(below, n, n, -1, strip, at, m, tile, n, 2 * n, True, False, values, corner + n, m, ints)
        else:
            product(below, n, n, 1, values, corner + n, m, tile, n, 2 * n, False, False, strip, 0, below, ints)
            for j in range(n):
                to = corner + n + j * m
                for i in range(below):
                    values[to + i] = strip[j * below + i]
    if m > k and k > 0:
        if narrow:
            minus_square(m - k, k, strip, k, m, rest, at_rest, ints)
        else:
            minus_square(m - k, k, values, offset + k, m, rest, at_rest, ints)
    return True


@njit(cache=True, error_model="numpy")
def descend(values, offset, m, k, t, s, ints):
    """t (m,) <- [y; b_2 - L2 y] with L11 y = b_1, for b = t; s (STRIP,) scratch."""
    narrow = k <= NARROW
    for a in range(0, k, STRIP):
        n = min(STRIP, k - a)
        corner = offset + a * m + a
        for i in range(n):
            s[i] = t[a + i]
            t[a + i] = 0.0
        if narrow:
            apply(m - a, n, 1, values, corner, m, False, s, 0, True, t, a, ints)
        else:
            apply(n, n, 1, values, corner, m, False, s, 0, False, t, a, ints)
            apply(m - a - n, n, -1, values, corner + n, m, False, t, a, True, t, a + n, ints)


@njit(cache=True, error_model="numpy")
def descend_many(values, offset, m, k, c, t, s, ints):
    """As `descend`, of c right-hand sides at once: t (m, c) column-major; s (STRIP c,) scratch."""
    narrow = k <= NARROW
    for a in range(0, k, STRIP):
        n = min(STRIP, k - a)
        corner = offset + a * m + a
        for j in range(c):
            for i in range(n):
                s[j * n + i] = t[j * m + a + i]
                t[j * m + a + i] = 0.0
        if narrow:
            product(m - a, c, n, 1, values, corner, m, s, 0, n, False, True, t, a, m, ints)
        else:
            product(n, c, n, 1, values, corner, m, s, 0, n, False, False, t, a, m, ints)
            product(m - a - n, c, n, -1, values, corner + n, m, t, a, m, False, True, t, a + n, m, ints)


@njit(cache=True, error_model="numpy")
def ascend(values, offset, m, k, t, s, ints):
    """t[:k] <- x_1 with L11^T x_1 = t_1 - L2^T x_2, for [t_1; x_2] = t (m,); s (STRIP,) scratch."""
    narrow = k <= NARROW
    for a in range((k - 1) // STRIP * STRIP, -1, -STRIP):
        n = min(STRIP, k - a)
        corner = offset + a * m + a
        for i in range(n):
            s[i] = t[a + i]
        if narrow:
            apply(m - a, n, 1, values, corner, m, True, t, a, False, s, 0, ints)
            for i in range(n):
                t[a + i] = s[i]
        else:
            apply(m - a - n, n, -1, values, corner + n, m, True, t, a + n, True, s, 0, ints)
            apply(n, n, 1, values, corner, m, True, s, 0, False, t, a, ints)


@njit(cache=True, error_model="numpy")
def inverse_triangle(values, offset, k, out, ints):
    """out (k, k) column-major <- L^-1 of a factored panel without rows below, zeros above its diagonal."""
    narrow = k <= NARROW
    for i in range(k * k):
        out[i] = 0.0
    for i in range(k):
        out[i * k + i] = 1.0
    copy = np.empty(STRIP * k)
    for a in range(0, k, STRIP):
        n = min(STRIP, k - a)
        corner = offset + a * k + a
        done = a + n  # columns that are not zero in these rows
        for j in range(done):
            for i in range(n):
                copy[j * n + i] = out[j * k + a + i]
        product(n, done, n, 1, values, corner, k, copy, 0, n, False, False, out, a, k, ints)
        if done == k:
            continue
        if not narrow:
            for j in range(done):
                for i in range(n):
                    copy[j * n + i] = out[j * k + a + i]
        product(k - done, done, n, 1 if narrow else -1, values, corner + n, k, copy, 0, n, False, True, out, done, k,
                ints)  # fmt: skip
