"""One step of a linear system M a + C v + K u = F, as matrices, for each time integrator.

A side's state is a vector y (4 n,): u, v, and two rows for what an integrator remembers (acceleration of Newmark, last
u and v of BDF2; else zero). A step of length h with the force F is y <- P y + Q F, where F is taken at the fraction
`where` of the step.

    implicit_euler  (M + h C + h^2 K) v1 = M v0 + h (F1 - K u0),  u1 = u0 + h v1
    midpoint        (M + h C/2 + h^2 K/4) v1 = (M - h C/2) v0 + h (F_1/2 - K (u0 + h v0/4)),  u1 = u0 + h (v0 + v1)/2
    theta           as midpoint, at a fraction th: a = (M + th h C + th^2 h^2 K)^-1 (F_th - K (u0 + th h v0) - C v0),
                    v1 = v0 + h a,  u1 = u0 + h (v0 + th h a)
    bdf2            3 y1 - 4 y0 + y_-1 = 2 h y1' for y = u and v
    newmark         u* = u0 + h v0 + h^2 (1/2 - beta) a0,  v* = v0 + h (1 - gamma) a0,
                    (M + gamma h C + beta h^2 K) a1 = F1 - K u* - C v*  (trapezoidal: beta 1/4, gamma 1/2)
    generalised_alpha   u*, v* likewise, M ((1 - am) a1 + am a0) = F_t - K u_t - C v_t at the fraction 1 - af, with
                    Chung and Hulbert's am, af, beta, gamma of the spectral radius 0.8 (J. Appl. Mech. 60, 1993)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LinearSide:
    """One side of a split linear system (n unknowns, s constraints): M a + C v + K u = f + L^T lambda."""

    mass: Floats
    """(n, n) [kg]"""
    stiffness: Floats
    """(n, n) [N/m]"""
    link: Floats
    """L (s, n): +1 on the near side, -1 on the far side, as `seam.py` has it"""
    damping: Floats | None = None
    """(n, n) [N s/m]"""
    load: Floats | None = None
    """constant force (n,) [N]"""

    @property
    def n(self) -> int:
        return len(self.mass)

    def force(self) -> Floats:
        return np.zeros(self.n) if self.load is None else self.load

    def viscous(self) -> Floats:
        return np.zeros_like(self.mass) if self.damping is None else self.damping

    def energy(self, y: Floats) -> float:
        """Kinetic + strain energy [J]."""
        u, v = y[: self.n], y[self.n : 2 * self.n]
        return 0.5 * float(v @ self.mass @ v + u @ self.stiffness @ u)


@dataclass(frozen=True)
class Propagator:
    """One step of one side as matrices."""

    matrix: Floats
    """P (4n, 4n)"""
    force: Floats
    """Q (4n, n)"""
    link: Floats
    """Q L^T (4n, s): answer to a unit multiplier"""
    where: float
    """fraction of the step at which the force acts [1]"""
    work_at_end: float
    """weight of the end's force in the work of a step: dE = (w F1 + (1 - w) F0) du - dissipation [1]"""


def _implicit_euler(side: LinearSide, h: float) -> tuple[Floats, Floats, float, float]:
    n, eye = side.n, np.eye(side.n)
    inverse = np.linalg.inv(side.mass + h * side.viscous() + h * h * side.stiffness)
    p, q = np.zeros((4 * n, 4 * n)), np.zeros((4 * n, n))
    v_u, v_v, v_f = -h * inverse @ side.stiffness, inverse @ side.mass, h * inverse
    p[:n, :n], p[:n, n : 2 * n], q[:n] = eye + h * v_u, h * v_v, h * v_f
    p[n : 2 * n, :n], p[n : 2 * n, n : 2 * n], q[n : 2 * n] = v_u, v_v, v_f
    return p, q, 1.0, 1.0


def _midpoint(side: LinearSide, h: float) -> tuple[Floats, Floats, float, float]:
    n, eye = side.n, np.eye(side.n)
    inverse = np.linalg.inv(side.mass + 0.5 * h * side.viscous() + 0.25 * h * h * side.stiffness)
    p, q = np.zeros((4 * n, 4 * n)), np.zeros((4 * n, n))
    v_u = -h * inverse @ side.stiffness
    v_v = inverse @ (side.mass - 0.5 * h * side.viscous() - 0.25 * h * h * side.stiffness)
    v_f = h * inverse
    p[:n, :n], p[:n, n : 2 * n], q[:n] = eye + 0.5 * h * v_u, 0.5 * h * (eye + v_v), 0.5 * h * v_f
    p[n : 2 * n, :n], p[n : 2 * n, n : 2 * n], q[n : 2 * n] = v_u, v_v, v_f
    return p, q, 0.5, 0.5


def _theta(side: LinearSide, h: float, theta: float = 0.51) -> tuple[Floats, Floats, float, float]:
    n, eye = side.n, np.eye(side.n)
    inverse = np.linalg.inv(side.mass + theta * h * side.viscous() + (theta * h) ** 2 * side.stiffness)
    p, q = np.zeros((4 * n, 4 * n)), np.zeros((4 * n, n))
    u, v = slice(0, n), slice(n, 2 * n)
    a_u, a_v = -inverse @ side.stiffness, -inverse @ (theta * h * side.stiffness + side.viscous())
    p[v, u], p[v, v], q[v] = h * a_u, eye + h * a_v, h * inverse
    p[u, u], p[u, v], q[u] = eye + theta * h * p[v, u], h * (eye + theta * h * a_v), theta * h * q[v]
    return p, q, theta, theta


def _bdf2(side: LinearSide, h: float) -> tuple[Floats, Floats, float, float]:
    n, eye = side.n, np.eye(side.n)
    g = 2.0 * h / 3.0
    inverse = np.linalg.inv(side.mass + g * side.viscous() + g * g * side.stiffness)
    p, q = np.zeros((4 * n, 4 * n)), np.zeros((4 * n, n))
    u0, v0, u_last, v_last = (slice(i * n, (i + 1) * n) for i in range(4))
    p[v0, v0], p[v0, v_last] = 4.0 / 3.0 * inverse @ side.mass, -1.0 / 3.0 * inverse @ side.mass
    p[v0, u0], p[v0, u_last] = -4.0 / 3.0 * g * inverse @ side.stiffness, g / 3.0 * inverse @ side.stiffness
    q[v0] = g * inverse
    p[u0] = g * p[v0]
    p[u0, u0] += 4.0 / 3.0 * eye
    p[u0, u_last] -= 1.0 / 3.0 * eye
    q[u0] = g * q[v0]
    p[u_last, u0], p[v_last, v0] = eye, eye
    return p, q, 1.0, 1.0


def _newmark(side: LinearSide, h: float, beta: float = 0.25, gamma: float = 0.5) -> tuple[Floats, Floats, float, float]:
    n, eye = side.n, np.eye(side.n)
    inverse = np.linalg.inv(side.mass + gamma * h * side.viscous() + beta * h * h * side.stiffness)
    guess_u = np.hstack([eye, h * eye, h * h * (0.5 - beta) * eye, 0.0 * eye])
    guess_v = np.hstack([0.0 * eye, eye, h * (1.0 - gamma) * eye, 0.0 * eye])
    a = -inverse @ (side.stiffness @ guess_u + side.viscous() @ guess_v)
    p = np.vstack([guess_u + beta * h * h * a, guess_v + gamma * h * a, a, np.zeros((n, 4 * n))])
    q = np.vstack([beta * h * h * inverse, gamma * h * inverse, inverse, np.zeros((n, n))])
    return p, q, 1.0, gamma


def _generalised_alpha(side: LinearSide, h: float, radius: float = 0.8) -> tuple[Floats, Floats, float, float]:
    n, eye = side.n, np.eye(side.n)
    am, af = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    beta, gamma, share = 0.25 * (1.0 - am + af) ** 2, 0.5 - am + af, 1.0 - af
    yields = share * (gamma * h * side.viscous() + beta * h * h * side.stiffness)
    inverse = np.linalg.inv((1.0 - am) * side.mass + yields)
    guess_u = np.hstack([eye, h * eye, h * h * (0.5 - beta) * eye, 0.0 * eye])
    guess_v = np.hstack([0.0 * eye, eye, h * (1.0 - gamma) * eye, 0.0 * eye])
    u0, v0, a0 = (np.eye(n, 4 * n, k * n) for k in range(3))
    a = -inverse @ (
        am * side.mass @ a0
        + side.stiffness @ (share * guess_u + af * u0)
        + side.viscous() @ (share * guess_v + af * v0)
    )
    p = np.vstack([guess_u + beta * h * h * a, guess_v + gamma * h * a, a, np.zeros((n, 4 * n))])
    q = np.vstack([beta * h * h * inverse, gamma * h * inverse, inverse, np.zeros((n, n))])
    return p, q, share, share


INTEGRATORS: dict[str, Callable[[LinearSide, float], tuple[Floats, Floats, float, float]]] = {
    "implicit_euler": _implicit_euler,
    "midpoint": _midpoint,
    "theta": _theta,
    "bdf2": _bdf2,
    "newmark": _newmark,
    "generalised_alpha": _generalised_alpha,
}


def propagate(side: LinearSide, integrator: str, h: float) -> Propagator:
    """Matrices of one step of length h [s]."""
    p, q, where, work_at_end = INTEGRATORS[integrator](side, h)
    return Propagator(p, q, q @ side.link.T, where, work_at_end)


def start(side: LinearSide, integrator: str, h: float, u: Floats, v: Floats, lambda_: Floats) -> Floats:
    """State of a side at rest in time: consistent acceleration, or a backward Taylor step for BDF2 (4n,)."""
    n = side.n
    y = np.zeros(4 * n)
    y[:n], y[n : 2 * n] = u, v
    load = side.force() + side.link.T @ lambda_ - side.stiffness @ u - side.viscous() @ v
    a = np.linalg.solve(side.mass, load)
    if integrator in ("newmark", "generalised_alpha"):
        y[2 * n : 3 * n] = a
    elif integrator == "bdf2":
        y[2 * n : 3 * n] = u - h * v + 0.5 * h * h * a
        y[3 * n :] = v - h * a
    return y
