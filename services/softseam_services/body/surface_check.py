"""Is a surface the boundary of one solid body? Orientation is repaired where it can be; all else is refused by name."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from softseam_services.body.body import SAME, Floats, Ints
from softseam_services.body.errors import MeshError
from softseam_services.body.kernels.surface import find_crossings, grid_triangles
from softseam_services.body.repair import FLAT, edges_of

_THIN_SOLID = 1e-6


class Unmended(MeshError):
    """A surface that crosses itself, or bounds several bodies: a union may be one."""


@dataclass(frozen=True)
class Nesting:
    """Shells by number."""

    volumes: tuple[float, ...]
    """that they enclose, negative where they face inward [m^3]"""
    owner: tuple[int, ...]
    """the outermost shell of the body that each bounds: itself, or the one that a cavity lies in"""

    @property
    def outer(self) -> list[int]:
        """Shells that are no cavities, one a body."""
        return [shell for shell, owner in enumerate(self.owner) if shell == owner]


def check_surface(path: str, vertices: Floats, triangles: Ints) -> tuple[Ints, float, tuple[str, ...]]:
    """Triangles counter-clockwise from outside, the enclosed volume [m^3], notes on repairs; raises MeshError.

    vertices (n, 3) [m], triangles (T, 3)
    """
    _check_spread(path, vertices)
    _check_triangles(path, vertices, triangles)
    triangles, flipped, shell = orient(path, vertices, triangles)
    _check_crossings(path, vertices, triangles)
    triangles, inverted = _nest(path, vertices, triangles, shell)
    volume = enclosed_volume(vertices, triangles)
    if volume < _THIN_SOLID * float(np.ptp(vertices, axis=0).max()) ** 3:
        raise MeshError(f"{path}: the surface encloses {volume:.3g} m^3, next to nothing; give it a thickness")
    notes = []
    if flipped:
        notes.append(f"{flipped} triangles were turned over to agree with their neighbours")
    if inverted:
        notes.append(f"{inverted} shells were turned inside out: the outermost faces outward, one in it is a cavity")
    return triangles, volume, tuple(notes)


def enclosed_volume(vertices: Floats, triangles: Ints) -> float:
    """Volume inside a closed surface, sum of a . (b x c) / 6 about its centre."""
    corners = vertices[triangles] - vertices.mean(axis=0)
    return float(np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


def triangle_areas(vertices: Floats, triangles: Ints) -> Floats:
    """Area vectors (T, 3): normal times area."""
    corners = vertices[triangles]
    vectors: Floats = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return vectors


def _check_spread(path: str, vertices: Floats) -> None:
    spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if spread[-1] < SAME * spread[0]:
        raise MeshError(f"{path}: all points lie in a plane: a sheet has no inside; give it a thickness")


def _check_triangles(path: str, vertices: Floats, triangles: Ints) -> None:
    extent = float(np.ptp(vertices, axis=0).max())
    area = np.linalg.norm(triangle_areas(vertices, triangles), axis=1)
    flat = area < FLAT * extent**2
    if flat.all():
        raise MeshError(f"{path}: no triangle has an area; this is a mesh without volume")
    if flat.any():
        worst = int(np.argmin(area))
        at = vertices[triangles[worst]].mean(axis=0)
        raise MeshError(
            f"{path}: {int(flat.sum())} of {len(triangles)} triangles are degenerate, the worst is number {worst} at "
            f"{_place(at, vertices)} with area {area[worst]:.3g} m^2; collapse or remove them"
        )


def orient(path: str, vertices: Floats, triangles: Ints) -> tuple[Ints, int, Ints]:
    """Triangles that agree with their neighbours, how many were turned, and the shell of each (T,).

    Each triangle stands twice in a graph, as it is and turned over; neighbours are linked where they agree. A triangle
    that is connected to its own opposite lies on a one-sided surface.
    """
    edges, count, number, upward = edges_of(triangles)
    for wrong, what, remedy in (
        (count == 1, "open edges (with one triangle)", "close the holes"),
        (count > 2, "non-manifold edges (with three or more triangles)", "remove inner walls, and part what touches"),
    ):
        if wrong.any():
            worst = int(
                np.argmax(np.where(wrong, np.linalg.norm(np.diff(vertices[edges], axis=1)[:, 0], axis=1), -1.0))
            )
            raise MeshError(
                f"{path}: {int(wrong.sum())} {what} of {len(edges)}, the longest at "
                f"{_place(vertices[edges[worst]].mean(axis=0), vertices)}; {remedy}"
            )
    n_triangles = len(triangles)
    pairs = np.argsort(number, kind="stable").reshape(-1, 2)
    first, second = pairs[:, 0] // 3, pairs[:, 1] // 3
    agree = upward[pairs[:, 0]] != upward[pairs[:, 1]]
    opposite = np.where(agree, second, second + n_triangles)
    rows = np.concatenate([first, first + n_triangles])
    columns = np.concatenate([opposite, np.where(agree, second + n_triangles, second)])
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * n_triangles, 2 * n_triangles))
    _, sheet = connected_components(links, directed=False)
    one_sided = sheet[:n_triangles] == sheet[n_triangles:]
    if one_sided.any():
        raise MeshError(
            f"{path}: {int(one_sided.sum())} triangles lie on a one-sided surface, which has no inside; "
            "export a closed solid"
        )
    # Of the two sheets of a shell keep the one that leaves more triangles as they are; a tie goes to the first's.
    kept = np.bincount(sheet[:n_triangles], minlength=sheet.max() + 1)
    as_is, turned = sheet[:n_triangles], sheet[n_triangles:]
    turn = (kept[turned] > kept[as_is]) | ((kept[turned] == kept[as_is]) & (turned < as_is))
    triangles = np.where(turn[:, None], triangles[:, [0, 2, 1]], triangles)
    _, shell = np.unique(np.minimum(as_is, turned), return_inverse=True)
    return triangles.astype(np.int32), int(turn.sum()), shell.astype(np.int32)


def crossings(vertices: Floats, triangles: Ints) -> tuple[int, Ints, int]:
    """How many pairs of edge and triangle cross, and the ends (2,) and the triangle of the first."""
    edges = edges_of(triangles)[0]
    corners = vertices[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    origin, extent = vertices.min(axis=0), np.ptp(vertices, axis=0)
    spacing = max(float((high - low).max(axis=1).mean()), float(extent.max()) / 256.0)
    counts = np.maximum(1, np.ceil(extent / spacing)).astype(np.int64)
    start = np.zeros(int(counts.prod()) + 1, dtype=np.int64)
    nothing = np.zeros(0, dtype=np.int64)
    grid_triangles(low, high, origin, spacing, counts, start, nothing, False)
    ends = np.cumsum(start)
    entries = np.empty(int(ends[-1]), dtype=np.int64)
    cursor = np.concatenate([[0], ends[:-1]])
    bins = cursor.copy()
    grid_triangles(low, high, origin, spacing, counts, cursor, entries, True)
    first = np.zeros(2, dtype=np.int64)
    # Volumes carry rounding of some 1e-15 of the extent cubed.
    tolerance = 1e-14 * float(extent.max()) ** 3
    found = find_crossings(
        vertices, edges, triangles, low, high, origin, spacing, counts, bins, entries, tolerance, first
    )
    return int(found), edges[first[0]], int(first[1])


def _check_crossings(path: str, vertices: Floats, triangles: Ints) -> None:
    found, edge, triangle = crossings(vertices, triangles)
    if found:
        raise Unmended(
            f"{path}: the surface crosses itself, {found} pairs of edge and triangle do, the first near "
            f"{_place(vertices[edge].mean(axis=0), vertices)} (triangle {triangle}); unite overlapping parts, or move "
            "them apart"
        )


def nesting(vertices: Floats, triangles: Ints, shell: Ints) -> Nesting:
    """Which shells lie in which, of triangles (T, 3) that agree with their neighbours, shell (T,)."""
    import igl  # a third of a second, for meshes alone

    n_shells = int(shell.max()) + 1
    parts = [triangles[shell == s] for s in range(n_shells)]
    volumes = tuple(enclosed_volume(vertices, part) for part in parts)
    outward = [part if volume > 0.0 else part[:, [0, 2, 1]] for part, volume in zip(parts, volumes, strict=True)]
    low = np.array([vertices[part].min(axis=(0, 1)) for part in parts])
    high = np.array([vertices[part].max(axis=(0, 1)) for part in parts])
    around = [
        [
            int(other)
            for other in np.flatnonzero(((low <= low[s]) & (high >= high[s])).all(axis=1))
            if other != s
            and igl.winding_number(vertices, outward[other].astype(np.int64), vertices[parts[s][0, :1]])[0] > 0.5
        ]
        for s in range(n_shells)
    ]
    depth = [len(others) for others in around]
    owner = [
        next((other for other in around[s] if depth[other] == depth[s] - 1), s) if depth[s] % 2 else s
        for s in range(n_shells)
    ]
    return Nesting(volumes, tuple(owner))


def _nest(path: str, vertices: Floats, triangles: Ints, shell: Ints) -> tuple[Ints, int]:
    """Turn the outer shell outward and cavities inward; refuse bodies in pieces. Returns how many shells turned."""
    found = nesting(vertices, triangles, shell)
    outer = found.outer
    if len(outer) != 1:
        sizes = ", ".join(f"{abs(found.volumes[s]):.3g} m^3" for s in outer[:5]) + (", ..." if len(outer) > 5 else "")
        raise Unmended(
            f"{path}: the mesh is disconnected, it has {len(outer)} separate bodies ({sizes}); keep one, or join them"
        )
    result = triangles.copy()
    inverted = 0
    for s, volume in enumerate(found.volumes):
        if (volume > 0.0) != (s == outer[0]):
            result[shell == s] = triangles[shell == s][:, [0, 2, 1]]
            inverted += 1
    return result, inverted


def _place(point: Floats, vertices: Floats) -> str:
    """A point [m] as messages give it; what is rounding beside the surface's extent is 0."""
    shown = np.where(np.abs(point) < SAME * np.ptp(vertices, axis=0).max(), 0.0, point)
    return f"({shown[0]:.4g}, {shown[1]:.4g}, {shown[2]:.4g}) m"
