"""A discretisation from outside: grains, points without cells, that fall on the ground; XPBD moves them.

A body kind has a row that a scene reads, and one by which services build its points, their masses and its surface.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from pydantic import Field

import softseam
from softseam_protocol.scene.bodies import BODIES
from softseam_protocol.scene.regions import OwnRegions
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import NonNegative, Positive, Vector
from softseam_services.bodies import DISCRETISATIONS, Points, Surface

RADIUS, DENSITY, SPACING = 0.005, 1000.0, 0.0105
WEIGHT = 27 * 9.81 * DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
CORNERS = np.concatenate([np.eye(3), -np.eye(3)])  # of an octahedron
FACES = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])


class GrainsBody(OwnRegions):
    """Balls on a lattice; they press on tools, and not yet on one another."""

    kind: Literal["grains"] = "grains"
    count: tuple[int, int, int] = Field(description="along x, y and z")
    spacing: Positive = Field(description="of the lattice [m]")
    radius: Positive = Field(description="[m]")
    density: Positive = Field(description="of a ball [kg/m^3]")
    position: Vector = Field(description="middle of the lowest layer [m]")
    damping: NonNegative = Field(default=0.0, description="drag of still air: force over mass and velocity [1/s]")


def build(spec: GrainsBody, files: Any) -> Points:
    lattice = np.indices(spec.count).reshape(3, -1).T * spec.spacing
    x = lattice - lattice.mean(axis=0) * (1, 1, 0) + spec.position
    x[:, :2] += 1e-4 * np.random.default_rng(3).standard_normal((len(x), 2))  # columns that do not stand by chance
    own, offset = np.arange(len(x)), np.tile(spec.radius * CORNERS, (len(x), 1))
    surface = Surface(own.repeat(6), offset, (FACES + 6 * own[:, None, None]).reshape(-1, 3))
    mass = np.full(len(x), spec.density * 4.0 / 3.0 * np.pi * spec.radius**3)
    return Points(x_rest=x, mass=mass, surface=surface, damping=spec.damping)


ROWS = ((BODIES, "grains", GrainsBody), (DISCRETISATIONS, "grains", build))


def scene(**changes: Any) -> Scene:
    """A layer of 27 balls, 2 mm above the ground, between walls that they do not reach."""
    body = {"kind": "grains", "count": [9, 3, 1], "spacing": SPACING, "radius": RADIUS, "density": DENSITY}
    body |= {"position": [0, 0, RADIUS + 0.002], "damping": 40.0}
    tools: dict[str, Any] = {"ground": {"kind": "plane"}}
    for name, x, y in (("left", -1, 0), ("right", 1, 0), ("front", 0, -1), ("back", 0, 1)):
        tools[name] = {"kind": "plane", "point": [0.06 * x, 0.06 * y, 0], "normal": [-x, -y, 0]}
    data = {"softseam": 1, "name": "balls", "step": 5e-3, "duration": 1.0, "body": body, "tools": tools}
    return Scene.model_validate(data | changes)


def test_grains_are_weighed() -> None:
    """The ground carries their weight to 1 %: motion fades as exp(-20 t)."""
    with softseam.open(scene()) as sim:
        seen = sim.run(fields=True)
    assert seen.wrench["ground"][2] == pytest.approx(-WEIGHT, rel=0.01)
    apart = np.linalg.norm(seen.positions[:, None] - seen.positions, axis=2)[np.triu_indices(27, 1)]
    assert apart.min() > 1.8 * RADIUS and seen.positions[:, 2].min() > 0.9 * RADIUS


def test_restored_grains_fall_with_the_same_bits() -> None:
    with softseam.open(scene()) as sim:
        sim.run(max_steps=20)
        kept = sim.snapshot()
        after = [sim.step().positions for _ in range(5)]
        sim.restore(kept)
        np.testing.assert_array_equal([sim.step().positions for _ in range(5)], after)


NEAR = {"regions": {"default": "pbd", "near": {"model": "fem", "within": 0.01}}}
FOR_CELLS = [{"regions": {"default": "fem"}}, NEAR, {"quantities": ["peak_von_mises"]}, {"probes": {"a": [0, 0, 0.01]}}]


@pytest.mark.parametrize("changes", FOR_CELLS)
def test_what_needs_cells_is_refused_by_name(changes: dict[str, Any]) -> None:
    with pytest.raises((softseam.SceneRefused, ValueError), match=r"grains.* no cells"):
        softseam.open(scene(**changes))
