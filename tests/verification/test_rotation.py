"""Angular momentum changes by the torques of contact alone: bodies that spin, in every model, and how far they turn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray

from softseam_protocol.scene.kinds import IntegratorKind
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]
SIZE = (0.1, 0.05, 0.025)


def bar(spin: tuple[float, float, float], step: float, **keys: Any) -> Scene:
    """A bar of gel that nothing touches or draws, high above a floor."""
    body = {"spin": spin, "position": (0.0, 0.0, 0.5)}
    return block(SIZE, 0.025, 2e5, 0.4, 1e3, gravity=(0.0, 0.0, 0.0), step=step, body=body, **keys)


def by_integrator(scene: Scene, integrator: IntegratorKind) -> Scene:
    fem = scene.models.fem.model_copy(update={"integrator": integrator})
    return scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})})


class Spin:
    """What of a rotation is seen step by step: momentum about the centre, and how far the body turned about z."""

    def __init__(self, mass: Floats, x: Floats, v: Floats) -> None:
        self._mass, self._rest = mass, x - mass @ x / mass.sum()
        self.angle, self._last = 0.0, 0.0
        self.start = self.momentum(x, v)

    def momentum(self, x: Floats, v: Floats) -> Floats:
        arms = x - self._mass @ x / self._mass.sum()
        return self._mass @ np.cross(arms, v)

    def inertia(self, x: Floats) -> float:
        """About z [kg m^2]."""
        arms = x - self._mass @ x / self._mass.sum()
        return float(self._mass @ (arms[:, :2] ** 2).sum(axis=1))

    def see(self, x: Floats) -> None:
        """Add what it turned by since it was seen last, by less than half a turn."""
        arms, rest = x - self._mass @ x / self._mass.sum(), self._rest
        sine = self._mass @ (arms[:, 1] * rest[:, 0] - arms[:, 0] * rest[:, 1])
        cosine = self._mass @ (arms[:, :2] * rest[:, :2]).sum(axis=1)
        angle = float(np.arctan2(sine, cosine))
        self.angle += (angle - self._last + np.pi) % (2.0 * np.pi) - np.pi
        self._last = angle

    def lost(self, x: Floats, v: Floats) -> float:
        """Of the momentum [1]."""
        return float(np.linalg.norm(self.momentum(x, v) - self.start) / np.linalg.norm(self.start))


@pytest.mark.parametrize("step", [0.002, 0.01, 0.02])
@pytest.mark.parametrize("rate", [3.0, 12.0, 40.0])
def test_a_free_bar_keeps_its_spin_by_fem(rate: float, step: float) -> None:
    """Momentum to 1e-6 a second, and the angle to .2 % of that of its spin over its inertia, as stretched as it is."""
    run = FemRun(bar((0.0, 0.0, rate), step))
    spin = Spin(run.solver._parameters.mass, run.x, run.solver.state.v)
    time, expected = 0.4 if step < 0.01 else 2.0, 0.0
    for _ in range(round(time / step)):
        before = spin.inertia(run.x)
        run.step()
        spin.see(run.x)
        expected += step * float(spin.start[2]) * 0.5 * (1.0 / before + 1.0 / spin.inertia(run.x))
    assert spin.lost(run.x, run.solver.state.v) < 1e-6 * time
    assert spin.angle == pytest.approx(expected, rel=2e-3)
    assert spin.angle == pytest.approx(rate * time, rel=2e-2)
