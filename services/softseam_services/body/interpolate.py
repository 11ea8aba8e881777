"""Shape functions of both models, and the weights with which surface points follow nodes.

Local coordinates run from -1 to 1 over a cell. FEM interpolates with the 27 quadratic functions of the cell,
PBD with the 8 trilinear functions of the octant that holds the point. Both sum to 1 and reproduce linear fields.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.kernels.shape_functions import fill_weights, hex27, octant_trilinear

__all__ = ["hex27", "octant_trilinear", "point_weights", "rest_points"]


def point_weights(body: Body, region: Region, kind: Literal["fem", "pbd"]) -> tuple[Ints, Ints, Floats]:
    """Sparse rows: point p of the region sits at sum of weight[i] * x[node[i]], i in indptr[p] .. indptr[p + 1].

    Returns indptr (p + 1,), node (m,) local ids of the region, weight (m,). On a block each row is one node, weight 1.
    """
    local = region.point_local
    indptr = np.zeros(len(local) + 1, dtype=np.int32)
    node = np.empty(27 * len(local), dtype=np.int32)
    weight = np.empty(27 * len(local))
    count = fill_weights(local, region.point_cell, region.cell_nodes, kind == "fem", indptr, node, weight)
    return indptr, node[:count].copy(), weight[:count].copy()


def rest_points(body: Body) -> Floats:
    """Surface points at rest (P, 3) [m]; the same for both models, since both reproduce linear fields."""
    surface = body.surface
    middle = body.x_rest[body.cell_nodes[surface.cell, 13]]
    points: Floats = middle + 0.5 * surface.local * body.edges
    return points
