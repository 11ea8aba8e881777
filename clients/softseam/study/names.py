"""Where the names of marks stand: beside their own mark, which is then the nearest, or tied to it by a thin line.

Names are placed one after another, each where it costs least; those that did worst come first in the next round. All
lengths are points of the picture [pt]; page.html does the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Point = tuple[float, float]
Line = tuple[Point, Point]
Box = tuple[float, float, float, float]
"""left, bottom, right, top"""

AWAY = (8.0, 12.0, 16.0, 22.0, 30.0, 40.0, 52.0, 66.0, 82.0, 100.0, 120.0, 145.0, 175.0)
"""how far from its mark a name may stand"""
TURNS = (0.0, -45.0, 45.0, 180.0, -135.0, 135.0, -90.0, 90.0, -22.5, 22.5, -157.5, 157.5, -67.5, 67.5, -112.5, 112.5)
"""and in which directions, best first [degrees]"""
SAME = 4.0
"""marks closer than this cover each other: they share a name, or its place"""
CLEAR = 4.5
"""what a mark keeps around its centre"""
START, TIED = 6.0, 15.0
"""where a line begins, from its mark's centre, and how far away its name is at least, for it to be seen"""
STRUCK, TOUCHED, CROSSED, PASSED, LED, BESIDE = 30.0, 4.0, 60.0, 25.0, 10.0, 10.0
"""what is no worse than so much more distance: a name on the front's line, each point of that line that a name's line
touches, a crossing of names' lines, a mark on one, a line at all, and a name led to beside another's mark"""
LEVEL = 0.4
"""a mark at the height of a name seems to be its, though it be farther than this one: by so much nearer [1]"""
NOWHERE = 300.0
"""and no name at all"""
ROUNDS = 16


@dataclass(frozen=True)
class Place:
    """Where a name stands."""

    box: Box
    line: Line | None
    """from its mark, where that is not plainly the nearest"""


@dataclass(frozen=True)
class Picture:
    """What names have to get along with."""

    frame: Box
    marks: Floats
    """centres of all marks (n, 2)"""
    front: Floats
    """points along the line that names had better not stand on (m, 2)"""
    taken: tuple[Box, ...] = ()
    """what no name may cover"""


def places(picture: Picture, named: Sequence[tuple[Point, Point]]) -> list[Place | None]:
    """A place for each name, given its mark's centre and its own width and height; None where all is full."""
    best: list[Place | None] = []
    least, hard = np.inf, np.zeros(len(named))
    for _ in range(ROUNDS):
        order = np.argsort(-hard, kind="stable")
        found, costs = _in_turn(picture, [named[i] for i in order])
        hard[order] = 0.5 * hard[order] + costs
        if sum(costs) < least:
            least, best = sum(costs), [found[i] for i in np.argsort(order)]
    return best


def together(marks: Floats) -> list[list[int]]:
    """Indices of marks (n, 2) in groups of those that cover each other, in order."""
    found: list[list[int]] = []
    for i, mark in enumerate(marks):
        group = next((group for group in found if np.hypot(*(mark - marks[group[0]])) < SAME), None)
        if group is None:
            found.append([i])
        else:
            group.append(i)
    return found


def along(path: Floats) -> Floats:
    """Points (m, 2) along straight lines through these (n, 2), 2 pt apart and less."""
    lengths = (2 + int(np.hypot(*(b - a)) / 2.0) for a, b in pairwise(path))
    pieces = [np.linspace(a, b, n) for n, (a, b) in zip(lengths, pairwise(path), strict=True)]
    return np.vstack([np.zeros((0, 2)), *pieces])


def _in_turn(picture: Picture, named: Sequence[tuple[Point, Point]]) -> tuple[list[Place | None], list[float]]:
    """Places of names, one after another, and what each costs."""
    boxes, lines = list(picture.taken), np.zeros((0, 2))
    found: list[Place | None] = []
    costs = []
    for at, size in named:
        others = picture.marks[np.hypot(*(picture.marks - at).T) >= SAME]
        best, least = None, NOWHERE
        for away in AWAY:
            if away >= least:
                break
            for box in (_box(at, size, away, turn) for turn in TURNS):
                place, cost = _judged(picture, at, box, away, others, boxes, lines)
                if cost < least:
                    best, least = place, cost
        found.append(best)
        costs.append(least)
        if best is not None:
            boxes.append(best.box)
            if best.line is not None:
                lines = np.vstack([lines, along(np.array(best.line))])
    return found, costs


def _box(at: Point, size: Point, away: float, turn: float) -> Box:
    """Of a name of this size in this direction."""
    ends = []
    for middle, extent, towards in zip(at, size, (np.cos(np.radians(turn)), np.sin(np.radians(turn))), strict=True):
        share = 0.0 if towards > 0.3 else 1.0 if towards < -0.3 else 0.5
        low = middle + away * float(towards) - share * extent
        ends.append((low, low + extent))
    return ends[0][0], ends[1][0], ends[0][1], ends[1][1]


def _judged(
    picture: Picture, at: Point, box: Box, away: float, others: Floats, boxes: Sequence[Box], lines: Floats
) -> tuple[Place | None, float]:
    """A place and what it costs; infinite where it covers anything, or its line would pass through a name."""
    left, bottom, right, top = box
    inside = picture.frame[0] <= left and picture.frame[1] <= bottom and right <= picture.frame[2]
    if not (inside and top <= picture.frame[3]) or (_gaps(lines, box) < 2.0).any():
        return None, np.inf
    if any(left - 2.0 < b[2] and b[0] < right + 2.0 and bottom - 1.0 < b[3] and b[1] < top + 1.0 for b in boxes):
        return None, np.inf
    gaps = _gaps(others, box)
    nearest = float(gaps.min(initial=np.inf))
    if nearest < CLEAR:
        return None, np.inf
    level = (bottom < others[:, 1]) & (others[:, 1] < top)
    seems = float(np.where(level, LEVEL * gaps, gaps).min(initial=np.inf))
    cost = away + STRUCK * bool((_gaps(picture.front, box) < 1.0).any())
    if 1.3 * away + 1.0 < seems:
        return Place(box, None), cost
    end = float(np.clip(at[0], left, right)), float(np.clip(at[1], bottom, top))
    line = _from(at, end), end
    points = along(np.array(line))
    if away < TIED or any((_gaps(points, b) < 1.0).any() for b in boxes):
        return None, np.inf
    cost += LED + PASSED * _near(points, others, CLEAR) + BESIDE * (nearest < 2.0 * CLEAR)
    return Place(box, line), cost + CROSSED * (_near(points, lines, 2.0) > 0) + TOUCHED * _near(
        points, picture.front, 1.5
    )


def _from(at: Point, end: Point) -> Point:
    """Where a line from a mark to this end begins."""
    share = START / float(np.hypot(end[0] - at[0], end[1] - at[1]))
    return at[0] + share * (end[0] - at[0]), at[1] + share * (end[1] - at[1])


def _gaps(points: Floats, box: Box) -> Floats:
    """Distances (n,) of points (n, 2) from a box, 0 inside."""
    return np.asarray(np.hypot(*np.maximum(np.maximum(box[:2] - points, points - box[2:]), 0.0).T))


def _near(points: Floats, others: Floats, clear: float) -> int:
    """How many of the others (n, 2) lie nearer than this to points (m, 2) along a line."""
    low, high = points.min(axis=0), points.max(axis=0)
    others = others[_gaps(others, (low[0], low[1], high[0], high[1])) < clear]
    return int((np.hypot(*(points[:, None] - others[None]).T).min(axis=1, initial=np.inf) < clear).sum())
