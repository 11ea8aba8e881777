"""Rungs from outside: a block that turns and swings has 2^3 cells, then 4^3, then 2^3 again.

A rung says when a body is on it, what the body is there, and what carries over: here what is interpolated, with a rigid
motion more, so that neither momentum changes. The midpoint rule keeps both to rounding in its own steps, too.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from pydantic import Field

import softseam
from softseam_coupling import ladder
from softseam_protocol.scene.ladder import RUNGS, RungSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Positive

EDGE, STEP, UP, DOWN, STEPS = 0.04, 2e-3, 10, 25, 40  # it goes up and down after so many steps


def interpolated(x_rest: Any, values: Any, at: Any) -> Any:
    """Values of a lattice's nodes at other places, linear between them."""
    from scipy.interpolate import RegularGridInterpolator  # services that import this module need it where it climbs

    lines = [np.unique(along.round(9)) for along in x_rest.T]
    order = np.lexsort(x_rest.round(9).T[::-1])
    grid = values[order].reshape(*(len(line) for line in lines), 3)
    return RegularGridInterpolator(lines, grid)(np.clip(at, x_rest.min(axis=0), x_rest.max(axis=0)).round(9))


def momenta(mass: Any, x: Any, v: Any) -> Any:
    return np.r_[mass @ v, mass @ np.cross(x, v)]


class CellsSpec(RungSpec):
    kind: Literal["cells"] = "cells"
    cell: Positive = Field(description="edge [m]")
    during: tuple[float, float] = Field(description="from when until when the body is on it [s]")


class Cells:
    def __init__(self, spec: CellsSpec) -> None:
        self.spec = spec

    def holds(self, body: ladder.Standing) -> bool:
        """Whether the body is to be on this rung in the step that begins."""
        return self.spec.during[0] <= body.time + 1e-9 < self.spec.during[1]

    def body(self, spec: Any) -> Any:
        """What the body is on it, of what the scene says of the body."""
        return spec.model_copy(update={"cell": self.spec.cell})

    def carry(self, old: ladder.Discretised, new: ladder.Discretised) -> tuple[Any, Any]:
        """Positions and velocities on this rung (N, 3)."""
        x, v = (interpolated(old.x_rest, values, new.x_rest) for values in (old.x, old.v))
        middle, eye = new.mass @ x / new.mass.sum(), np.eye(3)
        rigid = [*(np.tile(axis, (len(x), 1)) for axis in eye), *(np.cross(axis, x - middle) for axis in eye)]
        lacks = momenta(old.mass, old.x, old.v) - momenta(new.mass, x, v)
        share = np.linalg.solve(np.transpose([momenta(new.mass, x, motion) for motion in rigid]), lacks)
        return x, v + np.tensordot(share, rigid, axes=1)


ROWS = ((RUNGS, "cells", CellsSpec), (ladder.RUNGS, "cells", Cells))


def scene() -> Scene:
    """A soft block that flies and turns so fast that it stretches by some percent."""
    always = {"kind": "cells", "cell": EDGE / 2, "during": [0.0, 1.0]}
    for_a_while = {"kind": "cells", "cell": EDGE / 4, "during": [UP * STEP, DOWN * STEP]}
    body = {
        "shape": {"kind": "block", "size": [EDGE] * 3},
        "material": {"young": 5e3, "poisson": 0.3, "density": 1000.0},
        "velocity": [0.1, 0.2, -0.1],
        "spin": [6.0, -10.0, 16.0],
        "ladder": [always, for_a_while],
    }
    data = {"softseam": 1, "name": "rungs", "gravity": [0, 0, 0], "step": STEP, "duration": STEPS * STEP, "body": body}
    fem = {"integrator": "midpoint", "tolerance": 1e-12}
    return Scene.model_validate(data | {"regions": {"default": "fem"}, "models": {"fem": fem}})


def test_momenta_are_kept_and_the_energy_is_booked() -> None:
    """Both momenta to 1e-12 over the run; energies change by switch - dissipation, which is no larger in a switch."""
    with softseam.open(scene()) as sim:
        seen = [sim.run(fields=True, max_steps=1) for _ in range(STEPS)]
    lines = np.array([round(len(one.positions) ** (1 / 3)) for one in seen])
    np.testing.assert_array_equal(lines, np.repeat([5, 9, 5], [UP, DOWN - UP, STEPS - DOWN]))
    for name in ("momentum", "angular_momentum"):
        values = np.array([getattr(one, name) for one in seen])
        assert np.abs(values - values[0]).max() < 1e-12 * np.linalg.norm(values[0])
    stored = np.array([sum(one.energies[name] for name in ("kinetic", "strain", "gravity")) for one in seen])
    switch, lost = (np.array([one.energies[name] for one in seen]) for name in ("switch", "dissipation"))
    np.testing.assert_array_equal(np.flatnonzero(switch), [UP, DOWN])
    np.testing.assert_allclose(np.diff(stored), (switch - lost)[1:], rtol=0.0, atol=1e-12 * stored[0])
    others = np.abs(np.delete(lost, [0, UP, DOWN])).max()
    assert np.abs(lost[[UP, DOWN]]).max() < 2.0 * others < np.abs(switch).max()


@pytest.mark.parametrize("at", [UP - 3, UP, UP + 3, DOWN])
def test_a_snapshot_knows_its_rung(at: int) -> None:
    """Taken on either rung and where they change, and restored from the end of the run: the same bits."""
    with softseam.open(scene()) as sim:
        sim.run(max_steps=at)
        kept = sim.snapshot()
        after = [sim.run(fields=True, max_steps=1) for _ in range(STEPS - at)]
        sim.restore(kept)
        again = [sim.run(fields=True, max_steps=1) for _ in range(STEPS - at)]
    for one, other in zip(after, again, strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
        assert one.energies == other.energies
