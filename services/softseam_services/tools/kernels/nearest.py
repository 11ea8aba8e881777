"""Where triangles are nearest to a tool, by branch and bound: see tools/approach.py."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.branches import BOX, CAPSULE, CYLINDER, PLANE, SPHERE
from softseam_services.shapes.distance import tool_gap

LINE = 1e-3
"""of the square of the way from the line over the size, which is added to gaps where places are looked for [1]"""
_DIFFERENCE = 1e-7
"""of the surface's size, for gradients of what may be concave [1]"""
_SMALL = 1.0 / 24.0
"""of a tool that may be concave: eq. (1) is believed of triangles so much smaller [1]"""
_MOST, _DEEPEST = 200_000, 200
"""triangles looked at in all, and those kept to be looked at"""


@njit(cache=True, error_model="numpy")
def nearest_place(kind, shape, reach, position, orientation, way, line, close, size, corners, order, least, place):
    """Least gap of triangles (m, 3, 3) to a tool, or little more than it by `close` [m]; place (3,) <- where.

    line   weight of the square of the way from the line along `way` (3,) through the position, LINE/size or 0 [1/m]
    order  triangles by `least` (m,)
    least  what the gap of each cannot be below (m,) [m], updated in place where it was looked at
    """
    waiting, bound, parts, at = np.empty((_DEEPEST, 3, 3)), np.empty(_DEEPEST), np.empty((4, 3, 3)), np.empty(3)
    convex = kind == PLANE or kind == BOX or kind == SPHERE or kind == CAPSULE or kind == CYLINDER
    small = np.inf if convex else _SMALL * reach
    best, looked = np.inf, 0
    found = np.empty(2)
    place[:] = corners[0, 0]
    for which in order:
        if least[which] >= best:
            break
        triangle = corners[which]
        for i in range(3):
            at[i] = (triangle[0, i] + triangle[1, i] + triangle[2, i]) / 3.0
        middle = tool_gap(kind, shape, position, orientation, at)[0]
        least[which] = middle - _radius(triangle)
        if least[which] >= best - close:
            continue
        waiting[0], bound[0], count = triangle, -np.inf, 1
        while count > 0 and looked < _MOST:
            count -= 1
            if bound[count] >= best - close or count + 4 > _DEEPEST:
                continue
            if count == 0 and bound[0] == -np.inf:
                parts[0], n_parts = waiting[0], 1
            else:
                _quarter(waiting[count], parts)
                n_parts = 4
            looked += n_parts
            first = count
            for part in range(n_parts):
                _look(kind, shape, position, orientation, way, line, size, convex, small, parts[part], found, at)
                if found[0] < best:
                    best = found[0]
                    place[:] = at
                if found[1] >= best - close:
                    continue
                spot = count  # those with the least bound come next
                while spot > first and bound[spot - 1] < found[1]:
                    bound[spot], waiting[spot] = bound[spot - 1], waiting[spot - 1]
                    spot -= 1
                bound[spot], waiting[spot] = found[1], parts[part]
                count += 1
    return best


@njit(cache=True, error_model="numpy")
def _look(kind, shape, position, orientation, way, line, size, convex, small, triangle, found, place):
    """found (2,) <- the least gap at the corners and the centroid, where place (3,) is, and what no gap is below."""
    at, tangents = np.empty(3), np.empty((4, 3))
    found[0] = np.inf
    radius, middle = _radius(triangle), 0.0
    for probe in range(4):
        for i in range(3):
            if probe < 3:
                at[i] = triangle[probe, i]
            else:
                at[i] = (triangle[0, i] + triangle[1, i] + triangle[2, i]) / 3.0
        gap, gx, gy, gz = tool_gap(kind, shape, position, orientation, at)
        if not convex and radius <= small:
            gx, gy, gz = _slopes(kind, shape, position, orientation, _DIFFERENCE * size, at)
        if line > 0.0:
            ax, ay, az = at[0] - position[0], at[1] - position[1], at[2] - position[2]
            along = ax * way[0] + ay * way[1] + az * way[2]
            ax, ay, az = ax - along * way[0], ay - along * way[1], az - along * way[2]
            gap += line * (ax * ax + ay * ay + az * az)
            gx, gy, gz = gx + 2.0 * line * ax, gy + 2.0 * line * ay, gz + 2.0 * line * az
        middle = gap
        if gap < found[0]:
            found[0] = gap
            place[:] = at
        for corner in range(3):
            dx, dy, dz = triangle[corner, 0] - at[0], triangle[corner, 1] - at[1], triangle[corner, 2] - at[2]
            tangents[probe, corner] = gap + dx * gx + dy * gy + dz * gz
    found[1] = middle - radius if radius > small else _least_of(tangents)


@njit(cache=True, error_model="numpy")
def _least_of(tangents):
    """Eq. (1) and (2): below what the greatest of four linear functions never is, of their values (4, 3) at corners."""
    bound = -np.inf
    for a in range(4):
        bound = max(bound, min(tangents[a, 0], tangents[a, 1], tangents[a, 2]))
    for a in range(4):
        for b in range(a + 1, 4):
            for corner in range(3):
                other = (corner + 1) % 3
                by_a, by_b = tangents[a, corner] - tangents[a, other], tangents[b, corner] - tangents[b, other]
                if by_a * by_b < 0.0:  # the mixture that has one value at both of the corners
                    share = by_b / (by_b - by_a)
                    least = np.inf
                    for each in range(3):
                        least = min(least, share * tangents[a, each] + (1.0 - share) * tangents[b, each])
                    bound = max(bound, least)
    return bound


@njit(cache=True, error_model="numpy")
def _slopes(kind, shape, position, orientation, step, at):
    """By central differences: of a place at (3,), which is left as it was but for rounding."""
    slope = np.empty(3)
    for i in range(3):
        was = at[i]
        at[i] = was + step
        ahead = tool_gap(kind, shape, position, orientation, at)[0]
        at[i] = was - step
        slope[i] = (ahead - tool_gap(kind, shape, position, orientation, at)[0]) / (2.0 * step)
        at[i] = was
    return slope[0], slope[1], slope[2]


@njit(cache=True, error_model="numpy")
def _radius(triangle):
    """Of a ball about the centroid that holds a triangle (3, 3) [m]."""
    square = 0.0
    mx, my, mz = triangle[0] + triangle[1] + triangle[2]
    for corner in range(3):
        dx, dy, dz = triangle[corner, 0] - mx / 3.0, triangle[corner, 1] - my / 3.0, triangle[corner, 2] - mz / 3.0
        square = max(square, dx * dx + dy * dy + dz * dz)
    return np.sqrt(square)


@njit(cache=True, error_model="numpy")
def _quarter(triangle, parts):
    """parts (4, 3, 3) <- a triangle (3, 3) in four alike."""
    for i in range(3):
        a, b, c = triangle[0, i], triangle[1, i], triangle[2, i]
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts[0, 0, i], parts[0, 1, i], parts[0, 2, i] = a, ab, ca
        parts[1, 0, i], parts[1, 1, i], parts[1, 2, i] = ab, b, bc
        parts[2, 0, i], parts[2, 1, i], parts[2, 2, i] = ca, bc, c
        parts[3, 0, i], parts[3, 1, i], parts[3, 2, i] = ab, bc, ca
