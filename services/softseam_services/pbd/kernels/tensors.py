"""Symmetric tensors of a lane, six numbers each, xx yy zz yz xz xy, and twelve of hourglass modes."""

from .lanes import LANES, lane_kernel
from .neo_hookean import logarithm
from .relaxing import exponential


@lane_kernel
def six(ws, lane, row):
    """Six rows of a lane."""
    a = lane + LANES * row
    return ws[a], ws[a + LANES], ws[a + 2 * LANES], ws[a + 3 * LANES], ws[a + 4 * LANES], ws[a + 5 * LANES]


@lane_kernel
def unimodular(a):
    """X = (1 + a) det(1 + a)^(-1/3) of a symmetric a, less 1, and X^-1 (6 values each)."""
    a0, a1, a2, a3, a4, a5 = a
    p, q, r = 1.0 + a0, 1.0 + a1, 1.0 + a2
    m0, m1, m2 = q * r - a3 * a3, p * r - a4 * a4, p * q - a5 * a5
    m3, m4, m5 = a4 * a5 - p * a3, a3 * a5 - q * a4, a3 * a4 - r * a5
    y = exponential(logarithm(p * m0 + a5 * m5 + a4 * m4) * (-1.0 / 3.0))
    s = y * y
    return (
        (y * p - 1.0, y * q - 1.0, y * r - 1.0, y * a3, y * a4, y * a5),
        (s * m0, s * m1, s * m2, s * m3, s * m4, s * m5),
    )


@lane_kernel
def mixed(u, a, v, b, w, c):
    """u a + v b + w c of six values each."""
    return (
        *(u * a[0] + v * b[0] + w * c[0], u * a[1] + v * b[1] + w * c[1], u * a[2] + v * b[2] + w * c[2]),
        *(u * a[3] + v * b[3] + w * c[3], u * a[4] + v * b[4] + w * c[4], u * a[5] + v * b[5] + w * c[5]),
    )


@lane_kernel
def sum_of_twelve(u, a, v, b):
    """u a + v b."""
    return (
        *(u * a[0] + v * b[0], u * a[1] + v * b[1], u * a[2] + v * b[2], u * a[3] + v * b[3]),
        *(u * a[4] + v * b[4], u * a[5] + v * b[5], u * a[6] + v * b[6], u * a[7] + v * b[7]),
        *(u * a[8] + v * b[8], u * a[9] + v * b[9], u * a[10] + v * b[10], u * a[11] + v * b[11]),
    )


@lane_kernel
def contracted(a, b):
    """(1 + a) : b of symmetric a and b (6 values each)."""
    low = b[0] + b[1] + b[2] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return low + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
