"""Shape functions of both models, and the weights with which surface points follow nodes.

Local coordinates run from -1 to 1 over a cell. FEM interpolates with its element's functions, by default the 27
quadratic ones of the cell, PBD with the 8 trilinear functions of the octant that holds the point. All sum to 1 and
reproduce linear fields.
"""

import numpy as np

from softseam_protocol.models import MODELS
from softseam_protocol.scene.kinds import ELEMENTS, Functions
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body import tetrahedron
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.kernels.shape_functions import (
    QUADRATIC,
    QUADRATIC_TETRAHEDRAL,
    TETRAHEDRAL,
    TRILINEAR,
    fill_weights,
    hex27,
    octant_trilinear,
)
from softseam_services.body.particles import ParticleBody

__all__ = [
    "FUNCTION_NUMBER",
    "Functions",
    "hex27",
    "model_functions",
    "octant_trilinear",
    "point_weights",
    "rest_points",
]

FUNCTION_NUMBER: dict[Functions, int] = {
    "hex27": QUADRATIC,
    "hex8": TRILINEAR,
    "tet4": TETRAHEDRAL,
    "tet10": QUADRATIC_TETRAHEDRAL,
}
"""as `fill_weights` takes them"""


def model_functions(models: ModelsSpec) -> dict[str, Functions]:
    """What each model interpolates with."""
    own = ELEMENTS[models.fem.element].functions
    return {name: facts.functions or own for name, facts in MODELS.items()}


def point_weights(body: Body, region: Region, functions: Functions) -> tuple[Ints, Ints, Floats]:
    """Sparse rows: point p of the region sits at sum of weight[i] * x[node[i]], i in indptr[p] .. indptr[p + 1].

    Returns indptr (p + 1,), node (m,) local ids of the region, weight (m,). On a block each row is one node, weight 1.
    """
    local = region.point_local
    if body.tetrahedra:
        return _in_tetrahedra(region, functions)
    indptr = np.zeros(len(local) + 1, dtype=np.int32)
    node = np.empty(27 * len(local), dtype=np.int32)
    weight = np.empty(27 * len(local))
    count = fill_weights(local, region.point_cell, region.cell_nodes, FUNCTION_NUMBER[functions], indptr, node, weight)
    return indptr, node[:count].copy(), weight[:count].copy()


def _in_tetrahedra(region: Region, functions: Functions) -> tuple[Ints, Ints, Floats]:
    """`point_weights` in cells that are tetrahedra."""
    barycentric = tetrahedron.barycentric_of(region.point_local)
    linear = functions == "tet4"
    value = tetrahedron.linear_functions(barycentric) if linear else tetrahedron.shape_functions(barycentric)[0]
    row, column = np.nonzero(value)
    indptr = np.append(0, np.cumsum(np.bincount(row, minlength=len(value)))).astype(np.int32)
    return indptr, region.cell_nodes[region.point_cell[row], tetrahedron.NODES[column]], value[row, column]


def rest_points(body: Body) -> Floats:
    """Surface points at rest (P, 3) [m]; the same for both models, since both reproduce linear fields."""
    surface = body.surface
    if body.tetrahedra:
        value = tetrahedron.shape_functions(tetrahedron.barycentric_of(surface.local))[0]
        nodes = body.cell_nodes[surface.cell][:, tetrahedron.NODES]
        return np.asarray(np.einsum("pa,pai->pi", value, body.x_rest[nodes]))
    if not body.boxes:
        t = surface.local
        line = np.stack([0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)], axis=2)
        value = np.einsum("pi,pj,pk->pkji", line[:, 0], line[:, 1], line[:, 2]).reshape(-1, 27)
        return np.asarray(np.einsum("pa,pai->pi", value, body.x_rest[body.cell_nodes[surface.cell]]))
    middle = body.x_rest[body.cell_nodes[surface.cell, 13]]
    points: Floats = middle + body.from_axes(0.5 * surface.local * body.edges)
    return points


def bounding_points(body: Body | ParticleBody) -> Floats:
    """Points at rest whose box is the body's (n, 3) [m]: where its surface cuts cells those of the surface, for cells'
    nodes may be outside of it; else its nodes, or particles."""
    return rest_points(body) if body.cut else body.x_rest
