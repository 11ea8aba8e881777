"""The filled part of octants, by its moments: means over it of the cell's functions and their slopes.

M_pqr = int s^p t^q w^r dV over the filled part of an octant, s, t, w in [0, 1], p, q, r = 0 .. 2, index p + 3 q + 9 r
(kernels/fill.py), is all that integrals of the 27 quadratic functions, the octants' 8 trilinear ones and their slopes
ask for: they are exact whatever the shape of the part.
"""

import numpy as np

from softseam_services.body.body import Body, Floats, Ints

FILL_FLOOR = 1e-3
"""Octants emptier than this, inside a kept cell, count as filled to this fraction in mass and stiffness alike: nodes
that only empty octants touch then follow the body with an ordinary wave speed instead of falling freely."""

FULL_MOMENTS = np.array([1.0 / ((p + 1) * (q + 1) * (r + 1)) for r in range(3) for q in range(3) for p in range(3)])
"""M_pqr of a full octant (27,)"""

LINEAR = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
"""coefficients of 1 - s and s in powers of s (2, 3)"""


def quadratic(octant: int) -> Floats:
    """Coefficients (3, 3) of the three quadratic functions in powers of s on octant 0 ([-1, 0]) or 1 ([0, 1])."""
    shift = octant - 1.0
    # t = shift + s in 0.5 t^2 - 0.5 t, 1 - t^2, 0.5 t^2 + 0.5 t
    square = np.array([shift * shift, 2.0 * shift, 1.0])
    line = np.array([shift, 1.0, 0.0])
    return np.stack([0.5 * (square - line), np.array([1.0, 0.0, 0.0]) - square, 0.5 * (square + line)])


def filled_moments(body: Body, cells: Ints, fill: Floats) -> Floats:
    """M_pqr (k, 8, 27) of these cells' octants with a fill (k, 8) of at least their own.

    What is more than the shape fills, such as the floor of empty octants, is spread evenly over the octant; so is all
    of it where a body has fills and no shape.
    """
    if not len(body.moments):
        return np.asarray(fill[:, :, None] * FULL_MOMENTS)
    shape = body.moments[cells]
    return np.asarray(shape + (fill - shape[:, :, 0])[:, :, None] * FULL_MOMENTS)


def filled_centroids(moments: Floats) -> Floats:
    """Centroids of the filled parts (k, 8, 3), in coordinates from -1 to 1 over the cell."""
    low = np.array([(octant & 1, octant >> 1 & 1, octant >> 2 & 1) for octant in range(8)]) - 1.0
    return np.asarray(low + moments[:, :, [1, 3, 9]] / moments[:, :, :1])


def mean_gradients(moments: Floats, edges: Floats) -> Floats:
    """Mean of grad N over the filled part of each octant, of the cell's 27 functions (k, 8, 3, 27) [1/m].

    moments (k, 8, 27), edges of a cell (3,) [m]
    """
    return gradient_integrals(moments, edges) / moments[:, :, :1, None]


def gradient_integrals(moments: Floats, edges: Floats) -> Floats:
    """The same over the volume of a whole octant: 0 where nothing is filled."""
    return _integrals(moments, edges, [[quadratic((octant >> axis) & 1) for axis in range(3)] for octant in range(8)])


def mean_trilinear_gradients(moments: Floats, edges: Floats) -> Floats:
    """Mean of grad N over the filled part of each octant, of its 8 trilinear functions (k, 8, 3, 8) [1/m]."""
    return _integrals(moments, edges, [[LINEAR] * 3] * 8) / moments[:, :, :1, None]


def _integrals(moments: Floats, edges: Floats, powers: list[list[Floats]]) -> Floats:
    count = len(powers[0][0]) ** 3
    total = np.empty((len(moments), 8, 3, count))
    for octant, along in enumerate(powers):
        for axis in range(3):
            x, y, z = (_slope(p) if a == axis else p for a, p in enumerate(along))
            integral = np.einsum("cr,bq,ap->cbarqp", z, y, x).reshape(count, 27)
            total[:, octant, axis] = moments[:, octant] @ integral.T * (2.0 / edges[axis])
    return total


def _slope(powers: Floats) -> Floats:
    """Coefficients of the derivatives by s of polynomials (n, 3) in powers of s."""
    return np.stack([powers[:, 1], 2.0 * powers[:, 2], np.zeros(len(powers))], axis=1)
