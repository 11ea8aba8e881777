"""What ties two sides whose traces differ, as biquadratic (hex27) and bilinear on half cells (PBD), on the same nodes.

On a cell's face both sides have the same 3 x 3 nodes, but a constant traction splits into nodal forces 1/36, 4/36,
16/36 on a biquadratic trace and 1/16, 2/16, 4/16 on a bilinear one, so tying nodes one by one fails the patch
test and softens the seam. Here the multiplier is a traction in the near side's own trace space: with
M_nn = int N_near N_near^T and M_nf = int N_near N_far^T over the seam,

    x_near = P x_far,   P = M_nn^-1 M_nf                                          (1)

and nodal forces lambda on the near side act as -P^T lambda on the far side, so that the tie does no work. P reproduces
linear fields, so constant stress passes a flat seam exactly. Where both traces are alike, P is the identity. Bernardi,
Maday and Patera (1994) call this a mortar method; the near side is the slave.

Where a seam turns, a constant stress pulls otherwise on either side of the turn, and a continuous multiplier cannot
follow. So nodes at which faces of different direction meet (turns, and cross points of several patches) are
tied one by one, and the multipliers psi of the others span what is constant on each face by itself:

    int psi_i (N_near x_near - N_far x_far) = 0,   psi_i = N_i + sum_b N_b/k on each face                         (2)

with the k other nodes i of a face and its nodes b at turns, as Bernardi, Maday and Patera lower theirs at cross points.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

__all__ = ["TRACES", "SeamTie", "identity_tie", "mortar_tie"]

_LEAST_FILL = 0.05
"""share that an empty quarter of a face keeps, so that M_nn stays well conditioned [1]"""


@dataclass(frozen=True)
class SeamTie:
    """x_near - P x_far - c = 0 at the s seam nodes."""

    p: Floats | None
    """(s, s), or None for the identity"""
    c: Floats
    """what clamped nodes of the seam contribute (s, 3) [m]"""

    def gap(self, x_near: Floats, x_far: Floats) -> Floats:
        """(s, 3) [m]"""
        if self.p is None:
            return x_near - x_far
        return np.asarray(x_near - self.p @ x_far - self.c)


def identity_tie(n_nodes: int) -> SeamTie:
    """Nodes tied one by one: exact where both traces are alike."""
    return SeamTie(None, np.zeros((n_nodes, 3)))


def mortar_tie(
    faces: Ints,
    edges: Floats,
    fill: Floats,
    near: str,
    far: str,
    nodes: Ints,
    x_rest: Floats,
    facing: Ints | None = None,
) -> SeamTie:
    """The tie of a seam; nodes on none of its faces, where cells touch along an edge alone, are tied one by one.

    faces   (f, 9)  global node ids of each seam face, a = i + 3 j
    edges   (f, 2)  edge lengths of each face along i and j [m]
    fill    (f, 4)  filled share of each quarter q = i + 2 j of the face [1]
    near, far       the traces of the two sides, see `TRACES`
    nodes   (s,)    global ids of the seam nodes that are free, ascending; the others on the faces are clamped
    x_rest  (N, 3)  where clamped nodes stay [m]
    facing  (f,)    direction of each face, equal where two that meet lie in one plane and have the near side on the
                    same side of it; None for a flat seam
    """
    if near == far:
        return identity_tie(len(nodes))
    ids = np.union1d(faces, nodes)
    local = np.searchsorted(ids, faces).astype(np.int32)
    turns = _turns(local, facing, len(ids))
    m_nn, m_nf = np.zeros((2, len(ids), len(ids)))
    lowered = _lowered(turns[local])
    weight = np.maximum(fill, _LEAST_FILL) * (edges[:, :1] * edges[:, 1:])
    for quarter in range(4):
        for trace, matrix in ((near, m_nn), (far, m_nf)):
            products = _quarter_products(near, trace, quarter)
            values = weight[:, quarter, None, None] * (products if lowered is None else lowered @ products)
            np.add.at(matrix, (local[:, :, None], local[:, None, :]), values)
    alone = np.flatnonzero(turns)
    m_nn[alone], m_nf[alone] = np.eye(len(ids))[alone], np.eye(len(ids))[alone]
    p = np.linalg.solve(m_nn, m_nf)
    free = np.searchsorted(ids, nodes)
    clamped = np.setdiff1d(np.arange(len(ids)), free)
    c = p[np.ix_(free, clamped)] @ x_rest[ids[clamped]]
    return SeamTie(np.ascontiguousarray(p[np.ix_(free, free)]), c)


def _turns(local: Ints, facing: Ints | None, n_nodes: int) -> NDArray[np.bool_]:
    """Nodes where faces (f, 9) of different direction meet, and those of no face (n,)."""
    directions = np.zeros(len(local), dtype=np.int64) if facing is None else np.unique(facing, return_inverse=True)[1]
    meets = np.zeros((n_nodes, int(directions.max(initial=0)) + 1), dtype=np.bool_)
    meets[local, directions[:, None]] = True
    return np.asarray(meets.sum(axis=1) != 1)


def _lowered(turns: NDArray[np.bool_]) -> Floats | None:
    """psi of eq. (2) by N on each face (f, 9, 9), rows at turns (f, 9) zero; None where there are no turns."""
    if not turns.any():
        return None
    others = np.where(turns, 0.0, 1.0)
    share = others[:, :, None] * turns[:, None, :] / others.sum(axis=1)[:, None, None]  # the middle never turns
    return np.asarray(share + np.eye(9) * others[:, :, None])


@cache
def _quarter_products(first: str, second: str, quarter: int) -> Floats:
    """int N_a N_b over a quarter of the unit face (9, 9), exact: all traces are polynomials on the two triangles into
    which the diagonal through the middle of the face divides it."""
    gauss, weights = np.polynomial.legendre.leggauss(5)
    u, w = np.meshgrid(0.5 * (gauss + 1.0), 0.5 * (gauss + 1.0), indexing="ij")
    a, b = u.ravel(), (u * w).ravel()
    area = 0.25 * np.outer(weights, weights).ravel() * a
    along, across = (0.5 * np.concatenate(part) for part in ((a, b), (b, a)))  # from the middle outwards
    s = 0.5 + (along if quarter % 2 else -along)
    t = 0.5 + (across if quarter // 2 else -across)
    return np.asarray(np.einsum("q,qa,qb->ab", 0.25 * np.tile(area, 2), TRACES[first](s, t), TRACES[second](s, t)))


def _product(line: Callable[[Floats], Floats]) -> Callable[[Floats, Floats], Floats]:
    """The nine products (q, 9), a = i + 3 j, of three functions of an edge."""

    def trace(s: Floats, t: Floats) -> Floats:
        return np.asarray((line(t)[:, :, None] * line(s)[:, None, :]).reshape(-1, 9))

    return trace


def _quadratic(s: Floats) -> Floats:
    return np.stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)], axis=1)


def _linear(s: Floats) -> Floats:
    return np.stack([np.maximum(0, 1 - 2 * s), 1 - np.abs(2 * s - 1), np.maximum(0, 2 * s - 1)], axis=1)


def _triangles(s: Floats, t: Floats) -> Floats:
    """Linear on the eight triangles that meet in the middle of the face."""
    ds, dt = np.abs(2 * s - 1), np.abs(2 * t - 1)
    i, j = np.where(s > 0.5, 2, 0), np.where(t > 0.5, 2, 0)
    out = np.zeros((len(s), 9))
    row = np.arange(len(s))
    np.add.at(out, (row, i + 3 * j), np.minimum(ds, dt))
    np.add.at(out, (row, np.where(ds > dt, i + 3, 1 + 3 * j)), np.abs(ds - dt))
    out[:, 4] += 1 - np.maximum(ds, dt)
    return out


def _quadratic_triangles(s: Floats, t: Floats) -> Floats:
    """Quadratic on the two triangles on either side of s = t."""
    most, least = np.maximum(s, t), np.minimum(s, t)
    corner = np.stack([1 - most, most - least, least])
    node = np.stack([np.zeros_like(s), np.where(s > t, 2, 6), np.full_like(s, 8)]).astype(np.int64)
    out = np.zeros((len(s), 9))
    row = np.arange(len(s))
    for a in range(3):
        np.add.at(out, (row, node[a]), corner[a] * (2 * corner[a] - 1))
        for b in range(a):
            np.add.at(out, (row, (node[a] + node[b]) // 2), 4 * corner[a] * corner[b])
    return out


TRACES: dict[str, Callable[[Floats, Floats], Floats]] = {
    "hex27": _product(_quadratic),
    "hex8": _product(_linear),
    "tet4": _triangles,
    "tet10": _quadratic_triangles,
}
"""Shape functions on a face by kind of element: of its nodes a = i + 3 j at (s, t) in [0, 1]^2 (q, 9)."""
