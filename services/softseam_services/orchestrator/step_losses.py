"""What steps damp of a motion that nothing damps: of a bounce, and of swings that no tool touched.

A body that comes with the kinetic energy K and touches tools that stand still loses of it what steps dissipate until it
is free again, or at rest: where that is more than a twentieth of K, it comes back too slowly, and a shorter step
changes that. It is told of bodies that come as fast as from a fall over a tenth of their length, not of those that are
put down, and of none that are viscous or dragged, whose loss is their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.models import some_read
from softseam_protocol.scene.models import DampingSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import AnyBody

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

LIMIT = 0.05
"""of an energy that steps may damp unsaid [1]"""
_FALL = 0.1
"""of the body's length, over which it would fall to come so fast [1]"""
_G = 9.81
"""[m/s^2]"""
_REST = 0.01
"""of the energy that it came with, below which a body is at rest [1]"""


class StepLosses:
    """Of one body; what is said is about the run so far."""

    def __init__(self, scene: Scene, body: AnyBody) -> None:
        mass = body.total_mass
        self._least = _FALL * _G * mass * float(np.ptp(body.x_rest, axis=0).max())
        spec = scene.body
        own = any(material.retardation_time > 0.0 for material in spec.cell_materials)
        self._damped = own or spec.said("damping", 0.0) > 0.0 or scene.models.pbd.damping != DampingSpec()
        self._static = scene.models.fem.integrator == "static"
        self._takes_substeps = some_read([scene.regions.default], "pbd.substeps")
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._free, self._came, self._lost = 0.0, 0.0, 0.0
        self._touched = self._touches = False
        self._largest = self._taken = self._worst = 0.0

    def follow(self, energy: Mapping[str, float], touches: bool, drive_work: float) -> str:
        """A step was taken, with this ledger [J], in which tools that touched the body, or none, put this in [J]; what
        is to be told of a bounce that ended in it, '' for nothing."""
        if self._damped or self._static:
            return ""
        kinetic, dissipation = energy["kinetic"], energy["dissipation"]
        self._touched = self._touched or touches
        self._taken += dissipation
        self._largest = max(self._largest, kinetic + energy["strain"])
        told = ""
        if touches:
            if not self._touches:
                self._came, self._lost = self._free if self._free > self._least else 0.0, 0.0
            self._lost += dissipation
            if drive_work != 0.0:
                self._came = 0.0
        if self._came > 0.0 and (not touches or kinetic < _REST * self._came):
            told, self._came = self._tell(self._lost / self._came), 0.0
        if not touches:
            self._free = kinetic
        self._touches = touches
        return told

    def _tell(self, share: float) -> str:
        if share <= max(LIMIT, self._worst):
            return ""
        self._worst = share
        return self.last

    @property
    def said(self) -> str:
        """Of the worst bounce, '' for none."""
        if self._worst == 0.0:
            return ""
        share = 100.0 * min(self._worst, 1.0)
        return f"steps took {share:.0f} % of the energy with which it hit: it bounces too little"

    @property
    def last(self) -> str:
        """The same, with a remedy."""
        return f"{self.said}; {self._advice}"

    @property
    def watches(self) -> bool:
        """Whether a loss would be the steps', not the body's own."""
        return not (self._damped or self._static)

    @property
    def least(self) -> float:
        """Energy with which it comes fast [J]."""
        return self._least

    def to_list(self) -> list[float]:
        """All that evolves, as `take` reads it."""
        bounce = [self._free, self._came, self._lost, float(self._touched), float(self._touches)]
        return [*bounce, self._largest, self._taken, self._worst]

    def take(self, numbers: list[float]) -> None:
        """Continue from `to_list`."""
        self._free, self._came, self._lost, touched, touches, self._largest, self._taken, self._worst = numbers
        self._touched, self._touches = touched != 0.0, touches != 0.0

    @property
    def swings(self) -> str:
        """That steps took much of what no tool touched; '' where they did not."""
        if self._touched or self._damped or self._static or self._taken <= LIMIT * self._largest:
            return ""
        share = 100.0 * self._taken / self._largest
        return f"steps took {share:.0f} % of the most that moved or was strained, which no tool touched; {self._advice}"

    @property
    def _advice(self) -> str:
        if self._takes_substeps:
            return "take more models.pbd.substeps"  # that are `auto` are as long in shorter steps
        return "shorten the step, take regions: {default: pbd}, or models.fem: {integrator: midpoint, radius: 0.9}"


class ManyStepLosses:
    """The same of many bodies at once, in arrays of b: what evolves is theirs again after `store`."""

    def __init__(self, each: Sequence[StepLosses]) -> None:
        self._each = each
        self._watches = np.array([one.watches for one in each], dtype=np.bool_)
        self._least = np.array([one.least for one in each])
        self.load()

    def load(self) -> None:
        """Go on from what each has seen."""
        numbers = np.array([one.to_list() for one in self._each]).T
        self._free, self._came, self._lost, touched, touches, self._largest, self._taken, self._worst = numbers.copy()
        self._touched, self._touches = touched != 0.0, touches != 0.0

    def store(self) -> None:
        """Have each know what it has seen."""
        rows = (self._free, self._came, self._lost, self._touched, self._touches, self._largest, self._taken)
        for one, numbers in zip(self._each, np.array([*rows, self._worst], dtype=np.float64).T.tolist(), strict=True):
            one.take(numbers)

    def follow(
        self, kinetic: Floats, strain: Floats, dissipation: Floats, touches: Mask, drive_work: Floats
    ) -> dict[int, str]:
        """A step was taken by all, see `StepLosses.follow`; what is to be said, by the place of the body."""
        self._touched |= touches
        self._taken += dissipation
        np.maximum(self._largest, kinetic + strain, out=self._largest)
        begins = touches & ~self._touches
        self._came[begins] = np.where(self._free > self._least, self._free, 0.0)[begins]
        self._lost[begins] = 0.0
        self._lost += np.where(touches, dissipation, 0.0)
        self._came[touches & (drive_work != 0.0)] = 0.0
        ends = (self._came > 0.0) & (~touches | (kinetic < _REST * self._came)) & self._watches
        said = {}
        for place in np.flatnonzero(ends).tolist():
            share = float(self._lost[place] / self._came[place])
            self._came[place] = 0.0
            if share > max(LIMIT, self._worst[place]):
                self._worst[place] = share
                self.store()
                said[place] = self._each[place].last
        self._free = np.where(touches, self._free, kinetic)
        self._touches = touches.copy()
        return said
