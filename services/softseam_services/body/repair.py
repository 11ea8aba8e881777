"""What is repaired of a surface before it is judged: only what moves it by next to nothing, and all of it reported.

Triangles that are there twice or have a corner twice are left out; points on open edges that nearly coincide are
welded; open edges are split at points that lie on them; small holes are closed; triangles without area, whose corners
lie on a line, give their middle corner to the neighbour across.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from softseam_services.body.body import Floats, Ints
from softseam_services.body.formats.polygons import triangulate

FLAT = 1e-12
"""of the extent squared: triangles of less area have none"""
_NEAR, _NEAR_EDGE = 1e-3, 0.1
"""of the extent, and of the shortest open edge there: points on open edges that are nearer are one"""
_ON_EDGE = 1e-5
"""of the extent: a point that is nearer to an open edge lies on it"""
_HOLE_AREA, _HOLE_SPAN = 0.02, 0.3
"""of the surface's area, and of its extent: holes that are smaller are closed"""
_MOST_OPEN = 20_000
"""open edges; with more a surface is open on purpose"""
_MOST_PASSES = 50
_MOST_SPLITS = 1_000
_SAME_ANGLE = 1e-3
"""[rad]"""


@dataclass(frozen=True)
class Repaired:
    """A surface, and what was done to it."""

    vertices: Floats
    """(n, 3)"""
    triangles: Ints
    """(T, 3)"""
    part: NDArray[np.int64]
    """number of the name that each triangle belongs to (T,)"""
    notes: tuple[str, ...]


def repair(vertices: Floats, triangles: Ints, part: NDArray[np.int64], unit: float = 1.0) -> Repaired:
    """Repair what is safe. A surface without faults comes back as it is, to the last bit.

    vertices (n, 3) of any unit, triangles (T, 3), part (T,), unit: metres in one of the unit, for what is reported
    """
    work = _Work(vertices, triangles, part, unit)
    if len(triangles):
        work.leave_out_doubles()
        if 0 < len(work.open_edges()) <= _MOST_OPEN:
            work.weld()
            work.split_at_points()
            work.close_holes()
        work.part_where_it_touches()
        work.flatten_away()
    return Repaired(work.vertices, work.triangles, work.part, tuple(work.notes))


def edges_of(triangles: Ints) -> tuple[Ints, Ints, NDArray[np.int64], NDArray[np.bool_]]:
    """Edges (E, 2), how many triangles meet there (E,), the edge of each side (3 T,), whether the side runs upward."""
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    low, high = sides.min(axis=1).astype(np.int64), sides.max(axis=1).astype(np.int64)
    key = low * (int(high.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    first = np.diff(key[order], prepend=-1) > 0
    number = np.empty(len(key), dtype=np.int64)
    number[order] = np.cumsum(first) - 1
    at = order[first]
    edges = np.stack([low[at], high[at]], axis=1).astype(np.int32)
    return edges, np.bincount(number, minlength=len(edges)).astype(np.int32), number, sides[:, 0] < sides[:, 1]


class _Work:
    """A surface under repair."""

    def __init__(self, vertices: Floats, triangles: Ints, part: NDArray[np.int64], unit: float) -> None:
        self.vertices, self.triangles, self.part, self.notes = vertices, triangles, part, list[str]()
        self._unit = unit
        self._extent = float(np.ptp(vertices[triangles.ravel()], axis=0).max()) if len(triangles) else 0.0

    def open_edges(self) -> Ints:
        """Edges with one triangle (k, 2)."""
        edges, count, _, _ = edges_of(self.triangles)
        found: Ints = edges[count == 1]
        return found

    def leave_out_doubles(self) -> None:
        """Drop triangles with a corner twice, and of those with the same corners all but one, or, where as many face
        either way and the surface closes better without them, all: walls between touching solids, and fins."""
        whole = _whole(self.triangles)
        if not whole.all():
            self.notes.append(f"{int((~whole).sum())} triangles with a corner twice were left out")
            self._keep(whole)
        _, first, number, count = np.unique(
            np.sort(self.triangles, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        if (count == 1).all():
            return
        one = np.zeros(len(self.triangles), dtype=np.bool_)
        one[first] = True
        facing = np.zeros(len(count))
        np.add.at(facing, number.ravel(), _sense(self.triangles))
        none = one & ~((facing == 0.0) & (count > 1))[number.ravel()]
        kept = none if _faults(self.triangles[none]) < _faults(self.triangles[one]) else one
        self.notes.append(f"{int((~kept).sum())} triangles that were there twice were left out")
        self._keep(kept)

    def _keep(self, mask: NDArray[np.bool_]) -> None:
        self.triangles, self.part = self.triangles[mask], self.part[mask]

    def part_where_it_touches(self) -> None:
        """Part edges of four triangles or more, where a surface touches itself: each two that bound a wedge of the
        solid get the edge's ends to themselves, or, where these hold together elsewhere, a middle of their own."""
        edges, count, _, _ = edges_of(self.triangles)
        before, n_bad = int((count != 2).sum()), int(((count > 2) & (count % 2 == 0)).sum())
        if not 0 < n_bad <= _MOST_OPEN:
            return
        parted = _Work(*_parted(self.vertices, self.triangles), self.part, self._unit)
        edges, count, _, _ = edges_of(parted.triangles)
        for edge in np.flatnonzero((count > 2) & (count % 2 == 0))[:_MOST_SPLITS]:
            parted.vertices = np.concatenate([parted.vertices, parted.vertices[edges[edge]].mean(axis=0)[None]])
            parted.split(edges[edge], len(parted.vertices) - 1)
        parted.vertices, parted.triangles = _parted(parted.vertices, parted.triangles)
        if _faults(parted.triangles) < before and len(parted.open_edges()) <= len(self.open_edges()):
            self.vertices, self.triangles, self.part = parted.vertices, parted.triangles, parted.part
            self.notes.append(f"{n_bad} edges along which the surface touches itself were parted")

    def split(self, ends: Ints, point: int) -> None:
        """Split all triangles at an edge (2,) at a point on it."""
        mine = np.flatnonzero(np.isin(self.triangles, ends).sum(axis=1) == 2)
        halves = [np.where(self.triangles[mine] == end, point, self.triangles[mine]) for end in ends]
        self.triangles = np.concatenate([self.triangles, halves[1]]).astype(np.int32)
        self.triangles[mine] = halves[0]
        self.part = np.concatenate([self.part, self.part[mine]])

    def weld(self) -> None:
        """Merge points on open edges that are much nearer to one another than these edges are long."""
        edges = self.open_edges()
        length = np.linalg.norm(self.vertices[edges[:, 0]] - self.vertices[edges[:, 1]], axis=1)
        shortest = np.full(len(self.vertices), np.inf)
        np.minimum.at(shortest, edges, length[:, None])
        points = np.unique(edges)
        x = self.vertices[points]
        pairs = cKDTree(x).query_pairs(
            min(_NEAR * self._extent, _NEAR_EDGE * float(length.max())), output_type="ndarray"
        )
        apart = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
        near = apart < _NEAR_EDGE * shortest[points[pairs]].min(axis=1)
        pairs, apart = pairs[near], apart[near]
        if not len(pairs):
            return
        links = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
        _, group = connected_components(links, directed=False)
        first = np.full(len(points), len(points))
        np.minimum.at(first, group, np.arange(len(points)))
        target = np.arange(len(self.vertices))
        target[points] = points[first[group]]
        welded = _Work(self.vertices, target[self.triangles].astype(np.int32), self.part, self._unit)
        welded.leave_out_doubles()
        if len(welded.open_edges()) < len(edges):
            self.triangles, self.part = welded.triangles, welded.part
            n = int((first[group] != np.arange(len(points))).sum())
            self.notes.append(f"{n} double points, up to {self._length(float(apart.max()))} apart, were welded")
            self.notes += welded.notes

    def split_at_points(self) -> None:
        """Split triangles at points of open edges that lie on an open edge of theirs."""
        before, split = len(self.open_edges()), 0
        triangles, part = self.triangles, self.part
        for _ in range(_MOST_PASSES):
            edges, count, number, _ = edges_of(triangles)
            at, point = _points_on(self.vertices, edges, np.flatnonzero(count == 1), _ON_EDGE * self._extent)
            side = np.full(len(edges), -1)
            side[number] = np.arange(len(number))
            whose, first = np.unique(side[at] // 3, return_index=True)  # one edge of a triangle at a time
            if not len(whose):
                break
            corner, point = side[at][first] % 3, point[first]
            halves = triangles[whose].copy()
            rest = triangles[whose].copy()
            halves[np.arange(len(whose)), (corner + 1) % 3] = point
            rest[np.arange(len(whose)), corner] = point
            triangles = triangles.copy()
            triangles[whose] = halves
            triangles, part = np.concatenate([triangles, rest]), np.concatenate([part, part[whose]])
            whole = _whole(triangles)  # nothing is left of one whose own third corner lies on its edge
            triangles, part = triangles[whole], part[whole]
            split += len(whose)
        _, count, _, _ = edges_of(triangles)
        if split and int((count == 1).sum()) < before:
            self.triangles, self.part = triangles.astype(np.int32), part
            self.notes.append(f"{split} open edges were split at points that lie on them")

    def close_holes(self) -> None:
        """Close small holes by triangles between their corners."""
        _, count, number, _ = edges_of(self.triangles)
        sides = np.flatnonzero(count[number] == 1)
        ends = np.stack(
            [self.triangles[sides // 3, (sides % 3 + 1) % 3], self.triangles[sides // 3, sides % 3]], axis=1
        )
        corners = self.vertices[self.triangles]
        area = 0.5 * float(
            np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        )
        found: list[Ints] = []
        part: list[int] = []
        closed: list[tuple[int, float]] = []
        for loop, first in _loops(ends):
            x = self.vertices[loop]
            size = 0.5 * float(np.linalg.norm(np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)))
            span = float(np.ptp(x, axis=0).max())
            if size <= _HOLE_AREA * area and span <= _HOLE_SPAN * self._extent:
                found.append(triangulate(self.vertices, loop).astype(np.int32))
                part += [int(self.part[sides[first] // 3])] * (len(loop) - 2)
                closed.append((len(loop), span))
        if closed:
            self.triangles = np.concatenate([self.triangles, *found])
            self.part = np.concatenate([self.part, np.array(part, dtype=np.int64)])
            widest = self._length(max(span for _, span in closed))
            sizes = ", ".join(str(n) for n, _ in closed[:5]) + (", ..." if len(closed) > 5 else "")
            holes = f"a pinhole of {sizes} edges" if len(closed) == 1 else f"{len(closed)} pinholes of {sizes} edges"
            self.notes.append(f"{holes}, up to {widest} wide, {'was' if len(closed) == 1 else 'were'} closed")

    def flatten_away(self) -> None:
        """Give the middle corner of triangles without area to the neighbour across their longest edge."""
        removed = 0
        for _ in range(_MOST_PASSES):
            x = self.vertices[self.triangles]
            area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
            flat = np.flatnonzero(area < FLAT * self._extent**2)
            if not len(flat) or len(flat) == len(area):
                break
            done = self._flip(flat, x)
            if not done:
                break
            removed += done
        if removed:
            self.notes.append(f"{removed} triangles without area were joined to their neighbours")

    def _flip(self, flat: NDArray[np.int64], x: Floats) -> int:
        edges, count, number, _ = edges_of(self.triangles)
        known = {tuple(edge) for edge in edges[np.isin(edges, self.triangles[flat]).any(axis=1)].tolist()}
        order = np.argsort(number, kind="stable")
        start = np.cumsum(count) - count
        longest = np.argmax(np.linalg.norm(x[flat][:, [1, 2, 0]] - x[flat], axis=2), axis=1)
        taken: set[int] = set()
        triangles, done = self.triangles.copy(), 0
        for one, side in zip(flat.tolist(), longest.tolist(), strict=True):
            edge = number[3 * one + side]
            if count[edge] != 2:
                continue
            two = int(next(each for each in order[start[edge] : start[edge] + 2] // 3 if each != one))
            a, b, c = (int(self.triangles[one, (side + k) % 3]) for k in range(3))
            (d,) = (int(corner) for corner in self.triangles[two] if corner not in (a, b))
            new = (min(c, d), max(c, d))
            if one in taken or two in taken or c == d or new in known:
                continue
            known.add(new)
            taken |= {one, two}
            halves = self.triangles[[two, two]]
            halves[0][halves[0] == a] = c
            halves[1][halves[1] == b] = c
            triangles[[two, one]] = halves
            done += 1
        self.triangles = triangles
        return done

    def _length(self, value: float) -> str:
        return f"{1e3 * self._unit * value:.3g} mm"


def _whole(triangles: Ints) -> NDArray[np.bool_]:
    """Which triangles have three different corners (T,)."""
    a, b, c = triangles.T
    found: NDArray[np.bool_] = (a != b) & (b != c) & (c != a)
    return found


def _faults(triangles: Ints) -> int:
    """Edges that have not two triangles; of no triangles, more than of any others."""
    return int((edges_of(triangles)[1] != 2).sum()) if len(triangles) else 1 << 62


def _sense(triangles: Ints) -> NDArray[np.int64]:
    """1 where corners ascend from the least on, -1 where they descend (T,)."""
    first = np.argmin(triangles, axis=1)
    rows = np.arange(len(triangles))
    return np.where(triangles[rows, (first + 1) % 3] < triangles[rows, (first + 2) % 3], 1, -1)


def _wedges(
    vertices: Floats, triangles: Ints, sides: NDArray[np.int64], upward: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Pairs of sides (k, 2) between which the solid is, of those that an edge has; none where they do not alternate.

    Seen along the edge, the solid is after a triangle that runs against it, up to the next one that runs along it.
    """
    nothing = np.zeros((0, 2), dtype=np.int64)
    low, high = sorted(int(triangles[sides[0] // 3, (sides[0] % 3 + k) % 3]) for k in (0, 1))
    along = vertices[high] - vertices[low]
    away = vertices[triangles[sides // 3, (sides % 3 + 2) % 3]] - vertices[low]
    u = away[0] - (away[0] @ along) / (along @ along) * along
    v = np.cross(along, u) / np.linalg.norm(along)
    angle = np.arctan2(away @ v, away @ u)
    order = np.argsort(angle)
    place = np.empty(len(sides), dtype=np.int64)
    place[order] = np.cumsum(np.diff(angle[order], prepend=-np.inf) > _SAME_ANGLE)
    turn = np.lexsort((~upward[sides], place))  # where two lie on one another, a wedge ends before the next begins
    around, ahead = sides[turn], upward[sides[turn]]
    if (ahead == np.roll(ahead, 1)).any():
        return nothing
    first = int(np.argmin(ahead))
    return np.roll(around, -first).reshape(-1, 2)


def _parted(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Vertices, some of them again, and triangles, those apart that hang together only along edges of four or more."""
    edges, count, number, upward = edges_of(triangles)
    bad = np.flatnonzero((count > 2) & (count % 2 == 0))
    if not len(bad):
        return vertices, triangles
    order, start = np.argsort(number, kind="stable"), np.cumsum(count) - count
    pairs = [order[start[count == 2][:, None] + np.arange(2)]]
    pairs += [_wedges(vertices, triangles, order[start[edge] : start[edge] + count[edge]], upward) for edge in bad]
    one, two = np.concatenate(pairs).T
    flat = triangles.ravel()
    after, ahead = (3 * (side // 3) + (side % 3 + 1) % 3 for side in (one, two))  # corners at the sides' ends
    same = flat[two] == flat[one]
    rows = np.concatenate([one, after])
    columns = np.concatenate([np.where(same, two, ahead), np.where(same, ahead, two)])
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(flat),) * 2)
    _, fan = connected_components(links, directed=False)
    mine = np.flatnonzero(np.isin(flat, edges[bad]))
    keys, number = np.unique(np.stack([flat[mine], fan[mine]], axis=1), axis=0, return_inverse=True)
    again = np.concatenate([[False], keys[1:, 0] == keys[:-1, 0]])
    target = keys[:, 0].copy()
    target[again] = len(vertices) + np.arange(int(again.sum()))
    corners = flat.copy()
    corners[mine] = target[number.ravel()]
    return np.concatenate([vertices, vertices[keys[again, 0]]]), corners.reshape(-1, 3).astype(np.int32)


def _points_on(
    vertices: Floats, edges: Ints, open_edges: NDArray[np.int64], tolerance: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Open edges that a point of another one lies on, and that point, the nearest to the edge's middle."""
    points = np.unique(edges[open_edges])
    if not len(points):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    a, b = vertices[edges[open_edges, 0]], vertices[edges[open_edges, 1]]
    middle, half = 0.5 * (a + b), 0.5 * np.linalg.norm(b - a, axis=1)
    at, on = [], []
    for number, around in enumerate(cKDTree(vertices[points]).query_ball_point(middle, half * (1.0 + 1e-9))):
        near = points[around]
        near = near[(near != edges[open_edges[number], 0]) & (near != edges[open_edges[number], 1])]
        if len(near):
            along = (b[number] - a[number]) / (2.0 * half[number])
            offset = vertices[near] - middle[number]
            across = np.linalg.norm(offset - (offset @ along)[:, None] * along, axis=1)
            inside = (across <= tolerance) & (np.abs(offset @ along) < half[number] - tolerance)
            if inside.any():
                at.append(open_edges[number])
                on.append(near[inside][np.argmin(np.abs(offset[inside] @ along))])
    return np.array(at, dtype=np.int64), np.array(on, dtype=np.int64)


def _loops(ends: Ints) -> list[tuple[list[int], int]]:
    """Closed loops of sides (k, 2) that meet two at a point, each as its points, and its first side."""
    at: dict[int, list[int]] = {}
    for side, (start, end) in enumerate(ends.tolist()):
        at.setdefault(start, []).append(side)
        at.setdefault(end, []).append(side)
    pairs, seen, loops = ends.tolist(), np.zeros(len(ends), dtype=np.bool_), []
    for first in range(len(ends)):
        if seen[first]:
            continue
        loop, side, point = [pairs[first][0]], first, pairs[first][1]
        seen[first] = True
        while point != loop[0] and len(at[point]) == 2:
            loop.append(point)
            side = at[point][0] if at[point][1] == side else at[point][1]
            seen[side] = True
            point = pairs[side][1] if pairs[side][0] == point else pairs[side][0]
        if point == loop[0] and len(loop) > 2 and len(at[point]) == 2:
            loops.append((loop, first))
    return loops
