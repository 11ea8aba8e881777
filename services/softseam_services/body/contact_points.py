"""How firmly the points of an embedded surface are pressed, in both models.

Such a surface runs through cells, or along faces of tetrahedra, and a cell's face has fewer freedoms than the many
points in it: a gap of zero at all
of them would flatten what curves within a cell, so a tool presses each by
  p = -r g,  r = PENALTY E A/h,                                                                                 (1)
g < 0 the gap, A the area that the point stands for, h half the edge of a cell. What a tool sinks in stands for the
waves that the cells lack (docs/decisions/45).
"""

import numpy as np

from softseam_services.body.body import Body, Floats, Region

PENALTY = 20.0
"""r of a point in E A/h"""


def is_embedded(body: Body) -> bool:
    """Whether its surface has many points in each cell, through which it runs, or whose triangular faces it is."""
    return body.cut or body.tetrahedra


def point_stiffness(body: Body, region: Region, spacing: Floats) -> Floats:
    """Eq. (1) of the region's surface points (p,) [N/m], 0 of those that are for display only; spacing: h (p,) [m]."""
    octant = (region.point_local >= 0.0) @ np.array([1, 2, 4])
    material = body.octant_material[region.cells][region.point_cell, octant]
    young = np.array([each.young for each in body.materials])[material]
    return np.asarray(PENALTY * (young / spacing) * body.surface.area[region.points])
