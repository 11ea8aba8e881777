"""How hard it is for sweeps to solve for XPBD's multipliers: the ends of a spectrum.

XPBD solves A lambda = b with A = J W J^T + alpha~ (Macklin, Müller and Chentanez, XPBD, 2016): J (m, 3n) the gradients
of m constraints, W inverse masses, alpha~ = alpha/h^2 their compliances over the square of the substep. How a
constraint is scaled does not matter to a Gauss-Seidel sweep, which solves for each exactly; so A is scaled by its own
diagonal D, of constraints that are solved together by the blocks of it: what counts is D^-1/2 A D^-1/2.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csc_array, csr_array, dia_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from softseam_services.body.body import Floats

_DENSE = 30
"""unknowns up to which all eigenvalues are computed"""
LARGEST = 20_000
"""unknowns of a body, from which on nothing is computed: 15,000 in 4096 blocks take 7 s"""


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

    @property
    def sweeps(self) -> int:
        """Gauss-Seidel's in which the slowest part of an error falls to a tenth: by (1 - least)^2 each, the square of
        Jacobi's radius, of a matrix that can be ordered consistently (Young 1954); of others about so many."""
        left = (1.0 - self.least) ** 2
        return 1 if left <= 0.1 else math.ceil(math.log(0.1) / math.log(left) - 1e-9)


def spectrum(matrix: csc_array) -> Spectrum:
    """Of a symmetric positive definite matrix, scaled by its diagonal."""
    m = matrix.shape[0]
    scale = dia_array((1.0 / np.sqrt(matrix.diagonal())[None], [0]), shape=(m, m))
    scaled = csc_array(scale @ matrix @ scale)
    if m <= _DENSE:
        values = np.linalg.eigvalsh(scaled.toarray())
        return Spectrum(float(values[0]), float(values[-1]))
    start = _start(m)
    least = eigsh(scaled, 1, sigma=0.0, v0=start, return_eigenvectors=False)
    most = eigsh(scaled, 1, which="LA", v0=start, tol=1e-6, return_eigenvectors=False)
    return Spectrum(float(least[0]), float(most[0]))


def spectrum_of_blocks(gradient: Floats, columns: NDArray[np.integer], n_columns: int) -> Spectrum:
    """The same of 1 + B B^T, scaled by the blocks on its diagonal, of b constraints of k multipliers each.

    B = alpha~^-1/2 J W^1/2. There are more multipliers than unknowns, so that the inverse of what is scaled goes by a
    matrix of the unknowns: (1 + B B^T)^-1 = 1 - B (1 + B^T B)^-1 B^T (Woodbury).

    gradient  B's entries (b, k, c)
    columns   where they are in B's n_columns (b, c)
    """
    b, k = gradient.shape[:2]
    values, vectors = np.linalg.eigh(np.eye(k) + gradient @ gradient.transpose(0, 2, 1))
    root, inverse = (np.einsum("bij,bj,bkj->bik", vectors, values**power, vectors) for power in (0.5, -0.5))
    rows = np.broadcast_to(np.arange(b * k).reshape(b, k, 1), gradient.shape)
    at = np.broadcast_to(columns[:, None, :], gradient.shape)
    B = csr_array((gradient.ravel(), (rows.ravel(), at.ravel())), shape=(b * k, n_columns))
    up, down = csr_array(block_diag(list(root), "csr")), csr_array(block_diag(list(inverse), "csr"))
    solve = splu(csc_array(eye_array(n_columns) + B.T @ B)).solve
    shape, start = (b * k, b * k), _start(b * k)

    def ahead(y: Floats) -> Floats:
        u = down @ y.ravel()
        return np.asarray(down @ (u + B @ (B.T @ u)))

    def back(y: Floats) -> Floats:
        u = up @ y.ravel()
        return np.asarray(up @ (u - B @ solve(B.T @ u)))

    most, least = (
        eigsh(LinearOperator(shape, matvec=by, dtype=np.float64), 1, which="LA", v0=start, tol=1e-6,
              return_eigenvectors=False)[0]
        for by in (ahead, back)
    )  # fmt: skip
    return Spectrum(float(1.0 / least), float(most))


def _start(m: int) -> Floats:
    """Any vector (m,), but the same each time."""
    return np.random.default_rng(0).normal(size=m)
