"""A solver from outside, in a process of its own: lumped masses that springs join, or grains that press on one another.

    python -m grains ENDPOINT

Springs along the edges (k1) and the face diagonals (k2) of cubes of edge h are a solid, along its axes with
C11 = (k1 + 2 k2)/h and C12 = C44 = k2/h (Born's lattice without bending), k1 being shared by four cubes and k2 by two.
So k2 = h lambda and k1 = h (2 mu - lambda) meet Young's modulus, and Poisson's ratio up to 1/3. Where a body is of
points without cells, all pairs that are closer than two radii press, and nothing pulls. Planes press on points.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import ToolMotion
from softseam_protocol.scene.tools import PlaneTool

Floats = NDArray[np.float64]

DAMPING, NEIGHBOURS, SAFETY = 0.7, 12, 0.5
"""force over rate of a pair, in stiffness over the fastest swing [1]; of a grain, at most; of a substep [1]"""
_OCTANTS = np.array([[i + 3 * j + 9 * k for i in (a, a + 1) for j in (b, b + 1) for k in (c, c + 1)]
                     for a in (0, 1) for b in (0, 1) for c in (0, 1)])  # fmt: skip
"""corners of each octant of a cell in its lattice (8, 8)"""


def bonds(part: Any) -> tuple[Any, Floats, Any]:
    """Pairs (m, 2), their lengths at rest (m,) [m] and stiffnesses (m,) [N/m] of a part in cells. Raises ValueError."""
    rest, material = part.mesh.x_rest, part.scene.body.material
    corners = part.mesh.cell_nodes[:, _OCTANTS].reshape(-1, 8)
    edges = np.ptp(rest[corners], axis=1)
    h = float(edges.mean())
    if np.abs(edges - h).max() > 1e-6 * h or material.poisson > 1.0 / 3.0:
        raise ValueError("springs need cells that are cubes and a Poisson's ratio of at most 1/3: change the body's")
    mu = 0.5 * material.young / (1.0 + material.poisson)
    lam = 2.0 * mu * material.poisson / (1.0 - 2.0 * material.poisson)
    first, second = np.triu_indices(8, 1)
    apart = np.array([bin(a ^ b).count("1") for a, b in zip(first, second, strict=True)])
    shares = np.array([0.0, h * (2.0 * mu - lam) / 4.0, h * lam / 2.0, 0.0])[apart]
    pairs = np.sort(np.stack([corners[:, first], corners[:, second]], axis=2).reshape(-1, 2), axis=1)
    joined, which = np.unique(pairs, axis=0, return_inverse=True)
    k = np.bincount(which.ravel(), np.tile(shares, len(corners)))
    joined, k = joined[k > 0.0], k[k > 0.0]
    return joined, np.linalg.norm(np.subtract(*rest[joined.T]), axis=1), k


class Grains:
    """What a model is to its service: it is configured, advances, is observed, saved and loaded."""

    def configure(self, part: Any) -> None:
        """Begin with a part of a body: its scene, mesh, coupling nodes and state. Raises ValueError."""
        mesh, n = part.mesh, len(part.mesh.nodes)
        self.x, self.v, self.mass, self.coupling = part.x.copy(), part.v.copy(), mesh.mass[:, None], part.coupling
        self.free, self.gravity = (mesh.fixed == 0)[:, None], np.array(part.scene.gravity)
        self.drag = part.scene.body.damping
        tools = enumerate(part.scene.tools.values())
        self.planes = {i: np.array(tool.normal) for i, tool in tools if isinstance(tool, PlaneTool)}
        self.n_tools, self.bonded, self.radius = len(part.scene.tools), len(mesh.cell_nodes) > 0, 0.0
        if self.bonded:
            self.pairs, self.rest, self.k = bonds(part)
            degree = np.bincount(self.pairs.ravel(), np.repeat(self.k, 2), n)
        else:
            self.radius, k = part.scene.body.radius, part.scene.body.stiffness
            self.pairs = np.stack(np.triu_indices(n, 1), axis=1)
            self.rest, self.k = (np.full(len(self.pairs), value) for value in (2.0 * self.radius, k))
            degree = np.full(n, NEIGHBOURS * k)
        self.firm = float(degree.max())
        self.fastest = float(np.sqrt(2.0 * (degree + self.firm) / mesh.mass).max())
        self.rate = DAMPING / self.fastest

    def advance(self, dt: float, force: Floats, tools: ToolMotion) -> dict[str, Any]:
        """Move on by dt [s] under a force on the coupling nodes (s, 3) [N]; wrench on and work of the tools."""
        wrench, work, n = np.zeros((self.n_tools, 6)), 0.0, int(np.ceil(dt * self.fastest / SAFETY))
        weight = self.mass * self.gravity
        weight[self.coupling] += force
        for _ in range(n):
            presses = {i: self._pressed(tools.position_next[i], normal) for i, normal in self.planes.items()}
            pressed = sum(presses.values(), np.zeros_like(self.x))
            self.v += dt / n * self.free * (weight + self._between() + pressed) / self.mass
            self.v /= 1.0 + dt / n * self.drag
            way = dt / n * self.v
            work += float((pressed * way).sum())
            for i, press in presses.items():
                wrench[i, :3] -= press.sum(axis=0) / n
                wrench[i, 3:] -= np.cross(self.x - tools.position_next[i], press).sum(axis=0) / n
            self.x += way
        return {"wrench": wrench, "tool_work": work}

    def observe(self) -> dict[str, Any]:
        """Where the masses are, how fast, and what the springs store [J]; the library finds the rest of this."""
        stretch = self._stretch()[1]
        return {"x": self.x, "v": self.v, "strain": 0.5 * float(self.k @ stretch**2)}

    def save(self) -> dict[str, Any]:
        """Everything that the future depends on."""
        return {"x": self.x, "v": self.v}

    def load(self, arrays: Any) -> None:
        self.x, self.v = arrays["x"].copy(), arrays["v"].copy()

    def _stretch(self) -> tuple[Floats, Floats]:
        """Unit vectors along the pairs (m, 3) and their stretches, of grains those that press alone (m,) [m]."""
        along = self.x[self.pairs[:, 1]] - self.x[self.pairs[:, 0]]
        length = np.linalg.norm(along, axis=1)
        stretch = length - self.rest
        return np.asarray(along / length[:, None]), stretch if self.bonded else np.minimum(stretch, 0.0)

    def _between(self) -> Any:
        """Forces of the pairs (n, 3) [N]."""
        (i, j), (along, stretch) = self.pairs.T, self._stretch()
        tension = self.k * (stretch + self.rate * ((self.v[j] - self.v[i]) * along).sum(axis=1))
        if not self.bonded:
            tension = np.where(stretch < 0.0, np.minimum(tension, 0.0), 0.0)
        force = np.zeros_like(self.x)
        np.add.at(force, i, tension[:, None] * along)
        np.add.at(force, j, -tension[:, None] * along)
        return force

    def _pressed(self, point: Floats, normal: Floats) -> Floats:
        """Forces of a plane (n, 3) [N]."""
        unit = normal / np.linalg.norm(normal)
        depth = self.radius - (self.x - point) @ unit
        press = np.where(depth > 0.0, self.firm * (depth - self.rate * (self.v @ unit)), 0.0)
        return np.asarray(np.maximum(press, 0.0)[:, None] * unit)


def add() -> None:
    """Add the model's row."""
    models = import_module("softseam_protocol.models")
    models.MODELS.add(
        "grains",
        models.Model(label="Grains", colour=(190, 150, 90), service="grains", solver="grains:Grains", cost=30.0),
    )


def remove() -> None:
    import_module("softseam_protocol.models").MODELS.remove("grains")


if __name__ == "__main__":
    import_module("softseam_protocol.participant").serve(Grains, service="grains", connect=sys.argv[1])
