"""A solver from outside, in a process of its own: lumped masses that springs join.

    python -m mass_springs --connect ENDPOINT

Springs along the edges (k1) and the face diagonals (k2) of cubes of edge h are a solid, along its axes with
C11 = (k1 + 2 k2)/h and C12 = C44 = k2/h (Born's lattice without bending), k1 being shared by four cubes and k2 by two.
So k2 = h lambda and k1 = h (2 mu - lambda) meet Young's modulus, and Poisson's ratio up to 1/3. Planes press on masses;
those of a body without cells are grains, as large as its surface says.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Configure, ToolMotion
from softseam_protocol.models import MODELS, Matter, ModelFacts
from softseam_protocol.participant.part import Part
from softseam_protocol.participant.serve import main
from softseam_protocol.participant.state import State

Floats = NDArray[np.float64]

DAMPING, SAFETY = 0.7, 0.5
"""force over rate of a spring, in stiffness over the fastest swing [1]; of a substep [1]"""
G, SUNK = 9.81, 1e-3
"""[m/s^2]; depth to which a grain's weight sinks in, a share of its radius [1]"""
PROBE = 1e-6
"""force by which it is found how the masses yield, a share of k times a spring's length [1]"""
NOTHING = np.zeros((0, 2), np.intp), np.zeros(0), np.zeros(0, np.intp)
_OCTANTS = np.array([[i + 3 * j + 9 * k for i in (a, a + 1) for j in (b, b + 1) for k in (c, c + 1)]
                     for a in (0, 1) for b in (0, 1) for c in (0, 1)])  # fmt: skip
"""corners of each octant of a cell in its lattice (8, 8)"""


class MassSprings(Part):
    """Symplectic Euler in substeps; a spring belongs to the cells whose octants have it as an edge or a diagonal."""

    def __init__(self, request: Configure) -> None:
        super().__init__(request)
        cells, mass = len(self.mesh.cell_nodes), self.mesh.mass
        self.pairs, self.k, self.cell = self._springs() if cells else NOTHING
        self.length = np.linalg.norm(np.subtract(*self.mesh.x_rest[self.pairs.T]), axis=1)
        self.radius = 0.0 if cells else float(np.linalg.norm(self.mesh.point_local, axis=1).max())
        degree = np.bincount(self.pairs.ravel(), np.repeat(self.k, 2), len(mass))
        self.firm = float(degree.max() if cells else G * mass.max() / (SUNK * self.radius))
        self.fastest = float(np.sqrt(2.0 * (degree + self.firm) / mass).max())
        tools = self.scene.get("tools", {})
        self.planes = {
            i: np.array(tool.get("normal", (0, 0, 1))) / np.linalg.norm(tool.get("normal", (0, 0, 1)))
            for i, tool in enumerate(tools.values()) if tool["kind"] == "plane"
        }  # fmt: skip
        self.n_tools, self.drag = len(tools), self.body.get("damping", 0.0)

    def _springs(self) -> tuple[NDArray[np.intp], Floats, NDArray[np.intp]]:
        """The ends of each spring (m, 2), its stiffness [N/m] and its cell (m,)."""
        material, corners = self.body["material"], self.mesh.cell_nodes[:, _OCTANTS]
        edges = np.ptp(self.mesh.x_rest[corners], axis=2)
        h = float(edges.mean())
        if np.abs(edges - h).max() > 1e-6 * h or material["poisson"] > 1.0 / 3.0:
            raise ValueError("springs need cells that are cubes and a Poisson's ratio of at most 1/3")
        mu = 0.5 * material["young"] / (1.0 + material["poisson"])
        lam = 2.0 * mu * material["poisson"] / (1.0 - 2.0 * material["poisson"])
        first, second = np.triu_indices(8, 1)
        apart = np.array([bin(a ^ b).count("1") for a, b in zip(first, second, strict=True)])
        k = np.array([0.0, h * (2.0 * mu - lam) / 4.0, h * lam / 2.0, 0.0])[apart]
        joins = k > 0.0
        pairs = np.stack([corners[..., first[joins]], corners[..., second[joins]]], axis=-1).reshape(-1, 2)
        return (
            pairs.astype(np.intp),
            np.tile(k[joins], corners.size // 8),
            np.repeat(np.arange(len(corners)), 8 * joins.sum()),
        )

    def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
        mass, free = self.mesh.mass[:, None], (self.mesh.fixed == 0)[:, None]
        x, v, n = state.x.copy(), state.v.copy(), int(np.ceil(dt * self.fastest / SAFETY))
        load, wrench, work = mass * self.gravity, np.zeros((self.n_tools, 6)), 0.0
        load[self.coupling] += force
        for _ in range(n):
            pressed = {i: self._pressed(x, v, tools.position_next[i], normal) for i, normal in self.planes.items()}
            presses = sum(pressed.values(), np.zeros_like(x))
            v = (v + dt / n * free * (load + self._between(x, v) + presses) / mass) / (1.0 + dt / n * self.drag)
            work += float((presses * v).sum()) * dt / n
            for i, press in pressed.items():
                wrench[i, :3] -= press.sum(axis=0) / n
                wrench[i, 3:] -= np.cross(x - tools.position_next[i], press).sum(axis=0) / n
            x = x + dt / n * v
        touched = {"wrench": wrench, "tool_work": work} if wrench.any() else {}
        return State(x, v, advanced=touched)

    def strain_energy(self, state: State) -> Floats:
        stretch = self._stretch(state.x)[1]
        energy = np.zeros(len(self.mesh.cell_nodes))
        np.add.at(energy, self.cell, 0.5 * self.k * stretch**2)
        return energy

    def response(self, state: State, dt: float) -> Floats:
        """By steps under a small force each, without tools."""
        size, none = PROBE * float((self.k * self.length).max()), np.zeros((0, 3))
        planes, self.planes, still = self.planes, {}, ToolMotion(none, np.zeros((0, 4)), none, np.zeros((0, 4)))
        forces = np.concatenate([np.zeros((1, len(self.coupling) * 3)), size * np.eye(len(self.coupling) * 3)])
        ends = [self.step(state, dt, one.reshape(-1, 3), still).x.ravel() for one in forces]
        self.planes = planes
        return np.asarray((np.array(ends[1:]) - ends[0]).T / size)

    def _stretch(self, x: Floats) -> tuple[Floats, Floats]:
        """Unit vectors along the springs (m, 3) and their stretches (m,) [m]."""
        along = x[self.pairs[:, 1]] - x[self.pairs[:, 0]]
        length = np.linalg.norm(along, axis=1)
        return np.asarray(along / length[:, None]), length - self.length

    def _between(self, x: Floats, v: Floats) -> Floats:
        """Forces of the springs (n, 3) [N]."""
        (i, j), (along, stretch), force = self.pairs.T, self._stretch(x), np.zeros_like(x)
        rate = ((v[j] - v[i]) * along).sum(axis=1)
        tension = self.k * (stretch + DAMPING / self.fastest * rate)
        np.add.at(force, i, tension[:, None] * along)
        np.add.at(force, j, -tension[:, None] * along)
        return force

    def _pressed(self, x: Floats, v: Floats, point: Floats, normal: Floats) -> Floats:
        """Forces of a plane (n, 3) [N]."""
        depth = self.radius - (x - point) @ normal
        press = np.where(depth > 0.0, self.firm * (depth - DAMPING / self.fastest * (v @ normal)), 0.0)
        return np.asarray(np.maximum(press, 0.0)[:, None] * normal)


TAKES: frozenset[Matter] = frozenset({"cells", "particles"})
ROWS = ((MODELS, "springs", ModelFacts("Springs", colour=(190, 150, 90), service="springs", takes=TAKES)),)

if __name__ == "__main__":
    for table, name, row in ROWS:
        table.add(name, row)
    main(MassSprings, "springs")
