"""What crosses -> one solid: closed bodies that overlap or touch are united, points at which a surface pokes through
itself are left out."""

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import SAME, Floats, Ints
from softseam_services.body.formats.polygons import MOST_CORNERS, triangulate
from softseam_services.body.one_body import DUST
from softseam_services.body.repair import edges_of, repair
from softseam_services.body.surface_check import crossings, enclosed_volume, orient

_MOST_BODIES = 500
"""that are united; with more a file is no solid in pieces"""
_FEW = 100
"""pairs of edge and triangle that cross; with more it is no slip of a point"""
_MOST_POINTS, _MOST_TRIANGLES = 10, 300_000
"""points that are left out, and triangles of a surface for which that is tried: each trial looks for crossings anew"""
_SAME_VOLUME = 1e-2
"""relative: what may be lost or won by leaving points out"""

Mended = tuple[Floats, Ints, float, str]
"""vertices (n, 3), triangles (T, 3), the volume inside [m^3], and what was done"""


def mend(path: str, vertices: Floats, triangles: Ints) -> Mended | None:
    """A surface of closed shells as that of one solid, None where this does not do; raises MeshError where what
    comes of it is no surface. It is yet to be checked."""
    return _unite(path, vertices, triangles) or _without_slips(vertices, triangles)


def _unite(path: str, vertices: Floats, triangles: Ints) -> Mended | None:
    """The union of bodies, each with its cavities; None of one body, or where a cavity may be a body as well."""
    triangles, _, shell = orient(path, vertices, triangles)
    shells = [triangles[shell == number] for number in range(int(shell.max()) + 1)]
    if not 1 < len(shells) <= _MOST_BODIES:
        return None
    volumes = [enclosed_volume(vertices, each) for each in shells]
    around = [_around(vertices, shells, number) for number in range(len(shells))]
    if any(others and volume > 0.0 for others, volume in zip(around, volumes, strict=True)):
        return None
    bodies = {number: [each if volumes[number] > 0.0 else each[:, [0, 2, 1]]]
              for number, each in enumerate(shells) if not around[number]}  # fmt: skip
    for number, others in enumerate(around):
        if others:
            bodies[min(others, key=lambda other: abs(volumes[other]))].append(shells[number])
    if len(bodies) < 2:
        return None
    import manifold3d  # for such files alone

    solids, extent = [], float(np.ptp(vertices, axis=0).max())
    for each in bodies.values():
        used, corners = np.unique(np.concatenate(each), return_inverse=True)
        mesh = manifold3d.Mesh64(vertices[used], corners.reshape(-1, 3).astype(np.uint64))
        solids.append(manifold3d.Manifold(mesh).set_tolerance(SAME * extent))
    union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    if union.status() != manifold3d.Error.NoError or union.is_empty():
        return None
    found = union.to_mesh64()
    whole = repair(
        np.array(found.vert_properties[:, :3]),
        np.array(found.tri_verts, dtype=np.int32),
        np.zeros(len(found.tri_verts), dtype=np.int64),
    )
    separate, volume = sum(solid.volume() for solid in solids), union.volume()
    triangles, _, shell = orient(path, whole.vertices, whole.triangles)
    parts = [triangles[shell == number] for number in range(int(shell.max()) + 1)]
    triangles = np.concatenate([each for each in parts if abs(enclosed_volume(whole.vertices, each)) > DUST * volume])
    shares = f"{1e6 * volume:.3g} cm^3 of the {1e6 * separate:.3g} cm^3 that they have separately"
    note = f"{len(solids)} closed bodies that overlap or touch were united: {shares}"
    used, corners = np.unique(triangles, return_inverse=True)
    return whole.vertices[used], corners.reshape(-1, 3).astype(np.int32), volume, note


def _around(vertices: Floats, shells: list[Ints], number: int) -> list[int]:
    """The shells that one lies wholly in, by the winding number of each of its corners."""
    import igl

    mine = vertices[np.unique(shells[number])]
    low, high = mine.min(axis=0), mine.max(axis=0)
    found = []
    for other, triangles in enumerate(shells):
        corners = vertices[triangles].reshape(-1, 3)
        if other != number and (corners.min(axis=0) <= low).all() and (corners.max(axis=0) >= high).all():
            inside = np.abs(igl.winding_number(vertices, triangles.astype(np.int64), mine)) > 0.5
            if inside.all():
                found.append(other)
    return found


def _without_slips(vertices: Floats, triangles: Ints) -> Mended | None:
    """Leave out points at which a surface crosses itself, one by one, each time what is left crosses itself less."""
    if len(triangles) > _MOST_TRIANGLES:
        return None
    volume, removed = enclosed_volume(vertices, triangles), 0
    count, edge, triangle = crossings(vertices, triangles)
    while 0 < count <= _FEW and removed < _MOST_POINTS:
        points = np.unique([*edge, *triangles[triangle]])
        near = _around_points(vertices, triangles, points)
        fewer = _best(vertices, triangles[near], points)
        if fewer is None:
            return None
        triangles, removed = np.concatenate([triangles[~near], fewer]), removed + 1
        if not (edges_of(triangles)[1] == 2).all():
            return None
        count, edge, triangle = crossings(vertices, triangles)
    before, volume = volume, enclosed_volume(vertices, triangles)
    change = abs(volume / before - 1.0)
    if count or not removed or change > _SAME_VOLUME:
        return None
    used, corners = np.unique(triangles, return_inverse=True)
    what = (
        "points at which it pokes through itself were" if removed > 1 else "point at which it pokes through itself was"
    )
    note = f"{removed} {what} left out, which changes its volume by {100.0 * change:.1g} %"
    return vertices[used], corners.reshape(-1, 3).astype(np.int32), volume, note


def _around_points(vertices: Floats, triangles: Ints, points: Ints) -> NDArray[np.bool_]:
    """Which triangles may cross one that has a point among these: boxes around them meet (T,)."""
    corners = vertices[triangles]
    theirs = corners[np.isin(triangles, points).any(axis=1)].reshape(-1, 3)
    low, high = theirs.min(axis=0), theirs.max(axis=0)
    return np.asarray(((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1))


def _best(vertices: Floats, triangles: Ints, points: Ints) -> Ints | None:
    """The triangles without that of the points without which they cross one another least; None where that is no less
    than with it."""
    tried = [fewer for point in points.tolist() if (fewer := _left_out(vertices, triangles, point)) is not None]
    left = [crossings(vertices, fewer)[0] for fewer in tried]
    best = min(range(len(tried)), key=left.__getitem__, default=None)
    return None if best is None or left[best] >= crossings(vertices, triangles)[0] else tried[best]


def _left_out(vertices: Floats, triangles: Ints, point: int) -> Ints | None:
    """The triangles without a point, whose neighbours are joined in its place; None where it is in no single ring."""
    mine = (triangles == point).any(axis=1)
    ring = _ring(triangles[mine], point)
    if not 3 <= len(ring) <= MOST_CORNERS:
        return None
    return np.concatenate([triangles[~mine], triangulate(vertices, ring)]).astype(np.int32)


def _ring(triangles: NDArray[np.int32], point: int) -> list[int]:
    """The neighbours of a point in the order of its triangles; none where they are no single ring."""
    after = {}
    for corners in triangles.tolist():
        at = corners.index(point)
        after[corners[(at + 1) % 3]] = corners[(at + 2) % 3]
    ring = [next(iter(after))]
    while (following := after.get(ring[-1])) is not None and following != ring[0] and len(ring) < len(after):
        ring.append(following)
    return ring if len(ring) == len(after) == len(triangles) and after.get(ring[-1]) == ring[0] else []
