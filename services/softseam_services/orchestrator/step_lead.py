"""How far implicit Euler carries a body ahead of its time, that gathers speed evenly: falls, slides or rolls.

From a speed v0, n steps h with the acceleration a end n h v0 + a h^2 n (n + 1)/2 farther, with v = v0 + n h a, which is
    ahead = h (v - v0)/2                                                                                       (1)
beyond the way in t = n h, h/t of it from rest; the speed is right. (It is the sum of h (v0 + k h a), k = 1 ... n.)
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Advanced
from softseam_protocol.models import some_read
from softseam_services.server import Setup

Floats = NDArray[np.float64]

_LIMIT = 0.02
"""of its way, by which steps may carry a body ahead unsaid [1]"""
_EVEN = 0.1
"""of its way, by which that of a body that gathers speed evenly is off what its speeds say [1]"""


class StepLead:
    """Of one body, in steps of h [s] since a run began; only of whole ones of FEM that nothing clamps."""

    def __init__(self, setup: Setup, h: float) -> None:
        fem, regions, body = setup.scene.models.fem, setup.scene.regions, setup.body
        default = fem.integrator == "implicit_euler" and fem.step_error is None and not regions.cut
        free = body.has_cells and not body.fixed.any()
        self._watches = default and free and some_read([regions.default], "fem.integrator")
        self._step, self._mass, self._begun = h, body.total_mass, np.zeros(3)
        if self._watches and body.has_cells:
            cell_begun = body.cell_mass[:, :, None] * body.v_initial[body.cell_nodes]
            self._begun = cell_begun.sum(axis=(0, 1)) / self._mass
        self.forget()

    def forget(self) -> None:
        """The last step is another's: of a run that began elsewhere nothing is known."""
        self._known, self._n_steps = False, 0
        self._way, self._speed = np.zeros(3), self._begun

    def start(self) -> None:
        """A run begins."""
        self.forget()
        self._known = self._watches

    def follow(self, replies: Mapping[str, Advanced]) -> None:
        """A step was taken."""
        if not self._known:
            return
        self._speed = sum((np.array(reply.momentum) for reply in replies.values()), start=np.zeros(3)) / self._mass
        self._way += self._step * self._speed
        self._n_steps += 1

    def said(self) -> str:
        """By how much steps carried it ahead; '' where that is little, where it gathered speed unevenly, or where
        nothing is known of it."""
        gathered: Floats = self._speed - self._begun
        gain = float(np.linalg.norm(gathered))
        if not self._known or gain == 0.0:
            return ""
        along = gathered / gain
        ahead = 0.5 * self._step * gain  # eq. (1)
        way = float(self._way @ along)
        even = self._n_steps * self._step * (float(self._begun @ along) + 0.5 * gain) + ahead
        if ahead <= _LIMIT * abs(way) or abs(even - way) > _EVEN * abs(way):
            return ""
        share = 100.0 * ahead / abs(way)
        return (
            f"as it gathers speed, steps carried it {1e3 * ahead:.2g} mm ahead, {share:.2g} % of its way; shorten the "
            "step, or take models.fem: {integrator: bdf2}"
        )
