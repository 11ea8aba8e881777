"""What steps damp of a motion that nothing damps: of a bounce, and of swings that no tool touched.

A body that comes with the kinetic energy K and touches tools that stand still loses of it what steps dissipate until it
is free again, or at rest: where that is more than a twentieth of K, it comes back too slowly, and a shorter step
changes that. It is told of bodies that come as fast as from a fall over a tenth of their length, not of those that are
put down, and of none that are viscous or dragged, whose loss is their own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.bounces import follow_bounces
from softseam_protocol.models import some_read
from softseam_protocol.scene.models import DampingSpec
from softseam_protocol.scene.scene import EARTH
from softseam_services.server import Setup

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

LIMIT = 0.05
"""of an energy that steps may damp unsaid [1]"""
_FALL = 0.1
"""of the body's length, over which it would fall to come so fast [1]"""
_REST = 0.01
"""of the energy that it came with, below which a body is at rest [1]"""


class StepLosses:
    """Of b bodies; what is said of each is about the run so far."""

    def __init__(self, setups: Sequence[Setup]) -> None:
        self._least = np.array([_falling(setup) for setup in setups])
        self._watched = np.array([_loses_by_steps(setup) for setup in setups], dtype=np.bool_)
        self._may_lose = bool(self._watched.any())
        self._takes_substeps = [some_read([setup.scene.regions.default], "pbd.substeps") for setup in setups]
        self.forget()

    @property
    def watches(self) -> bool:
        """Whether steps may come to anything that is to be said."""
        return self._may_lose

    def forget(self) -> None:
        """The last step is another's."""
        self.state: Floats = np.zeros((8, len(self._least)))
        """all that evolves, a column a body: energies as each was free last, as it came, and lost since, the largest
        that moved or was strained, and what steps took [J]; the worst share of a bounce [1]; 1 for bodies that tools
        have touched, and for those that they touch"""
        self._shares = np.zeros(len(self._least))

    def follow(self, step: Floats, touches: Mask) -> dict[int, str]:
        """A step was taken by all, with these energies, kinetic and of strain, this dissipation, and what tools that
        touched each put in (4, b) [J]; which of them tools touched (b,). What is to be said of bounces that ended in
        it, by the place of the body."""
        shares = self._shares
        if not follow_bounces(self.state, step, touches, self._least, self._watched, LIMIT, _REST, shares):
            return {}
        return {place: f"{self._said(place)}; {self._advice(place)}" for place in np.flatnonzero(shares).tolist()}

    def _said(self, place: int) -> str:
        """Of the worst bounce of a body, '' for none."""
        worst = float(self.state[5, place])
        if worst == 0.0:
            return ""
        return f"steps took {100.0 * min(worst, 1.0):.0f} % of the energy with which it hit: it bounces too little"

    def swings(self, place: int = 0) -> str:
        """That steps took much of what no tool touched; '' where they did not."""
        _, _, _, largest, taken, _, touched, _ = self.state[:, place].tolist()
        if touched or not self._watched[place] or taken <= LIMIT * largest:
            return ""
        share = 100.0 * taken / largest
        most = f"steps took {share:.0f} % of the most that moved or was strained, which no tool touched"
        return f"{most}; {self._advice(place)}"

    def said(self, place: int = 0) -> str:
        """The worst of both."""
        return self._said(place) or self.swings(place)

    def _advice(self, place: int) -> str:
        if self._takes_substeps[place]:
            return "take more models.pbd.substeps"  # that are `auto` are as long in shorter steps
        return "shorten the step, take regions: {default: pbd}, or models.fem: {integrator: midpoint, radius: 0.9}"


def _falling(setup: Setup) -> float:
    """Energy with which a body comes fast [J]."""
    return _FALL * EARTH * setup.body.total_mass * float(np.ptp(setup.body.x_rest, axis=0).max())


def _loses_by_steps(setup: Setup) -> bool:
    """Whether a loss would be the steps', not the body's own."""
    spec, models = setup.spec, setup.scene.models
    viscous = any(material.retardation_time > 0.0 for material in spec.cell_materials)
    damped = viscous or spec.said("damping", 0.0) > 0.0 or models.pbd.damping != DampingSpec()
    return not damped and models.fem.integrator != "static"
