"""Which configurations nobody beats."""

from __future__ import annotations

from collections.abc import Sequence


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
