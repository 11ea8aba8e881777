"""A linear elastic block in a frame that turns with it, by implicit Euler: the mechanics of the example.

    M (v1 - v0) = dt (f + M g - R K (R^T x1 - X)),   x1 = x0 + dt v1                                               (1)

with f the force on the coupling nodes, X the rest positions and R the block's mean rotation as the step begins. Masses
are lumped, so with y = R^T x, w = R^T v only the matrix A = M + dt^2 K is ever inverted, once a length of the step:

    A (w1 - w0) = dt (R^T (f + M g) - K (y0 - X) - dt K w0)                                                        (2)

and d(x1)/d(f) = dt^2 R A^-1 R^T, with the R of the step in which that was told last: whoever couples the block counts
with what it was told, and steps are corrected by the same. Cells are eight trilinear hexahedra each, whose change of
volume is their mean.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Configure

Floats = NDArray[np.float64]

_CORNERS = np.array([(a, b, c) for c in (0, 1) for b in (0, 1) for a in (0, 1)])
"""of an octant, and the octants of a cell; x fastest (8, 3)"""
_OCTANTS = np.array([(octant + _CORNERS) @ (1, 3, 9) for octant in _CORNERS])
"""places of each octant's corners among a cell's 27 nodes (8, 8)"""


def linear(body: dict[str, Any]) -> tuple[float, float]:
    """Young's modulus [Pa] and Poisson's ratio of a body of the scene. Raises ValueError where these are not all."""
    material = body["material"]
    if material["retardation_time"] or body.get("damping") or body["inclusions"] or any(body["spin"]):
        raise ValueError(
            "no retardation_time, damping, inclusions or spin in a linear block: leave this body to fem or pbd"
        )
    return material["young"], material["poisson"]


class LinearBlock:
    """The part that a Configure describes (n nodes, c cells, s coupling nodes) and its state."""

    def __init__(self, request: Configure) -> None:
        """Raises ValueError where this is no part for a linear block."""
        scene, mesh = json.loads(request.bundle.scene), request.mesh
        if mesh is None:
            raise ValueError("Configure tells no mesh: a linear block needs cells, of an orchestrator as new as itself")
        body = (scene.get("bodies") or {request.body: scene["body"]})[request.body]
        young, poisson = linear(body)
        self.mu = young / (2.0 * (1.0 + poisson))
        self.lame = 2.0 * self.mu * poisson / (1.0 - 2.0 * poisson)
        self.mesh, self.rest, self.mass = mesh, mesh.x_rest, mesh.mass
        self.weight = self.mass[:, None] * np.array(scene["gravity"])
        self.coupling = np.searchsorted(mesh.nodes, request.seam_nodes)
        self.moves = np.flatnonzero(np.repeat(mesh.fixed == 0, 3))  # unknowns that are not clamped
        self.octants = mesh.cell_nodes[:, _OCTANTS].reshape(-1, 8)
        self.gradient, self.volume, self.stiffness = self._elements()
        n = len(self.rest)
        self.K = np.zeros((3 * n, 3 * n))
        for nodes, stiffness in zip(self.octants, self.stiffness, strict=True):
            at = (3 * nodes[:, None] + np.arange(3)).ravel()
            self.K[np.ix_(at, at)] += stiffness
        self.x, self.v = self.rest.copy(), np.tile(body["velocity"], (n, 1))
        if request.state is not None:
            self.x, self.v = request.state.x[mesh.nodes], request.state.v[mesh.nodes]
        self.told, self.told_dt = np.eye(3), 0.0
        """the R and dt with which the compliance was told last, 0 before: they evolve, as x and v"""
        self._dt, self._inverse = 0.0, np.zeros((0, 0))

    def _elements(self) -> tuple[Floats, Floats, Floats]:
        """Mean gradients of the shape functions (8c, 8, 3), volumes (8c,), stiffnesses (8c, 24, 24)."""
        x, gradients, weights = self.rest[self.octants], [], []
        for point in (_CORNERS - 0.5) / np.sqrt(3.0) + 0.5:  # Gauss's
            each = np.where(_CORNERS == 1, point, 1.0 - point)
            local = np.stack([(2 * _CORNERS[:, i] - 1) * np.delete(each, i, axis=1).prod(axis=1) for i in range(3)], 1)
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
        return mean, volume, stiffness.reshape(-1, 24, 24)

    def rotation(self, x: Floats) -> Floats:
        """The mean rotation R (3, 3) of positions (n, 3): it makes sum m |x - c - R (X - C)|^2 least."""
        share = self.mass / self.mass.sum()
        u, _, v = np.linalg.svd((share[:, None] * (self.rest - share @ self.rest)).T @ (x - share @ x))
        return np.asarray(v.T @ np.diag([1.0, 1.0, np.linalg.det(v.T @ u.T)]) @ u.T)

    def inverse(self, dt: float) -> Floats:
        """A^-1 of eq. (2), zero where nodes are clamped (3n, 3n) [1/kg]."""
        if dt != self._dt:
            moves = self.moves
            free = np.diag(np.repeat(self.mass, 3)[moves]) + dt * dt * self.K[np.ix_(moves, moves)]
            self._inverse = np.zeros_like(self.K)
            self._inverse[np.ix_(moves, moves)] = np.linalg.inv(free)
            self._dt = dt
        return self._inverse

    def step(self, dt: float, force: Floats) -> tuple[Floats, Floats]:
        """Positions and velocities (n, 3) after a step under a force on the coupling nodes (s, 3) [N]; eq. (2)."""
        R = self.rotation(self.x)
        load = self.weight.copy()
        load[self.coupling] += force
        w = (self.v @ R).ravel()
        b = (load @ R).ravel() - self.K @ ((self.x @ R - self.rest).ravel() + dt * w)
        v = (w + dt * (self.inverse(dt) @ b)).reshape(-1, 3) @ R.T
        v[self.mesh.fixed == 1] = 0.0
        return self.x + dt * v, v

    def answer(self, force: Floats) -> Floats:
        """How far all nodes move by a force on the coupling nodes (s, 3) [N], as was told (n, 3) [m]."""
        dt, R, load = self.told_dt, self.told, np.zeros_like(self.x)
        load[self.coupling] = force @ R
        return np.asarray(dt * dt * (self.inverse(dt) @ load.ravel()).reshape(-1, 3) @ R.T)

    def compliance(self, dt: float) -> Floats:
        """Of the coupling nodes (3s, 3s) [m/N]."""
        self.told, self.told_dt = self.rotation(self.x), dt
        at, s = (3 * self.coupling[:, None] + np.arange(3)).ravel(), len(self.coupling)
        R, block = self.told, self.inverse(dt)[np.ix_(at, at)].reshape(s, 3, s, 3)
        return np.asarray(dt * dt * np.einsum("ik,akbl,jl->aibj", R, block, R).reshape(3 * s, 3 * s))

    def to_bytes(self) -> bytes:
        """Everything that the future depends on."""
        return np.concatenate([self.x, self.v, self.told, np.full((1, 3), self.told_dt)]).tobytes()

    def take(self, state: bytes) -> None:
        """Go on from `to_bytes` of the same part. Raises ValueError."""
        n = len(self.x)
        if len(state) != 24 * (2 * n + 4):
            raise ValueError(f"a state of {len(state)} bytes, this part's has {24 * (2 * n + 4)}: send one of its own")
        self.x, self.v, self.told, told_dt = np.split(np.frombuffer(state).reshape(-1, 3).copy(), [n, 2 * n, 2 * n + 3])
        self.told_dt = float(told_dt[0, 0])

    def energies(self, x: Floats, v: Floats) -> tuple[float, float, float]:
        """Kinetic, strain and gravity's [J]."""
        kinetic = 0.5 * float(self.mass @ (v * v).sum(axis=1))
        return kinetic, float(self.cell_energy(x).sum()), -float((self.weight * (x - self.rest)).sum())

    def cell_energy(self, x: Floats) -> Floats:
        """Strain energy of each cell (c,) [J]."""
        u = (x @ self.rotation(x) - self.rest)[self.octants].reshape(-1, 24)
        return np.asarray(0.5 * np.einsum("oi,oij,oj->o", u, self.stiffness, u).reshape(-1, 8).sum(axis=1))

    def stress(self, x: Floats) -> Floats:
        """Cauchy's, xx yy zz yz xz xy, in each octant (c, 8, 6) [Pa]."""
        R = self.rotation(x)
        H = np.einsum("oai,oaj->oij", (x @ R - self.rest)[self.octants], self.gradient)
        strain = 0.5 * (H + H.transpose(0, 2, 1))
        trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
        s = R @ (self.lame * trace * np.eye(3) + 2.0 * self.mu * strain) @ R.T
        parts = [s[:, 0, 0], s[:, 1, 1], s[:, 2, 2], s[:, 1, 2], s[:, 0, 2], s[:, 0, 1]]
        return np.stack(parts, axis=1).reshape(-1, 8, 6)

    def surface(self, x: Floats) -> Floats:
        """Positions of the surface points (p, 3) [m]."""
        local = self.mesh.point_local
        octant = (local > 0.0).astype(int)
        inside = local + 1.0 - octant  # 0 to 1 along the octant's edges
        corner = np.where(_CORNERS == 1, inside[:, None], 1.0 - inside[:, None]).prod(axis=2)
        nodes = self.octants.reshape(-1, 8, 8)[self.mesh.point_cell, octant @ (1, 2, 4)]
        return np.asarray(np.einsum("pa,pai->pi", corner, x[nodes]))
