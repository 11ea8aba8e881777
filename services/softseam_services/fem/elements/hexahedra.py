"""Reference elements: the cell as one quadratic hexahedron, or as eight linear ones, one an octant."""

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.kernels.shape_functions import hex27
from softseam_services.body.lattice import OCTANT_NODES

from .table import Reference, gauss

SIGNS = np.array([(2 * (a & 1) - 1, (a & 2) - 1, (a & 4) // 2 - 1) for a in range(8)], dtype=np.float64)
"""local coordinates of a hexahedron's corners, and of the octants' centres times 2 (8, 3)"""


def quadratic(n: int) -> Reference:
    """One element of 27 nodes with n^3 Gauss points; a point between octants belongs to all of them alike."""
    points, weight = gauss(n)
    slope, value = np.empty((len(points), 27, 3)), np.empty(27)
    for point, out in zip(points, slope, strict=True):
        hex27(point, value, out)
    share = np.prod(0.5 * (1.0 + SIGNS[None] * np.sign(np.where(np.abs(points) < 1e-9, 0.0, points))[:, None]), axis=2)
    return Reference(np.arange(27, dtype=np.int32)[None], slope[None], weight[None], share[None])


def linear(n: int) -> Reference:
    """Eight elements of 8 nodes with n^3 Gauss points each."""
    points, weight = gauss(n)
    slope = _trilinear_slope(points)
    share = np.repeat(np.eye(8)[:, None], len(points), axis=1)
    return Reference(OCTANT_NODES, np.tile(slope, (8, 1, 1, 1)), np.tile(weight, (8, 1)), share)


def _trilinear_slope(points: Floats) -> Floats:
    """(q, 8, 3) at points (q, 3)."""
    factor = 0.5 * (1.0 + points[:, None] * SIGNS)
    slope = np.empty_like(factor)
    for axis in range(3):
        others = [i for i in range(3) if i != axis]
        slope[..., axis] = 0.5 * SIGNS[:, axis] * factor[..., others].prod(axis=2)
    return slope
