"""Four ways to sweep over the springs of a sheet or rope: Gauss-Seidel by colours, which is the product's kernel, the
same over-relaxed, Jacobi, and Chebyshev's semi-iteration on Jacobi.

All solve A dlambda = -(C + alpha~ lambda), A = J W J^T + alpha~ with the diagonal D (Macklin, Mueller and Chentanez
2016):
    jacobi     dlambda = omega D^-1 r with r = -(C + alpha~ lambda) and omega = 2/(a + b), the best under-relaxation,
    chebyshev  dlambda_k+1 = rho_k+1 rho_k dlambda_k + 2 rho_k+1/delta D^-1 r,  rho_k+1 = 1/(2 theta/delta - rho_k),
               theta = (b + a)/2, delta = (b - a)/2, begun with dlambda_0 = D^-1 r/theta, rho_0 = delta/theta
               (Saad, Iterative methods for sparse linear systems, 2nd ed. 2003, algorithm 12.1),
with a and b the least and the largest eigenvalue of D^-1 A (`condition.spring_spectrum`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.particles.batches import batches
from softseam_services.pbd.particles.condition import spring_spectrum
from softseam_services.pbd.particles.kernels import distance

Floats = NDArray[np.float64]


class SpringSweeps:
    """Springs of a body in a substep of h [s] that began at rest, under a pull that moves each free particle h^2 g."""

    def __init__(self, body: ParticleBody, h: float, pull: float) -> None:
        """pull: g along -z [m/s^2]"""
        self.spectrum = spring_spectrum(body, h)
        self.nodes, self.rest = body.springs.nodes, body.springs.rest
        self.soft = 1.0 / (body.springs.stiffness * h * h)
        self.weight = np.where(body.fixed, 0.0, 1.0 / body.mass)
        self.diagonal = self.weight[self.nodes].sum(axis=1) + self.soft
        self.x, self.lam = body.x_rest.copy(), np.zeros(len(self.rest))
        self.x[~body.fixed, 2] -= h * h * pull
        self.ways: dict[str, Callable[[int], None]] = {
            "gauss_seidel": self._gauss_seidel,
            "sor": lambda n: self._gauss_seidel(n, self.spectrum.omega or 1.3),
            "jacobi": self._jacobi,
            "chebyshev": self._chebyshev,
        }

    def residual(self) -> float:
        """Norm of C + alpha~ lambda [m]."""
        return float(np.linalg.norm(self._residuals()[0]))

    def after(self, way: str, sweeps: int) -> float:
        """Residual after these sweeps, over the first one [1]."""
        before = self.residual()
        self.ways[way](sweeps)
        return self.residual() / before

    def _residuals(self) -> tuple[Floats, Floats]:
        """r (m,) [m], and the directions of the springs (m, 3)."""
        along = self.x[self.nodes[:, 0]] - self.x[self.nodes[:, 1]]
        length = np.linalg.norm(along, axis=1)
        return -(length - self.rest + self.soft * self.lam), along / length[:, None]

    def _move(self, change: Floats, direction: Floats) -> None:
        self.lam += change
        for end, sign in ((0, 1.0), (1, -1.0)):
            size = sign * self.weight[self.nodes[:, end]] * change
            np.add.at(self.x, self.nodes[:, end], size[:, None] * direction)

    def _gauss_seidel(self, sweeps: int, omega: float = 1.0) -> None:
        n, made = len(self.x), batches(len(self.x), self.nodes)
        xw = np.zeros((n + 8, 4))
        xw[:n, :3], xw[:n, 3] = self.x, self.weight
        inverse, soft = np.zeros(made.row.shape), np.zeros(made.row.shape)
        distance.prepare_distances(xw, made.nodes, made.lanes(self.soft), 1.0, 0.0, inverse, soft)
        inverse *= omega
        lam, rest, work = made.lanes(self.lam), made.lanes(self.rest, 1.0), np.zeros(distance.N_WORK)
        for _ in range(sweeps):
            distance.project_distances(work, xw, made.nodes, rest, inverse, soft, lam)
        self.x, self.lam = xw[:n, :3].copy(), made.back(lam)

    def _jacobi(self, sweeps: int) -> None:
        omega = 2.0 / (self.spectrum.least + self.spectrum.most)
        for _ in range(sweeps):
            residuals, direction = self._residuals()
            self._move(omega * residuals / self.diagonal, direction)

    def _chebyshev(self, sweeps: int) -> None:
        theta = 0.5 * (self.spectrum.most + self.spectrum.least)
        delta = 0.5 * (self.spectrum.most - self.spectrum.least)
        rho, change = delta / theta, np.zeros(len(self.rest))
        for k in range(sweeps):
            residuals, direction = self._residuals()
            scaled = residuals / self.diagonal
            if k == 0:
                change = scaled / theta
            else:
                following = 1.0 / (2.0 * theta / delta - rho)
                change = following * rho * change + 2.0 * following / delta * scaled
                rho = following
            self._move(change, direction)
