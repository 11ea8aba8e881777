"""Where things are in cells that are no boxes: points in them, samples of stress, and what viewers draw."""

from itertools import product

import numpy as np

from softseam_services.body import tetrahedron
from softseam_services.body.body import ALIKE, Body, Floats, Ints
from softseam_services.body.interpolate import hex27
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.body.tetrahedral_surface import lay_out

_ROUNDS = 30
_BULGE = 0.25
"""of a cell's extent, by which its curved faces may stand out beyond its nodes"""
_FACE_MIDDLES = (12, 14, 10, 16, 4, 22)


def local_place(body: Body, at: Floats) -> tuple[int, Floats] | None:
    """Cell that holds the point `at` (3,) [m] at rest, and its local coordinates there, by Newton's method; or None."""
    if body.tetrahedra:
        return _place_in_tetrahedra(body, at)
    corners = body.x_rest[body.cell_nodes]  # (c, 27, 3)
    low, high = corners.min(axis=1), corners.max(axis=1)
    near = np.all((at >= low - _BULGE * (high - low)) & (at <= high + _BULGE * (high - low)), axis=1)
    value, slope = np.empty(27), np.empty((27, 3))
    for cell in np.flatnonzero(near):
        x, local = corners[cell], np.zeros(3)
        for _ in range(_ROUNDS):
            hex27(local, value, slope)
            step = np.linalg.solve(x.T @ slope, at - value @ x)
            local = np.clip(local + step, -1.5, 1.5)
            if np.abs(step).max() < 1e-12:
                break
        if np.abs(local).max() <= 1.0 + ALIKE and np.abs(step).max() < 1e-9:
            return int(cell), np.clip(local, -1.0, 1.0)
    return None


def _place_in_tetrahedra(body: Body, at: Floats) -> tuple[int, Floats] | None:
    """`local_place` in cells that are tetrahedra."""
    nodes = body.x_rest[body.cell_nodes[:, tetrahedron.NODES]]  # (c, 10, 3)
    low, high = nodes.min(axis=1), nodes.max(axis=1)
    near = np.all((at >= low - _BULGE * (high - low)) & (at <= high + _BULGE * (high - low)), axis=1)
    for cell in np.flatnonzero(near):
        x, place = nodes[cell], np.full(4, 0.25)
        for _ in range(_ROUNDS):
            value, slope = tetrahedron.shape_functions(place[None])
            step = np.linalg.solve(x.T @ slope[0], at - value[0] @ x)
            place[1:] = np.clip(place[1:] + step, -1.0, 2.0)
            place[0] = 1.0 - place[1:].sum()
            if np.abs(step).max() < 1e-12:
                break
        if place.min() >= -ALIKE and np.abs(step).max() < 1e-9:
            inside = np.maximum(place, 0.0)
            return int(cell), tetrahedron.local_of(inside[None] / inside.sum())[0]
    return None


def sample_places(body: Body, sample: Floats) -> Floats:
    """Positions at rest of the samples +- sample (C,) in the octants of each cell (C, 8, 3) [m]; of tetrahedra the
    places whose stress octants report."""
    if body.tetrahedra:
        value = tetrahedron.shape_functions(tetrahedron.SAMPLES)[0]
        return np.asarray(np.einsum("oa,cai->coi", value, body.x_rest[body.cell_nodes[:, tetrahedron.NODES]]))
    signs = LOCAL[OCTANT_NODES].sum(axis=1) / 4.0 - 2.0  # -1 or 1 along each axis
    signs = np.sign(signs)
    t = sample[:, None, None] * signs[None]
    line = np.stack([0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)], axis=3)
    value = np.einsum("cpi,cpj,cpk->cpkji", line[:, :, 0], line[:, :, 1], line[:, :, 2]).reshape(len(t), 8, 27)
    return np.asarray(np.einsum("cpa,cai->cpi", value, body.x_rest[body.cell_nodes]))


def point_octants(body: Body) -> Ints:
    """Filled octants 8 cell + octant that meet at each surface point, or at the node next to it, the first eight of
    them, -1 for none (P, 8)."""
    surface = body.surface
    place = np.rint(surface.local + 1.0).astype(np.int64) @ np.array([1, 3, 9])
    node = body.cell_nodes[surface.cell, place]
    held = np.ones((8, 8), dtype=np.bool_)  # an octant's nodes that are there
    if body.tetrahedra:
        held = np.isin(OCTANT_NODES, tetrahedron.NODES) & (tetrahedron.FILL[:, None] > 0.0)
    nodes, octant = body.cell_nodes[:, OCTANT_NODES[held]].ravel(), np.repeat(np.arange(8), 8)[held.ravel()]
    octants = (8 * np.arange(body.n_cells)[:, None] + octant).ravel()
    order = np.argsort(nodes, kind="stable")
    sorted_nodes = nodes[order]
    first, last = np.searchsorted(sorted_nodes, node), np.searchsorted(sorted_nodes, node, side="right")
    column = np.arange(8)[None, :]
    found = octants[order[np.minimum(first[:, None] + column, len(order) - 1)]]
    return np.where(column < (last - first)[:, None], found, -1).astype(np.int32)


def cell_lines(body: Body) -> Ints:
    """Ends of the lines along the edges of outer faces, as surface points (L, 2)."""
    if body.tetrahedra:
        return lay_out(body.cell_nodes).lines
    surface = body.surface
    place = np.rint(surface.local + 1.0).astype(np.int64) @ np.array([1, 3, 9])
    point = np.full(body.n_nodes, -1, dtype=np.int64)
    point[body.cell_nodes[surface.cell, place]] = np.arange(len(place))
    lines = []
    for middle, (axis, side) in zip(_FACE_MIDDLES, product(range(3), (0, 2)), strict=True):
        outer = point[body.cell_nodes[:, middle]] >= 0
        stride = np.array([1, 3, 9])
        u, v = stride[(axis + 1) % 3], stride[(axis + 2) % 3]
        corner = side * stride[axis]
        for a, b in ((u, v), (v, u)):
            for edge in (0, 2 * b):
                for half in (0, a):
                    ends = corner + edge + half + np.array([0, a])
                    lines.append(point[body.cell_nodes[outer][:, ends]])
    return np.unique(np.sort(np.concatenate(lines), axis=1), axis=0).astype(np.int32)


def cell_volumes(body: Body) -> Floats:
    """Of each cell (C,) [m^3]."""
    density = body.of_octants([material.density for material in body.materials])[:, 0]
    return np.asarray(body.cell_mass.sum(axis=1) / density)
