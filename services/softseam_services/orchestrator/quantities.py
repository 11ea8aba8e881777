"""The quantities of interest of a step, from the participants' replies."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages import Advanced, Frame
from softseam_protocol.scene import OF_PARTICLES
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.indicators import MEASURED, summarise
from softseam_services.orchestrator.program import Program
from softseam_services.orchestrator.stress import von_mises

Floats = NDArray[np.float64]

NEEDS_FIELDS = frozenset({"peak_von_mises", "tip_deflection"}) | MEASURED
"""quantities that cost a look at the fields"""


class Quantities:
    """Measures a body in its tools' hands."""

    def __init__(self, body: AnyBody, program: Program, wanted: Collection[str]) -> None:
        self._program = program
        self._wants_tip = "tip_deflection" in wanted
        low, high = body.x_rest.min(axis=0), body.x_rest.max(axis=0)
        self._top = float(high[2])
        self._bottom = float(low[2])
        self._weight = float(body.total_mass * np.linalg.norm(body.gravity))
        centre = 0.5 * (low + high)
        clamped = body.x_rest[body.fixed]
        away = np.array([1.0, 0.0, 0.0])
        if len(clamped):
            away = centre - clamped.mean(axis=0)
        far_end = body.x_rest @ away
        end = np.flatnonzero(far_end >= far_end.max() - 1e-9 * np.ptp(far_end))
        middle = body.x_rest[end].mean(axis=0)
        self._tip = int(end[np.argmin(np.linalg.norm(body.x_rest[end] - middle, axis=1))])
        self._tip_rest = body.x_rest[self._tip, 2]

    def grip_force(self, wrench: Floats, orientation: Floats) -> float:
        """Mean force of the body on the gripping tools along the line between them [N]; orientations (t, 4)."""
        grip = self._program.grip
        return 0.0 if grip is None else grip.force(wrench, orientation)

    def height(self, replies: Mapping[str, Advanced]) -> float:
        """How far the centre of mass rose since rest, against gravity [m]; without gravity, the lowest point."""
        if self._weight > 0.0:
            return sum(reply.gravity for reply in replies.values()) / self._weight
        return min(float(reply.bounds[0, 2]) for reply in replies.values()) - self._bottom

    def measure(
        self,
        replies: Mapping[str, Advanced],
        grip_force: float,
        position: Floats,
        orientation: Floats,
        frame: Frame | None,
        rise: float,
    ) -> dict[str, float]:
        """All quantities of the step; those that need fields only where there is a frame.

        grip_force  [N]
        position, orientation  of the tools (t, 3) [m], (t, 4)
        rise        height above where the lift began [m]
        """
        low, high, slip = math.inf, -math.inf, -math.inf
        for reply in replies.values():
            low, high = min(reply.bounds.item(2), low), max(reply.bounds.item(5), high)
            slip = max(reply.slip, slip)
        found = {
            "grip_force": grip_force,
            "lift_height": rise,
            "slip": slip,
            "sag": (self._top - self._bottom) - (high - low),
            "compression": max(0.0, self._program.compression(position, orientation)),
        }
        for reply in replies.values():
            if reply.particles is not None:
                found.update({name: float(getattr(reply.particles, name)) for name in OF_PARTICLES})
        if frame is not None:
            if len(frame.cauchy):
                found["peak_von_mises"] = float(von_mises(frame.cauchy).max())
            if frame.indicators is not None:
                strain = sum(reply.strain for reply in replies.values())
                found.update(summarise(frame.indicators, strain))
            if self._wants_tip:
                found["tip_deflection"] = float(frame.x[self._tip, 2] - self._tip_rest)
        return found
