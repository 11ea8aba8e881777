"""Planes in which a body mirrors itself: its cells, masses, materials and surface, what clamps it and how it starts.

Only planes across an axis that no cell is cut by: then one side of it is a body of whole cells. Gravity lies in them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.region import node_of_point

_SAME = 1e-9
"""of the shortest edge, of a mass, of a velocity: what differs by less is the same"""
_BOX = np.sqrt(7.0) / 2**21
"""of the longest extent: boxes that hold one point, with borders where points of no grid are likely to be"""
_CORNERS = np.array([2 * (o & 1) + 6 * (o >> 1 & 1) + 18 * (o >> 2 & 1) for o in range(8)])
"""local id of the corner in each octant"""
_OCTANT = np.full(27, -1)
_OCTANT[_CORNERS] = np.arange(8)


@dataclass(frozen=True)
class Mirror:
    """A plane across an axis, and what is where something's image is."""

    axis: int
    plane: float
    """where it crosses the axis [m]"""
    nodes: Ints
    """(N,)"""
    cells: Ints
    """(C,)"""


def find_mirrors(body: Body) -> tuple[Mirror, ...]:
    """All mirrors of a body; none of one that cells fill in part, or whose surface's points are no nodes."""
    if len(body.moments) or (node_of_point(body) < 0).any():
        return ()
    found = (_mirror(body, axis) for axis in range(3))
    return tuple(mirror for mirror in found if mirror is not None)


def _mirror(body: Body, axis: int) -> Mirror | None:
    x = body.x_rest
    near = _SAME * body.resolution
    plane = 0.5 * float(x[:, axis].min() + x[:, axis].max())
    beyond = x[body.cell_nodes, axis] - plane
    if abs(body.gravity[axis]) > 0.0 or ((beyond > near).any(axis=1) & (beyond < -near).any(axis=1)).any():
        return None
    nodes = _images(x, axis, plane, near)
    if nodes is None:
        return None
    at = np.full(body.n_nodes, -1, dtype=np.int32)
    at[body.cell_nodes[:, 13]] = np.arange(body.n_cells)
    cells = at[nodes[body.cell_nodes[:, 13]]]
    if (cells < 0).any():
        return None
    same = _cells_agree(body, nodes, cells) and _surface_agrees(body, nodes) and _starts_alike(body, axis, nodes)
    return Mirror(axis, plane, nodes, cells) if same else None


def mirrored(x: Floats, axis: int, plane: float) -> Floats:
    """Places (..., 3) mirrored in a plane across an axis [m]."""
    image = x.copy()
    image[..., axis] = 2.0 * plane - x[..., axis]
    return image


def _images(x: Floats, axis: int, plane: float, near: float) -> Ints | None:
    """Which node is where each one's image is (N,), None where one has none."""
    nodes = match(x, mirrored(x, axis, plane), near)
    return None if (nodes < 0).any() else nodes


def match(x: Floats, places: Floats, near: float) -> Ints:
    """Which of the points x (n, 3) is at each of places (m, 3), within `near` [m]; -1 where none is (m,)."""
    low = np.minimum(x.min(axis=0), places.min(axis=0))
    high = np.maximum(x.max(axis=0), places.max(axis=0))
    box = (high - low).max() * _BOX
    here, there = (np.floor((points - low) / box + 0.5).astype(np.int64) @ (1, 2**21, 2**42) for points in (x, places))
    order = np.argsort(here, kind="stable")
    found = order[np.minimum(np.searchsorted(here[order], there), len(x) - 1)].astype(np.int32)
    return np.where(np.abs(x[found] - places).max(axis=1) <= near, found, -1).astype(np.int32)


def _cells_agree(body: Body, nodes: Ints, cells: Ints) -> bool:
    """Whether each cell's image has the same nodes, fill and materials, and gives them the same masses."""
    image, there = nodes[body.cell_nodes], body.cell_nodes[cells]
    order, other = np.argsort(image, axis=1), np.argsort(there, axis=1)
    if not np.array_equal(np.take_along_axis(image, order, axis=1), np.take_along_axis(there, other, axis=1)):
        return False
    local = np.empty_like(order)
    np.put_along_axis(local, order, other, axis=1)
    octant = _OCTANT[local[:, _CORNERS]]
    if (octant < 0).any():
        return False
    mass = np.take_along_axis(body.cell_mass[cells], local, axis=1)
    return bool(
        np.allclose(mass, body.cell_mass, rtol=_SAME, atol=0.0)
        and np.array_equal(np.take_along_axis(body.octant_material[cells], octant, axis=1), body.octant_material)
        and np.allclose(np.take_along_axis(body.fill[cells], octant, axis=1), body.fill, rtol=_SAME, atol=0.0)
    )


def _surface_agrees(body: Body, nodes: Ints) -> bool:
    """Whether points stand for the same areas as those at their images."""
    at = node_of_point(body)
    point = np.full(body.n_nodes, -1)
    point[at] = np.arange(len(at))
    there = point[nodes[at]]
    return bool((there >= 0).all() and np.allclose(body.surface.area[there], body.surface.area, rtol=_SAME, atol=0.0))


def _starts_alike(body: Body, axis: int, nodes: Ints) -> bool:
    """Whether the same nodes are clamped, and start with the same velocities."""
    v = mirrored(body.v_initial, axis, 0.0)
    close = np.abs(body.v_initial[nodes] - v).max(initial=0.0) <= _SAME * np.abs(v).max(initial=0.0)
    return bool(close and np.array_equal(body.fixed[nodes], body.fixed))
