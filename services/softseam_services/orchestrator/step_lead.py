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


class StepLead:
    """Of one body, in steps of h [s] since a run began; only of whole ones of FEM that nothing clamps."""

    def __init__(self, setup: Setup, h: float) -> None:
        fem, regions, body = setup.scene.models.fem, setup.scene.regions, setup.body
        default = fem.integrator == "implicit_euler" and fem.step_error is None and not regions.cut
        free = body.has_cells and not body.fixed.any()
        self._watches = default and free and some_read([regions.default], "fem.integrator")
        self._step, self._mass, self._begun = h, body.total_mass, np.zeros(3)
        self._unseen = 0.0
        if self._watches and body.has_cells:
            self._begun = np.einsum("cn,cni->i", body.cell_mass, body.v_initial[body.cell_nodes]) / self._mass
            self._unseen = fem.tolerance * body.resolution  # what Newton's method leaves open
        self.forget()

    def forget(self) -> None:
        """The last step is another's: of a run that began elsewhere nothing is known."""
        self._known, self._n_steps = False, 0
        self._momenta, self._last = np.zeros(3), np.zeros(3)
        """sum over steps, and in the last one [kg m/s]"""

    def start(self) -> None:
        """A run begins."""
        self.forget()
        self._known = self._watches

    def follow(self, replies: Mapping[str, Advanced]) -> None:
        """A step was taken."""
        if self._known:
            for whole in replies.values():
                self._last = whole.momentum
                np.add(self._momenta, self._last, out=self._momenta)
                self._n_steps += 1

    def said(self) -> str:
        """By how much steps carried it ahead; '' where that is little, or less than what its way is off that of an even
        acceleration, or where nothing is known of it."""
        gathered: Floats = np.array(self._last) / self._mass - self._begun
        gain = float(np.linalg.norm(gathered))
        ahead = 0.5 * self._step * gain  # eq. (1)
        if not self._known or ahead <= self._unseen:
            return ""
        along = gathered / gain
        way = self._step / self._mass * float(self._momenta @ along)
        even = self._n_steps * self._step * (float(self._begun @ along) + 0.5 * gain) + ahead
        if ahead <= max(_LIMIT * abs(way), abs(even - way)):
            return ""
        share = 100.0 * ahead / abs(way)
        return (
            f"as it gathers speed, steps carried it {1e3 * ahead:.2g} mm ahead, {share:.2g} % of its way; shorten the "
            "step, or take models.fem: {integrator: bdf2}"
        )
