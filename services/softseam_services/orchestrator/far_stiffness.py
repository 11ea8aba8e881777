"""The far side's stiffness at the seam: as it was probed, as rounds have taught it, and as the near side has it.

The near side solves with S = (P H_far P^T)^-1 (`condensed`, `linked`). It factors anew whenever it is told another S,
so it is told one only where that is worth it, and never the same one twice.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.stiffness import learn_stiffness
from softseam_coupling.mortar import SeamTie, stiffness_of
from softseam_protocol.messages import Advanced
from softseam_services.orchestrator.linked import Link
from softseam_services.orchestrator.seam_answers import SideRequest

Floats = NDArray[np.float64]

_NONE = np.zeros((0, 0))


class FarStiffness:
    """S of one epoch; all of it evolves. n unknowns at the seam.

    link  hears of every new compliance: its line is made of it
    """

    def __init__(self, tie: SeamTie, link: Link):
        self._tie, self._link = tie, link
        self.compliance = _NONE
        """as the far side told it last (n, n) [m/N]; empty before"""
        self.base = _NONE
        """S of that compliance (n, n) [N/m]"""
        self.used = _NONE
        """S that condensed rounds give the near side"""
        self.touched = False
        """whether the far side touched something when its compliance was taken"""
        self.stale = False
        """whether the compliance is of another length of step"""
        self._learned = _NONE
        self._told: Floats | None = None

    @property
    def known(self) -> bool:
        return self.base.size > 0

    def take(self, far: Advanced, lambda_: Floats) -> bool:
        """Keep what the far side answered to lambda_ and a request for its compliance; whether that is in it."""
        taken = far.compliance.size > 0 and bool(np.isfinite(far.compliance).all())
        if taken:
            self.compliance = far.compliance
            self.base = stiffness_of(self._tie.far_compliance(far.compliance))
            self.unlearn()
            self.touched = far.n_contacts > 0
            self.stale = False
            self._link.renew(far, self.base, lambda_)
        return taken

    def learn(self, moved: Floats, resisted: Floats) -> None:
        """The far side's image moved so (s, 3) [m] and resisted by so much (s, 3) [N]; `used` is left as it is."""
        learn_stiffness(self._learned, moved.reshape(-1), resisted.reshape(-1))

    def use_learned(self) -> None:
        """Give the near side what was learned."""
        self.used = self._learned.copy()

    def stiffen(self) -> None:
        """Rounds with what was learned overshoot: add the stiffness as it was probed."""
        self._learned += self.base
        self.use_learned()

    def unlearn(self) -> None:
        """Back to the stiffness as it was probed."""
        self._learned, self.used = self.base.copy(), self.base

    def coupled(self, lambda_: Floats, anchor: Floats, stiffness: Floats, fields: bool = True) -> SideRequest:
        """Ask the near side with one of these stiffnesses, which is sent only where it is another than before."""
        told = stiffness is self._told
        self._told = stiffness
        return SideRequest(lambda_, False, anchor, None if told else stiffness, fields=fields)

    def forget_told(self) -> None:
        """The near side no longer knows the stiffness that it was sent: it took a snapshot or was restored."""
        self._told = None

    def to_arrays(self) -> dict[str, Floats]:
        return {
            "stiffness": self._learned.copy(),
            "far_compliance": self.compliance,
            "used": self.used,
            "base": self.base,
        }

    def restore(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`; touched and stale are the loop's to set."""
        self._told = None
        self._learned, self.used, self.base = (np.array(arrays[name]) for name in ("stiffness", "used", "base"))
        self.compliance = np.array(arrays["far_compliance"])
