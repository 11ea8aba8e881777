"""Planes of symmetry of a body, through its middle: cells, masses, materials, surface, clamps and initial velocities.

Only planes across an axis that no cell is cut by: then one side of it is a body of whole cells. Gravity lies in them.
"""

from dataclasses import dataclass

import numpy as np

from softseam_services.body.body import SAME, Body, Floats, Ints
from softseam_services.body.errors import SettingError
from softseam_services.body.region import node_of_point

_BOX = np.sqrt(7.0) / 2**21
"""of the longest extent: boxes that hold one point, with borders where points of no grid are likely to be"""
_CORNERS = np.array([2 * (o & 1) + 6 * (o >> 1 & 1) + 18 * (o >> 2 & 1) for o in range(8)])
"""local id of the corner in each octant"""
_OCTANT = np.full(27, -1)
_OCTANT[_CORNERS] = np.arange(8)


@dataclass(frozen=True)
class SymmetryPlane:
    """A plane across an axis, and what is where something's image is."""

    axis: int
    place: float
    """where it crosses the axis [m]"""
    nodes: Ints
    """(N,)"""
    cells: Ints
    """(C,)"""


def asymmetric(axis: int, why: str) -> SettingError:
    """The refusal of a scene that is not symmetric across an axis."""
    name = "xyz"[axis]
    return SettingError(f"symmetry: the scene is not symmetric in {name}: {why}; or leave {name} out of `symmetry`")


def symmetry_plane(body: Body, axis: int) -> SymmetryPlane:
    """The plane across an axis through the middle of a body. Raises SettingError where the body is not symmetric."""
    x = body.x_rest
    near = SAME * body.resolution
    place = 0.5 * float(x[:, axis].min() + x[:, axis].max())
    if len(body.moments) or (node_of_point(body) < 0).any():
        raise asymmetric(axis, "cells that a mesh fills in part have no images: use a block, or `cells: own`")
    if abs(body.gravity[axis]) > 0.0:
        raise asymmetric(axis, "gravity crosses the plane: give it no component there")
    beyond = x[body.cell_nodes, axis] - place
    if ((beyond > near).any(axis=1) & (beyond < -near).any(axis=1)).any():
        raise asymmetric(axis, "the plane cuts cells: choose body.cell such that their number is even there")
    nodes = match(x, mirrored(x, axis, place), near)
    if (nodes < 0).any():
        raise asymmetric(axis, "a cell's node has no image: give cells that are images of each other")
    at = np.full(body.n_nodes, -1, dtype=np.int32)
    at[body.cell_nodes[:, 13]] = np.arange(body.n_cells)
    cells = at[nodes[body.cell_nodes[:, 13]]]
    if (cells < 0).any() or not _surface_agrees(body, nodes):
        raise asymmetric(axis, "a cell has no image: give cells that are images of each other")
    if not _cells_agree(body, nodes, cells):
        raise asymmetric(axis, "an inclusion is not its own image: move it into the plane, or add its image")
    if not np.array_equal(body.fixed[nodes], body.fixed):
        raise asymmetric(axis, "body.fixed clamps one side: clamp its image, too")
    v = mirrored(body.v_initial, axis, 0.0)
    if np.abs(body.v_initial[nodes] - v).max(initial=0.0) > SAME * np.abs(v).max(initial=0.0):
        raise asymmetric(axis, "body.velocity or body.spin crosses the plane: leave it out")
    return SymmetryPlane(axis, place, nodes, cells)


def mirrored(x: Floats, axis: int, place: float) -> Floats:
    """Places (..., 3) mirrored in a plane across an axis [m]."""
    image = x.copy()
    image[..., axis] = 2.0 * place - x[..., axis]
    return image


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
        np.allclose(mass, body.cell_mass, rtol=SAME, atol=0.0)
        and np.array_equal(np.take_along_axis(body.octant_material[cells], octant, axis=1), body.octant_material)
        and np.allclose(np.take_along_axis(body.fill[cells], octant, axis=1), body.fill, rtol=SAME, atol=0.0)
    )


def _surface_agrees(body: Body, nodes: Ints) -> bool:
    """Whether points stand for the same areas as those at their images."""
    at = node_of_point(body)
    point = np.full(body.n_nodes, -1)
    point[at] = np.arange(len(at))
    there = point[nodes[at]]
    return bool((there >= 0).all() and np.allclose(body.surface.area[there], body.surface.area, rtol=SAME, atol=0.0))
