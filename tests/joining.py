"""Two kinds of interface between bodies, for tests: a spring between faces, and one body that rests on another."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from softseam_coupling.interfaces import KINDS, Meeting, Rows
from softseam_protocol.scene.interfaces import INTERFACES, InterfaceSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Positive

Floats = NDArray[np.float64]
EDGE, DENSITY = 0.04, 1000.0
WEIGHT = 9.81 * DENSITY * EDGE**3
"""of a cube [N]"""


class SpringSpec(InterfaceSpec):
    """Draws the middle of the lower face of the first body to that of the upper face of the second."""

    kind: Literal["spring"] = "spring"
    stiffness: Positive = Field(description="force over the distance [N/m]")


class RestSpec(InterfaceSpec):
    """Presses nodes of the lower face of the first body off the middle of the upper face of the second, upwards."""

    kind: Literal["rest"] = "rest"


class NearSpec(InterfaceSpec):
    """As `rest`, of nodes alone that are within a millimetre of the face."""

    kind: Literal["near"] = "near"


class Spring:
    """One row of the means of two faces."""

    def __init__(self, spec: InterfaceSpec, a: Meeting, b: Meeting) -> None:
        self.spec = spec
        z_a, z_b = a.x_rest[:, 2], b.x_rest[:, 2]
        faces = (z_a < z_a.min() + 1e-9) & ~a.fixed, (z_b > z_b.max() - 1e-9) & ~b.fixed
        nodes = [np.flatnonzero(face).astype(np.int32) for face in faces]
        self.nodes = nodes[0], nodes[1]
        self.n_steps = np.zeros(1)

    def rows(self, x: tuple[Floats, Floats], dt: float) -> Rows:
        assert isinstance(self.spec, SpringSpec)
        a, b = (np.full((1, len(nodes)), 1.0 / len(nodes)) for nodes in self.nodes)
        return Rows((a, b), np.zeros((1, 3)), compliance=np.array([1.0 / self.spec.stiffness]))

    def commit(self, x: tuple[Floats, Floats], multipliers: Floats, dt: float) -> None:
        self.n_steps = self.n_steps + 1.0

    def save(self) -> dict[str, Floats]:
        return {"n_steps": self.n_steps}

    def load(self, arrays: Mapping[str, Floats]) -> None:
        self.n_steps = np.array(arrays["n_steps"])


class Rest(Spring):
    """A row a node, which presses upwards."""

    def rows(self, x: tuple[Floats, Floats], dt: float) -> Rows:
        n_a, n_b = (len(nodes) for nodes in self.nodes)
        weights = np.eye(n_a), np.full((n_a, n_b), 1.0 / n_b)
        return Rows(weights, np.zeros((n_a, 3)), normal=np.tile([0.0, 0.0, 1.0], (n_a, 1)))


class Near(Rest):
    """Its rows come and go."""

    def rows(self, x: tuple[Floats, Floats], dt: float) -> Rows:
        every = super().rows(x, dt)
        above = x[0][:, 2] - x[1][:, 2].mean()
        near = np.flatnonzero(above < 1e-3)
        weights = every.weights[0][near], every.weights[1][near]
        return Rows(weights, every.offset[near], normal=every.normal[near], ids=10 + 7 * near)


def add() -> None:
    """Add the rows to the tables."""
    for name, spec, kind in (("spring", SpringSpec, Spring), ("rest", RestSpec, Rest), ("near", NearSpec, Near)):
        INTERFACES.add(name, spec)
        KINDS.add(name, kind)


def remove() -> None:
    """Take them out again."""
    for name in ("spring", "rest", "near"):
        INTERFACES.remove(name)
        KINDS.remove(name)


@contextmanager
def added() -> Iterator[None]:
    """The tables with these rows."""
    add()
    try:
        yield
    finally:
        remove()


def tower(models: tuple[str, ...], lift: float = 0.0, interface: Mapping[str, Any] | None = None, **keys: Any) -> Scene:
    """Cubes one above the other on a table, the lowest first, each above the one below by `lift` [m]; and tell of
    what is between each two, as one that rests on the other by default."""
    between = interface or {"kind": "rest"}
    names = [f"cube{i}" for i in range(len(models))]
    bodies = {
        name: {
            "shape": {"kind": "block", "size": [EDGE] * 3},
            "cell": EDGE / 2,
            "position": [0, 0, place * (EDGE + lift)],
            "regions": {"default": model},
            "material": {"young": 2e5, "poisson": 0.3, "density": DENSITY, "retardation_time": 0.01},
        }
        for place, (name, model) in enumerate(zip(names, models, strict=True))
    }
    pairs = zip(names[1:], names[:-1], strict=True)
    data = {
        "softseam": 1,
        "name": "tower",
        "step": 0.005,
        "duration": 0.8,
        "bodies": bodies,
        "tools": {"table": {"kind": "plane", "friction": 0.5}},
        "interfaces": {f"on_{below}": {**between, "between": [upper, below]} for upper, below in pairs},
    }
    return Scene.model_validate(json.loads(json.dumps(data | keys)))
