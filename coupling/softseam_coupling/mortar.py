"""What ties two sides whose traces differ: biquadratic (FEM) against bilinear on half cells (PBD), on the same nodes.

On a cell's face both sides have the same 3 x 3 nodes, but a constant traction splits into nodal forces 1/36, 4/36,
16/36 on a biquadratic trace and 1/16, 2/16, 4/16 on a bilinear one, so tying nodes one by one fails the patch
test and softens the seam. Here the multiplier is a traction in the near side's own trace space: with
M_nn = int N_near N_near^T and M_nf = int N_near N_far^T over the seam,

    x_near = P x_far,   P = M_nn^-1 M_nf                                          (1)

and nodal forces lambda on the near side act as -P^T lambda on the far side, so that the tie does no work. P reproduces
linear fields, so constant stress passes exactly. Where both traces are alike, P is the identity. Bernardi, Maday and
Patera (1994) call this a mortar method; the near side is the slave.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.inverse import invert_definite

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

__all__ = ["SeamTie", "identity_tie", "mortar_tie"]

_LEAST_FILL = 0.05
"""share that an empty quarter of a face keeps, so that M_nn stays well conditioned [1]"""

_LEAST_COMPLIANCE = 1e-6


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

    def image(self, x_far: Floats) -> Floats:
        """Where the near side's seam nodes belong (s, 3) [m]."""
        return x_far if self.p is None else np.asarray(self.p @ x_far + self.c)

    def far_force(self, lambda_: Floats) -> Floats:
        """Nodal forces on the far side (s, 3) [N] that belong to lambda on the near side."""
        return -lambda_ if self.p is None else np.asarray(-(self.p.T @ lambda_))

    def compliance(self, near: Floats, far: Floats) -> Floats:
        """H_near + P H_far P^T (3 s, 3 s) [m/N]."""
        return near + self.far_compliance(far)

    def far_compliance(self, far: Floats) -> Floats:
        """P H_far P^T (3 s, 3 s) [m/N]: how the far side's image on the near side's nodes yields."""
        if self.p is None:
            return far
        n = far.shape[0]
        half = (self.p @ far.reshape(n // 3, 3 * n)).reshape(n, n)
        whole = self.p @ np.ascontiguousarray(half.T).reshape(n // 3, 3 * n)
        return np.ascontiguousarray(whole.reshape(n, n).T)


def stiffness_of(compliance: Floats) -> Floats:
    """The inverse of a compliance's symmetric part (n, n) [N/m], symmetric.

    Directions that hardly yield (eigenvalues below 1e-6 of the largest) are held no stiffer than that.
    """
    h = 0.5 * (compliance + compliance.T)
    inverse = invert_definite(h, _LEAST_COMPLIANCE)
    if inverse is not None:
        return inverse
    values, vectors = np.linalg.eigh(h)
    values = np.maximum(values, _LEAST_COMPLIANCE * values[-1])
    return np.ascontiguousarray((vectors / values) @ vectors.T)


def identity_tie(n_nodes: int) -> SeamTie:
    """Nodes tied one by one: exact where both traces are alike."""
    return SeamTie(None, np.zeros((n_nodes, 3)))


def mortar_tie(faces: Ints, edges: Floats, fill: Floats, near: str, far: str, nodes: Ints, x_rest: Floats) -> SeamTie:
    """The tie of a seam.

    faces   (f, 9)  global node ids of each seam face, a = i + 3 j
    edges   (f, 2)  edge lengths of each face along i and j [m]
    fill    (f, 4)  filled share of each quarter q = i + 2 j of the face [1]
    near, far       'quadratic' or 'linear' (on half edges): the traces of the two sides
    nodes   (s,)    global ids of the seam nodes that are free, ascending; the others on the faces are clamped
    x_rest  (N, 3)  where clamped nodes stay [m]
    """
    if near == far:
        return identity_tie(len(nodes))
    ids, local = np.unique(faces, return_inverse=True)
    local = local.reshape(-1, 9)
    m_nn, m_nf = np.zeros((2, len(ids), len(ids)))
    weight = np.maximum(fill, _LEAST_FILL) * (edges[:, :1] * edges[:, 1:])
    for quarter in range(4):
        i, j = quarter % 2, quarter // 2
        for trace, matrix in ((near, m_nn), (far, m_nf)):
            element = np.kron(_half_products(near, trace, j), _half_products(near, trace, i))
            values = weight[:, quarter, None, None] * element
            np.add.at(matrix, (local[:, :, None], local[:, None, :]), values)
    p = np.linalg.solve(m_nn, m_nf)
    free = np.searchsorted(ids, nodes)
    clamped = np.setdiff1d(np.arange(len(ids)), free)
    c = p[np.ix_(free, clamped)] @ x_rest[ids[clamped]]
    return SeamTie(np.ascontiguousarray(p[np.ix_(free, free)]), c)


@cache
def _half_products(first: str, second: str, half: int) -> Floats:
    """int N_a N_b over one half of the unit edge (3, 3), exact by three Gauss points."""
    points, weights = np.polynomial.legendre.leggauss(3)
    s = 0.25 * (points + 1.0) + 0.5 * half
    return np.asarray(np.einsum("q,qa,qb->ab", 0.25 * weights, _trace(first, s), _trace(second, s)))


def _trace(kind: str, s: Floats) -> Floats:
    """Shape functions of the three nodes of an edge at s in [0, 1] (q, 3)."""
    if kind == "quadratic":
        return np.stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)], axis=1)
    if kind == "linear":
        return np.stack([np.maximum(0, 1 - 2 * s), 1 - np.abs(2 * s - 1), np.maximum(0, 2 * s - 1)], axis=1)
    raise ValueError(f"no trace is called {kind!r}: use 'quadratic' or 'linear'")
