"""A model from outside, with its own name, in a process of its own: masses on springs fall in a box and come to rest.

`mass_springs.py` beside this is all that its author writes: the physics of a part, and the row of the model.
"""

from __future__ import annotations

from typing import Any

import mass_springs
import numpy as np
import pytest
import test_discretisation as grains
from extended_services import added
from mass_springs import MassSprings

import softseam
from softseam_protocol.messages.participant import Configure, Configured
from softseam_protocol.participant.part_solver import PartSolver
from softseam_protocol.scene.scene import Scene
from softseam_services.built import Built
from softseam_services.server import Setup
from softseam_services.solver_row import SolverRow
from softseam_services.solvers import SOLVERS

EDGE, FALL, DENSITY, STEP = 0.03, 0.003, 1000.0, 5e-3
WEIGHT = 9.81 * DENSITY * EDGE**3
WALLS = {"left": (-1, 0), "right": (1, 0), "front": (0, -1), "back": (0, 1)}


def build(setup: Setup, request: Configure, built: Built) -> tuple[PartSolver, Configured]:
    """In this process, where no service is asked."""
    solver = PartSolver(MassSprings(request), request)
    return solver, solver.configured(request.header)


ROWS = (*mass_springs.ROWS, (SOLVERS, "springs", SolverRow(build)))


def scene() -> Scene:
    """A soft cube of one cell, 3 mm above the ground, between walls that it does not reach; drag stills it."""
    walls = {
        name: {"kind": "plane", "point": [0.6 * EDGE * x, 0.6 * EDGE * y, 0], "normal": [-x, -y, 0]}
        for name, (x, y) in WALLS.items()
    }
    body = {
        "shape": {"kind": "block", "size": [EDGE] * 3},
        "cell": EDGE,
        "position": [0, 0, FALL],
        "material": {"young": 5e3, "poisson": 0.3, "density": DENSITY},
        "damping": 40.0,
    }
    data: dict[str, Any] = {"softseam": 1, "name": "falls", "step": STEP, "duration": 0.5, "body": body}
    return Scene.model_validate(
        data | {"tools": {"ground": {"kind": "plane"}, **walls}, "regions": {"default": "springs"}}
    )


def test_it_comes_to_rest_under_its_own_name() -> None:
    """The ground carries its weight to 1 %: swings fade with half the drag, exp(-20 t), to 1e-4 in .46 s."""
    with softseam.open(scene()) as sim:
        seen = sim.run(fields=True)
    assert seen.wrench["ground"][2] == pytest.approx(-WEIGHT, rel=0.01)
    assert max(np.abs(seen.wrench[name]).max() for name in WALLS) == 0.0
    assert seen.positions[:, 2].min() > -0.1 * FALL and seen.momentum[2] == pytest.approx(0.0, abs=1e-4 * WEIGHT)
    assert {part.model for part in seen.parts.values()} == {"springs"} and seen.seconds["springs"] > 0.0


def test_a_snapshot_of_it_goes_on_with_the_same_bits() -> None:
    with softseam.open(scene()) as sim:
        sim.run(max_steps=10)
        kept = sim.snapshot()
        after = [sim.step().positions for _ in range(5)]
        sim.restore(kept)
        np.testing.assert_array_equal([sim.step().positions for _ in range(5)], after)


def test_it_moves_points_without_cells() -> None:
    """The ground carries the weight of grains that fall, to 1e-6, and they sink in by as much as they are to."""
    with added(grains), softseam.open(grains.scene(regions={"default": "springs"})) as sim:
        seen = sim.run(fields=True)
    assert seen.wrench["ground"][2] == pytest.approx(-grains.WEIGHT, rel=1e-6)
    np.testing.assert_allclose(seen.positions[:, 2], grains.RADIUS * (1.0 - mass_springs.SUNK), rtol=1e-6)
