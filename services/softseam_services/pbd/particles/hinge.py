"""Hinges of a sheet's triangles: C = theta - theta_0, the signed angle between two triangles at an edge less that at
rest.

With e = x_1 - x_0, n_1 = e x (x_2 - x_0) and n_2 = (x_3 - x_0) x e, of the triangles (0, 1, 2) and (0, 3, 1):
    theta = atan2(e/|e| . (n_2 x n_1), n_1 . n_2),                                                                  (1)
0 where they are flat and positive where the wings 2 and 3 rise along the normals. Its gradients (Bridson, Marino and
Fedkiw 2003, "Simulation of clothing with folds and wrinkles", eq. 3 to 5) follow from heights and feet of the wings:
    grad_2 = |e| n_1/|n_1|^2,  grad_3 = |e| n_2/|n_2|^2,  grad_1 = -t_2 grad_2 - t_3 grad_3,
    grad_0 = -(1 - t_2) grad_2 - (1 - t_3) grad_3,  t_i = (x_i - x_0) . e/|e|^2.                                    (2)

On a sheet's lattice (spacings a, b; diagonal L) three particles in a row have a hinge at an edge across the row, whose
wings are the outer two, and each cell has one at a diagonal; which edge and which diagonal changes as the colours of a
chessboard do. Where it is flat, small deflections w open them by (w_2 - 2 w_0 + w_3)/a, or /b, and by L/(a b) times the
mixed difference, so that their energy is that of the lattice's bends, which `lattices` describes, for any w, if the
stiffnesses are
    D b/a,  D a/b,  2 D a b/L^2                                                                                     (3)
across rows along x, along y and in cells (half of it in rows on the border). Hinges at all edges of one triangulation,
each as stiff as its share of the area, have the energy of a uniform bend, too, but a strip of them sags by 1.46 times
as much: it bends where it is softest. A curvature k at rest is that of a cylinder through the particles: theta_0 = 2
asin(k a/2).
"""

import numpy as np

from softseam_protocol.scene.particles import HingeSpec
from softseam_services.body.body import Ints
from softseam_services.body.lattices import line_shares
from softseam_services.body.particles import ParticleBody

from .constraint import Constraint, Joins


def joins(spec: HingeSpec, body: ParticleBody) -> Joins:
    """Edge and wings of every hinge of a sheet, its angle at rest and compliance by eq. (3)."""
    if body.kind != "sheet":
        return Joins(np.zeros((0, 4), dtype=np.int32), np.zeros((0, 1)), np.zeros(0))
    nx, ny = body.skin.counts[0] - 1, body.skin.counts[1] - 1
    number = np.arange((nx + 1) * (ny + 1), dtype=np.int32).reshape(ny + 1, nx + 1)
    a, b = (float(np.linalg.norm(body.x_rest[other] - body.x_rest[0])) for other in (1, nx + 1))
    across_x, across_y, diagonals = _rows(number.T)[:, [1, 0, 2, 3]], _rows(number), _diagonals(number)
    rest = 2.0 * np.arcsin(0.5 * np.array([a, b]) * spec.curvature)
    stiffness = [
        np.tile(b / a * line_shares(ny), max(nx - 1, 0)),
        np.tile(a / b * line_shares(nx), max(ny - 1, 0)),
        np.full(nx * ny, 2.0 * a * b / (a * a + b * b)),
    ]  # eq. (3)
    return Joins(
        np.concatenate([across_x, across_y, diagonals]),
        np.repeat([*rest, 0.0], [len(part) for part in stiffness])[:, None],
        1.0 / (spec.bending * np.concatenate(stiffness)),
    )


def _rows(number: Ints) -> Ints:
    """Hinges of three particles in a row across the last axis: an edge from the middle one along that axis, and the
    wings ahead and behind (m, 4)."""
    j, i = np.indices(number[1:-1].shape)
    j, last = j + 1, number.shape[1] - 1
    ahead = (((i + j) % 2 == 0) | (i == 0)) & (i < last)
    begin, end = np.where(ahead, i, i - 1), np.where(ahead, i + 1, i)
    return np.stack([number[j, begin], number[j, end], number[j + 1, i], number[j - 1, i]], axis=-1).reshape(-1, 4)


def _diagonals(number: Ints) -> Ints:
    """Hinges inside the cells: a diagonal, and the corners on its left and right (m, 4)."""
    j, i = np.indices(number[:-1, :-1].shape)
    up = number[j, i], number[j + 1, i + 1], number[j + 1, i], number[j, i + 1]
    down = number[j, i + 1], number[j + 1, i], number[j, i], number[j + 1, i + 1]
    return np.where(((i + j) % 2 == 0)[..., None], np.stack(up, axis=-1), np.stack(down, axis=-1)).reshape(-1, 4)


def value(x, parameters, gradient):  # type: ignore[no-untyped-def]
    """C of an edge and two wings x (4, 3), parameters theta_0; 0 without a gradient where a triangle has no area."""
    ex, ey, ez = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1], x[1, 2] - x[0, 2]
    lx, ly, lz = x[2, 0] - x[0, 0], x[2, 1] - x[0, 1], x[2, 2] - x[0, 2]
    rx, ry, rz = x[3, 0] - x[0, 0], x[3, 1] - x[0, 1], x[3, 2] - x[0, 2]
    n1x, n1y, n1z = ey * lz - ez * ly, ez * lx - ex * lz, ex * ly - ey * lx
    n2x, n2y, n2z = ry * ez - rz * ey, rz * ex - rx * ez, rx * ey - ry * ex
    square = ex * ex + ey * ey + ez * ez
    first, second = n1x * n1x + n1y * n1y + n1z * n1z, n2x * n2x + n2y * n2y + n2z * n2z
    if min(first, second) <= 1e-20 * square * square:
        return 0.0
    length = np.sqrt(square)
    t2, t3 = (lx * ex + ly * ey + lz * ez) / square, (rx * ex + ry * ey + rz * ez) / square
    gradient[2, 0], gradient[2, 1], gradient[2, 2] = length * n1x / first, length * n1y / first, length * n1z / first
    gradient[3, 0], gradient[3, 1], gradient[3, 2] = length * n2x / second, length * n2y / second, length * n2z / second
    for axis in range(3):  # eq. (2)
        gradient[1, axis] = -t2 * gradient[2, axis] - t3 * gradient[3, axis]
        gradient[0, axis] = -(1.0 - t2) * gradient[2, axis] - (1.0 - t3) * gradient[3, axis]
    triple = ex * (n2y * n1z - n2z * n1y) + ey * (n2z * n1x - n2x * n1z) + ez * (n2x * n1y - n2y * n1x)
    return np.arctan2(triple / length, n1x * n2x + n1y * n2y + n1z * n2z) - parameters[0]  # eq. (1)


HINGE = Constraint(joins, value)
