"""Which configurations nobody beats."""

from __future__ import annotations

import math
from collections.abc import Sequence

NEAR = 0.07
"""points that lie closer in both coordinates are next to each other in a chart [decades]"""


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices, by falling speed, of the points (speed, error) that no other is faster and more accurate than.

    A point that another equals in one and beats in the other is not on the front; of equal points the first is.
    """
    front: list[int] = []
    best = float("inf")
    for i in sorted(range(len(points)), key=lambda i: (-points[i][0], points[i][1], i)):
        if points[i][1] < best:
            front.append(i)
            best = points[i][1]
    return front


def worth_naming(front: Sequence[tuple[float, float]], limits: Sequence[float]) -> list[int]:
    """Indices of the points (speed, error) of a front, given by falling speed, that a picture should name.

    Both ends, the fastest within each limit, and of the others those that lie apart from what is named already.
    """
    within = [next((i for i, (_, error) in enumerate(front) if error <= limit), None) for limit in limits]
    first = [i for i in (0, len(front) - 1, *within) if i is not None and front]
    named: list[int] = []
    for i in dict.fromkeys((*first, *range(len(front)))):
        apart = (max(abs(math.log10(a / b)) for a, b in zip(front[i], front[j], strict=True)) for j in named)
        if i in first or all(distance > NEAR for distance in apart):
            named.append(i)
    return sorted(named)
