"""How hard it is for XPBD's sweeps to solve for the springs of a body of particles: the ends of a spectrum."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_array, dia_array
from scipy.sparse.linalg import eigsh

from softseam_services.body.body import Floats
from softseam_services.body.particles import ParticleBody

_DENSE = 30
"""springs up to which all eigenvalues are computed"""


class Spectrum(NamedTuple):
    """Least and largest eigenvalue of a symmetric matrix that is scaled to ones on its diagonal [1]."""

    least: float
    most: float

    @property
    def condition(self) -> float:
        """Condition number [1]."""
        return self.most / self.least

    @property
    def jacobi(self) -> float:
        """Spectral radius of Jacobi's iteration, 1 - D^-1 A: from 1 on it diverges [1]."""
        return max(1.0 - self.least, self.most - 1.0)

    @property
    def omega(self) -> float | None:
        """By which Gauss-Seidel's sweeps end soonest if over-relaxed: 2/(1 + sqrt(1 - rho^2)) with Jacobi's rho (Young
        1954), for a matrix that can be ordered consistently, as a chain's; None where Jacobi's iteration diverges,
        which it cannot for such a matrix of positive eigenvalues."""
        rho = self.jacobi
        return None if rho >= 1.0 else 2.0 / (1.0 + (1.0 - rho * rho) ** 0.5)


def spring_spectrum(body: ParticleBody, substep: float) -> Spectrum:
    """The ends of the spectrum of D^-1/2 A D^-1/2, with A = J W J^T + alpha/h^2 and D its diagonal.

    A is XPBD's matrix for the multipliers of m springs (Macklin, Müller and Chentanez, XPBD, 2016), at rest: J (m, 3n)
    their gradients, W inverse masses, alpha = 1/k. It is scaled because the scale of a constraint does not matter to a
    Gauss-Seidel sweep. Springs that are more than what particles can do, and those between clamped ones, make J W J^T
    singular: alpha/h^2 alone then keeps the condition number finite, so it grows with stiffness and with the substep.

    substep  h [s]
    """
    springs, m = body.springs, len(body.springs.rest)
    along = body.x_rest[springs.nodes[:, 1]] - body.x_rest[springs.nodes[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    weight = np.sqrt(np.where(body.fixed, 0.0, 1.0 / body.mass))
    entries = along[:, None, :] * (np.array([-1.0, 1.0])[None, :] * weight[springs.nodes])[:, :, None]
    columns = 3 * springs.nodes[:, :, None] + np.arange(3)
    rows = np.broadcast_to(np.arange(m)[:, None, None], entries.shape)
    half = csc_array(coo_array((entries.ravel(), (rows.ravel(), columns.ravel())), shape=(m, 3 * body.n_nodes)))
    matrix = csc_array(half @ half.T + dia_array((1.0 / (springs.stiffness * substep**2)[None], [0]), shape=(m, m)))
    scale = dia_array((1.0 / np.sqrt(matrix.diagonal())[None], [0]), shape=(m, m))
    least, most = _ends(csc_array(scale @ matrix @ scale))
    return Spectrum(float(least), float(most))


def _ends(matrix: csc_array) -> Floats:
    """Least and largest eigenvalue of a symmetric positive definite matrix."""
    m = matrix.shape[0]
    if m <= _DENSE:
        return np.asarray(np.linalg.eigvalsh(matrix.toarray())[[0, -1]])
    start = np.random.default_rng(0).normal(size=m)  # any, but the same each time
    least = eigsh(matrix, 1, sigma=0.0, v0=start, return_eigenvectors=False)
    most = eigsh(matrix, 1, which="LA", v0=start, tol=1e-6, return_eigenvectors=False)
    return np.array([least[0], most[0]])
