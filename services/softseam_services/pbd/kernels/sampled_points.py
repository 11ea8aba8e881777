"""Points of surfaces that are sampled, as the search of what touches what finds them near faces, see `search`."""

import numpy as np

from softseam_coupling.kernels.nearest_face import UNIT
from softseam_services.jit import njit

from .touch import AREA, CORNER, FADE, GAP, N_INTS, NORMAL, POINT, SHARE, SIDE

_NEAR = 0.1
"""of how far is looked: where surfaces are curved, so far a point is outside that counts little [1]"""
LEAST = 1e-9
"""how much a point counts for where a patch presses at least: where all are farther, as each other [1]"""


@njit(cache=True, error_model="numpy")
def look_upon(upon, share, out):
    """out (p, 3) <- unit vectors out of the surface at points that are no corners, from those at corners."""
    for i in range(len(upon)):
        if upon[i, 0] == i:
            continue
        for c in range(3):
            out[i, c] = 0.0
            for k in range(3):
                out[i, c] += share[i, k] * out[upon[i, k], c]
        size = np.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2)
        for c in range(3):
            out[i, c] /= max(size, 1e-300)


@njit(cache=True, error_model="numpy")
def add_for_patches(touch, meeting, side, points, them, faces, far, reach, n):
    """As `search._add_of`, where what was found is for patches."""
    own, other = touch.sides[meeting, side], touch.sides[meeting, 1 - side]
    begin, theirs = touch.first[own], touch.first[other]
    first, last = touch.first_triangle[other], touch.first_triangle[other + 1]
    corners, rounded, out = touch.corners[first:last], touch.rounded[first:last], touch.out[theirs:]
    place, share, at = touch.place[meeting, side], np.empty(3), touch.at
    near = _NEAR * far if touch.curved[own] or touch.curved[other] else far
    others, found = False, np.zeros(N_INTS, dtype=np.int32)
    found[SIDE] = 2 * meeting + side
    for i in range(touch.n_close[meeting, side]):
        face, covered = touch.last[place + i], 1.0 - touch.beside[i] / reach
        if face < 0 or not covered > 0.0:
            continue
        point, row, ints = touch.close[place + i], touch.rows[n], touch.ints[n]
        a, b, c = corners[face, 0], corners[face, 1], corners[face, 2]
        share[0], share[1], share[2] = project_on(points, point, them, a, b, c)
        goes = gap = 0.0
        for k in range(3):
            unit = faces[face, UNIT + k]
            goes += unit * (points[point, k] - (share[0] * them[a, k] + share[1] * them[b, k] + share[2] * them[c, k]))
            away = at[begin + point, k] - share[0] * at[theirs + a, k]
            gap += unit * (away - share[1] * at[theirs + b, k] - share[2] * at[theirs + c, k])
            row[NORMAL + k], row[SHARE + k] = unit, share[k]
        if touch.curved[other]:
            _go_over(share, corners[face], rounded[face], out, row[NORMAL : NORMAL + 3])
        row[AREA], row[GAP] = covered * touch.area[begin + point], gap
        row[FADE] = max(LEAST, 1.0 - max(0.0, goes) / near)
        found[POINT], found[CORNER], found[CORNER + 1], found[CORNER + 2] = point, a, b, c
        for k in range(N_INTS):
            others = others or ints[k] != found[k]
            ints[k] = found[k]
        n += 1
    return n, others


@njit(cache=True, error_model="numpy")
def _go_over(share, corners, rounded, out, normal):
    """normal (3,), a triangle's own <- between its corners' `out`, where the surface is rounded there."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    normal[:] = 0.0
    for k in range(3):
        w = max(0.0, share[k])
        if rounded[k]:
            for c in range(3):
                normal[c] += w * out[corners[k], c]
        else:
            normal[0], normal[1], normal[2] = normal[0] + w * nx, normal[1] + w * ny, normal[2] + w * nz
    size = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    for c in range(3):
        normal[c] /= size


@njit(cache=True, error_model="numpy", forceinline=True)
def project_on(points, point, x, i, j, k):
    """Weights of a triangle's corners in the foot of a point on its plane, which may be outside: there force and
    reaction are on one line."""
    bb = bc = cc = pb = pc = 0.0
    for c in range(3):
        ab, ac, ap = x[j, c] - x[i, c], x[k, c] - x[i, c], points[point, c] - x[i, c]
        bb, bc, cc, pb, pc = bb + ab * ab, bc + ab * ac, cc + ac * ac, pb + ap * ab, pc + ap * ac
    size = bb * cc - bc * bc
    second, third = (cc * pb - bc * pc) / size, (bb * pc - bc * pb) / size
    return 1.0 - second - third, second, third
