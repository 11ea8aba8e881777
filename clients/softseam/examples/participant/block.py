"""A linear elastic block in a frame that turns with it, by implicit Euler: the mechanics of the example.

    M (v1 - v0) = dt (f + M g - R K (R^T x1 - X)),   x1 = x0 + dt v1                                               (1)

with f the force on the coupling nodes, X the rest positions and R the block's mean rotation as the step begins. Masses
are lumped, so with y = R^T x, w = R^T v only the matrix A = M + dt^2 K is ever inverted, once a length of the step:

    A (w1 - w0) = dt (R^T (f + M g) - K (y0 - X) - dt K w0)                                                        (2)

and d(x1)/d(f) = dt^2 R A^-1 R^T. Cells are eight trilinear hexahedra each, whose change of volume is their mean.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Configure, ToolMotion
from softseam_protocol.participant.part import Part
from softseam_protocol.participant.part_mesh import CORNERS, OCTANTS
from softseam_protocol.participant.state import State

Floats = NDArray[np.float64]


def linear(body: dict[str, Any]) -> tuple[float, float]:
    """Young's modulus [Pa] and Poisson's ratio of a body of the scene. Raises ValueError where these are not all."""
    material = body["material"]
    if material["retardation_time"] or body.get("damping") or body["inclusions"] or any(body["spin"]):
        raise ValueError(
            "no retardation_time, damping, inclusions or spin in a linear block: leave this body to fem or pbd"
        )
    return material["young"], material["poisson"]


class LinearBlock(Part):
    """The part that a Configure describes (n nodes, c cells, s coupling nodes)."""

    def __init__(self, request: Configure) -> None:
        """Raises ValueError where this is no part for a linear block."""
        super().__init__(request)
        young, poisson = linear(self.body)
        self.mu = young / (2.0 * (1.0 + poisson))
        self.lame = 2.0 * self.mu * poisson / (1.0 - 2.0 * poisson)
        self.rest, self.mass = self.mesh.x_rest, self.mesh.mass
        self.moves = np.flatnonzero(np.repeat(self.mesh.fixed == 0, 3))  # unknowns that are not clamped
        self.octants = self.mesh.cell_nodes[:, OCTANTS].reshape(-1, 8)
        self.gradient, self.stiffness = self._elements()
        n = len(self.rest)
        self.K = np.zeros((3 * n, 3 * n))
        for nodes, stiffness in zip(self.octants, self.stiffness, strict=True):
            at = (3 * nodes[:, None] + np.arange(3)).ravel()
            self.K[np.ix_(at, at)] += stiffness
        self._dt, self._inverse = 0.0, np.zeros((0, 0))

    def _elements(self) -> tuple[Floats, Floats]:
        """Mean gradients of the shape functions (8c, 8, 3) [1/m], and stiffnesses (8c, 24, 24) [N/m]."""
        x, gradients, weights = self.rest[self.octants], [], []
        for point in (CORNERS - 0.5) / np.sqrt(3.0) + 0.5:  # Gauss's
            each = np.where(CORNERS == 1, point, 1.0 - point)
            local = np.stack([(2 * CORNERS[:, i] - 1) * np.delete(each, i, axis=1).prod(axis=1) for i in range(3)], 1)
            jacobian = np.einsum("oai,aj->oij", x, local)
            gradients.append(np.einsum("aj,oji->oai", local, np.linalg.inv(jacobian)))
            weights.append(np.linalg.det(jacobian) / 8.0)
        volume = np.sum(weights, axis=0)
        mean = sum(w[:, None, None] * g for w, g in zip(weights, gradients, strict=True)) / volume[:, None, None]
        bulk, unit = self.lame + 2.0 / 3.0 * self.mu, np.eye(3)
        stiffness = bulk * np.einsum("o,oai,obj->oaibj", volume, mean, mean)
        for w, g in zip(weights, gradients, strict=True):
            stiffness += self.mu * np.einsum("o,oak,obk,ij->oaibj", w, g, g, unit)
            stiffness += self.mu * np.einsum("o,oaj,obi->oaibj", w, g, g)
            stiffness -= 2.0 / 3.0 * self.mu * np.einsum("o,oai,obj->oaibj", w, g, g)
        return mean, stiffness.reshape(-1, 24, 24)

    def rotation(self, x: Floats) -> Floats:
        """The mean rotation R (3, 3) of positions (n, 3) [m]: it makes sum m |x - c - R (X - C)|^2 least."""
        share = self.mass / self.mass.sum()
        u, _, v = np.linalg.svd((share[:, None] * (self.rest - share @ self.rest)).T @ (x - share @ x))
        return np.asarray(v.T @ np.diag([1.0, 1.0, np.linalg.det(v.T @ u.T)]) @ u.T)

    def inverse(self, dt: float) -> Floats:
        """A^-1 of eq. (2), zero where nodes are clamped (3n, 3n) [1/kg]."""
        if dt != self._dt:
            moves = np.ix_(self.moves, self.moves)
            self._inverse = np.zeros_like(self.K)
            self._inverse[moves] = np.linalg.inv(np.diag(np.repeat(self.mass, 3))[moves] + dt * dt * self.K[moves])
            self._dt = dt
        return self._inverse

    def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
        """Eq. (2); it touches no tool."""
        R = self.rotation(state.x)
        load = self.mass[:, None] * self.gravity
        load[self.coupling] += force
        w = (state.v @ R).ravel()
        b = (load @ R).ravel() - self.K @ ((state.x @ R - self.rest).ravel() + dt * w)
        v = (w + dt * (self.inverse(dt) @ b)).reshape(-1, 3) @ R.T
        v[self.mesh.fixed == 1] = 0.0
        return State(state.x + dt * v, v)

    def response(self, state: State, dt: float) -> Floats:
        """dt^2 R A^-1 R^T, the columns of the coupling nodes (3n, 3s) [m/N]."""
        R, n, s = self.rotation(state.x), len(self.rest), len(self.coupling)
        columns = self.inverse(dt).reshape(n, 3, n, 3)[:, :, self.coupling]
        turned = np.einsum("ik,akbl,jl->aibj", R, columns, R, optimize=True)
        return np.asarray(dt * dt * turned.reshape(3 * n, 3 * s))

    def strain_energy(self, state: State) -> Floats:
        """Of each cell (c,) [J]."""
        u = (state.x @ self.rotation(state.x) - self.rest)[self.octants].reshape(-1, 24)
        return np.asarray(0.5 * np.einsum("oi,oij,oj->o", u, self.stiffness, u).reshape(-1, 8).sum(axis=1))

    def stress(self, state: State) -> Floats:
        """Cauchy's, xx yy zz yz xz xy, in each octant (c, 8, 6) [Pa]."""
        R = self.rotation(state.x)
        H = np.einsum("oai,oaj->oij", (state.x @ R - self.rest)[self.octants], self.gradient)
        strain = 0.5 * (H + H.transpose(0, 2, 1))
        trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
        s = R @ (self.lame * trace * np.eye(3) + 2.0 * self.mu * strain) @ R.T
        parts = [s[:, 0, 0], s[:, 1, 1], s[:, 2, 2], s[:, 1, 2], s[:, 0, 2], s[:, 0, 1]]
        return np.stack(parts, axis=1).reshape(-1, 8, 6)
