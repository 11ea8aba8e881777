"""The axes of the tightest box around a solid: where a mesh file has it turned, cells along its own axes are fewer.

The least box with one face on a face of the convex hull and, of that, one edge along the hull's outline seen from
there. The least box of all need not have a face there (J. O'Rourke, Int. J. Comput. Inf. Sci. 14 (1985) 183-199), but
where a solid has flat sides or is long, it has.
"""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from softseam_protocol.nearest_axes import nearest_axes
from softseam_services.body.body import ALIKE, Floats

_MOST_SIDES = 200
"""sides of the hull that are tried, the largest first: a round solid has thousands, and any of them will do"""
_TIGHTER = 0.85
"""volume of the tightest box over that along the file's axes, from which on it is worth turning to: drawn along its
axes, a solid keeps them"""


def tightest_axes(points: Floats) -> Floats:
    """Unit vectors as columns (3, 3), right-handed: along the file's axes, or of a box that is tighter by `_TIGHTER`,
    each as near to one of the file's as can be. points (n, 3) [m]; those in a plane keep the file's axes."""
    try:
        hull = ConvexHull(points)
    except QhullError:
        return np.eye(3)
    corners = points[hull.vertices]
    a, b, c = (points[hull.simplices[:, corner]] for corner in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rounded = np.round(hull.equations[:, :3] / ALIKE)
    _, first, side = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    largest = np.argsort(-np.bincount(side.reshape(-1), area), kind="stable")[:_MOST_SIDES]
    axes, least = np.eye(3), _TIGHTER * float(np.ptp(points, axis=0).prod())
    for normal in hull.equations[first[largest], :3]:
        found, volume = _box_on(normal, corners)
        if volume < (1.0 - ALIKE) * least:
            axes, least = found, volume
    return _nearest(axes)


def _box_on(normal: Floats, corners: Floats) -> tuple[Floats, float]:
    """Axes (3, 3) and volume of the least box with a face across a unit vector (3,) around points (n, 3) [m]."""
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    plane = np.stack([across, np.cross(normal, across)])
    outline = corners @ plane.T
    outline = outline[ConvexHull(outline).vertices]
    edge = np.roll(outline, -1, axis=0) - outline
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    beside = np.stack([-edge[:, 1], edge[:, 0]], axis=1)
    area = np.ptp(outline @ edge.T, axis=0) * np.ptp(outline @ beside.T, axis=0)
    best = int(np.argmin(area))
    first = edge[best] @ plane
    axes = np.stack([first, np.cross(normal, first), normal], axis=1)
    return axes, float(area[best] * np.ptp(corners @ normal))


def _nearest(axes: Floats) -> Floats:
    """The same axes, each next to one of the file's and pointing as that does, the last such that they are
    right-handed (3, 3)."""
    x, y = (axes[:, column] for column in nearest_axes(axes)[:2])
    x, y = (-x if x[0] < 0.0 else x), (-y if y[1] < 0.0 else y)
    return np.stack([x, y, np.cross(x, y)], axis=1)
