"""How far a tool may go along a line until it touches a surface, and where it does.

The tool goes on by its distance to the surface, which it can without touching (conservative advancement: Mirtich, PhD
thesis, Berkeley 1996, section 2.3). The distance is the least over the triangles, by branch and bound: where a tool is
convex its signed distance g is, too, and on a triangle with corners c_i
  g(x) >= g(p) + grad g(p) . (x - p) >= min_i [g(p) + grad g(p) . (c_i - p)]                                     (1)
for any p, here its corners and its centroid, and for every mixture of two of these p,
  g(x) >= min_i sum_p m_p [g(p) + grad g(p) . (c_i - p)],  m_p >= 0,  sum_p m_p = 1,                             (2)
which is g itself where an edge of the tool passes a triangle. Triangles whose bound is above the least value found are
left, the others are divided. So it is the same whatever triangles a surface is made of. Where faces meet, that place
counts which is nearest to the line of the tool's position.
"""

import numpy as np
from numpy.typing import NDArray

from softseam_services.tools.kernels.nearest import LINE, nearest_place
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]

_TOUCH = 1e-6
"""of the surface's size: as near as touching [1]"""
_CLOSE, _RESOLVED = 1e-5, 1e-10
"""of the surface's size: bounds so near below the least gap are not looked into; and where places are looked for [1]"""
_MOST_STEPS = 200


def way_to_touch(
    tools: ToolSet, tool: int, position: Floats, orientation: Floats, way: Floats, corners: Floats
) -> tuple[float, Floats] | None:
    """How far a tool may go along a unit vector until it touches triangles [m], negative for back where it is in them,
    and the point (3,) where it does; None where it passes them.

    position, orientation  of the tool (3,) [m], (4,)
    corners                of the triangles (m, 3, 3) [m]; points that are no triangles have three corners alike
    """
    along = corners @ way
    size = max(float(np.ptp(corners.reshape(-1, 3), axis=0).max()), 1e-9)
    reach = float(tools.reach[tool])
    far = float(along.max() - position @ way) + (reach if np.isfinite(reach) else 2.0 * size)
    surface = _Surface(tools, tool, orientation, corners, size)
    gone, back, clear = 0.0, 0.0, np.nan
    for _ in range(_MOST_STEPS):
        gap = surface.nearest(position + gone * way)[0]
        if gap < -_TOUCH * size and np.isnan(clear):  # it begins in them: back, until it is out
            back = 2.0 * back + max(-gap, _TOUCH * size)
            gone -= back
        elif gap < -_TOUCH * size:  # a distance on a grid was too long
            if gone - clear <= _TOUCH * size:
                break
            gone = 0.5 * (clear + gone)
        elif gap <= _TOUCH * size:
            break
        else:
            clear, gone = gone, gone + gap
        if gone > far:
            return None
    return gone, surface.nearest(position + gone * way, way)[1]


class _Surface:
    """Triangles before one tool, with what is known of how near they are."""

    def __init__(self, tools: ToolSet, tool: int, orientation: Floats, corners: Floats, size: float) -> None:
        self._tool = int(tools.kind[tool]), tools.shape[tool], float(tools.reach[tool])
        self._orientation, self._corners, self._size = orientation, np.ascontiguousarray(corners), size
        self._least = np.full(len(corners), -np.inf)  # below which their gaps cannot be, where the tool is now
        self._at: Floats | None = None

    def nearest(self, position: Floats, way: Floats | None = None) -> tuple[float, Floats]:
        """Least gap of the triangles to the tool there [m], and where it is (3,); with a way, of several places that
        which is nearest to the line along it through the position."""
        if self._at is not None:
            self._least -= float(np.linalg.norm(position - self._at))
        self._at, place = position, np.empty(3)
        line, close = (0.0, _CLOSE) if way is None else (LINE / self._size, _RESOLVED)
        along = np.zeros(3) if way is None else np.asarray(way)
        kind, shape, reach = self._tool
        gap = nearest_place(
            *(kind, shape, reach, position, self._orientation, along, line, close * self._size, self._size),
            *(self._corners, np.argsort(self._least), self._least, place),
        )
        return gap, place
