"""How far a round surface that runs through cells stands out between their nodes.

Trilinear functions move what is between two nodes h apart along a chord: pressed on a flat tool, a surface of curvature
k cannot lie flat there, but stands out from the chord by k (h^2/8) (1 - xi^2), xi from -1 to 1 from one node to the
next. k is that of the normals of the points around.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from softseam_services.body.body import Body, Floats, Region
from softseam_services.body.interpolate import rest_points
from softseam_services.body.surface_points import NO_CREASE


def bulges(body: Body, region: Region) -> Floats:
    """How far each surface point of a region stands out from what its octant's nodes can flatten; 0 where the surface
    is flat, hollow or a crease, and of those for display (p,) [m]."""
    h = 0.5 * body.edges
    along = 1.0 - np.abs(2.0 * np.abs(np.clip(region.point_local, -1.0, 1.0)) - 1.0) ** 2
    bends = np.einsum("ia,pij,ja->pa", body.axes, curvatures(body)[region.points], body.axes)
    out = (bends * along) @ (0.125 * h**2)
    return np.where(out > 1e-6 * h.min(), out, 0.0)  # what is flat is so but for rounding


class Lattice(NamedTuple):
    """Where p points of a surface are among octants, and how round it is there.

    Between points all of these are between theirs. What stands out at a place x there, from nodes, where what touches
    turns by a mean curvature H beside it, is sum_a (rise_a + H spread_a) 4 f_a (1 - f_a), f = x - floor(x).
    """

    octant: Floats
    """in edges of octants (p, 3)"""
    rise: Floats
    """how far what is around stands out half-way between two nodes along each axis (p, 3) [m]"""
    spread: Floats
    """the same of a surface that turns by 1/m along it (p, 3) [m^2]"""
    mean: Floats
    """mean curvature (p,) [1/m]"""


def lattice_of(body: Body, rest: Floats, normal: Floats, bends: Floats) -> Lattice:
    """Of points at rest (p, 3) [m] with these normals (p, 3), 0 of those on faces of cells, and curvatures (p, 3, 3)
    [1/m]. Cells that are no boxes have no lattice: nothing stands out."""
    h = 0.5 * body.edges * body.boxes
    squares = 0.125 * h**2
    octant = (rest - body.x_rest[body.cell_nodes[0, 0]]) @ body.axes / (0.5 * body.edges)
    return Lattice(
        octant,
        squares * np.einsum("ia,pij,ja->pa", body.axes, bends, body.axes),
        squares * (1.0 - (normal @ body.axes) ** 2),
        0.5 * np.trace(bends, axis1=1, axis2=2),
    )


def curvatures_everywhere(body: Body) -> Floats:
    """`curvatures`, and at points that no tool touches those of the nearest that one does (P, 3, 3) [1/m]."""
    rest, touched = rest_points(body), np.flatnonzero(body.surface.area > 0.0)
    _, nearest = cKDTree(rest[touched]).query(rest)
    return np.asarray(curvatures(body)[touched][nearest])


def curvatures(body: Body) -> Floats:
    """How the normal turns along the surface at the points of it that tools touch, positive where it is round, 0 at
    others and at creases (P, 3, 3) [1/m].

    K of least sum |n_j - n - K (x_j - x)|^2, in the tangent plane, over points nearer than half a cell's edge.
    """
    surface, reach = body.surface, 0.5 * body.resolution
    touched = np.flatnonzero(surface.area > 0.0)
    x, normal = rest_points(body)[touched], surface.normal[touched]
    curvature = np.zeros((body.n_points, 3, 3))
    pairs = cKDTree(x).query_pairs(reach, output_type="ndarray")
    first, second = pairs.T
    alike = np.einsum("pi,pi->p", normal[first], normal[second]) > NO_CREASE
    first, second = first[alike], second[alike]
    spread, turn = np.zeros((len(x), 3, 3)), np.zeros((len(x), 3, 3))
    for here, there in ((first, second), (second, first)):
        n = normal[here]
        away, other = x[there] - x[here], normal[there]
        away = away - np.einsum("pi,pi->p", away, n)[:, None] * n
        other = other - np.einsum("pi,pi->p", other, n)[:, None] * n
        for row in range(3):
            for column in range(3):
                spread[:, row, column] += np.bincount(here, away[:, row] * away[:, column], len(x))
                turn[:, row, column] += np.bincount(here, other[:, row] * away[:, column], len(x))
    # along a direction in which there are no points around there is no curvature, nor across the surface
    curvature[touched] = turn @ np.linalg.pinv(spread, rcond=0.01, hermitian=True)
    return curvature
