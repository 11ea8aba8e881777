"""What acts on a region over a step, as a request says it, and what the step came to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softseam_protocol.messages.participant import Advance
from softseam_services.body.body import Floats

from . import substeps
from .inputs import Result
from .tool_motion import Tools, part_of

NO_TURN = np.zeros(0)
AT_ONCE = substeps.Substeps(n_accepted=1)
"""what a step takes as a rule"""


class StepInputs(NamedTuple):
    """What acts on a region over one step, but for its length (s seam nodes); the seam as of `Advance`."""

    tools: Tools
    seam_force: Floats
    """(s, 3) [N]"""
    seam_force_start: Floats
    """(s, 3) [N], (0, 3) where the force is constant"""
    seam_target: Floats
    """(s, 3) [m], (0, 3) where nothing beyond the seam resists"""
    seam_impedance: Floats
    """(3s, 3s) [N/m], (0, 0) where it is as before"""
    parts: int = 1
    """that the tools' way asks for, a power of 2"""
    turn: Floats = NO_TURN
    """of the whole body, where it is in several parts, as of `Advance`"""

    @classmethod
    def of(cls, request: Advance, tools: Tools, parts: int = 1) -> StepInputs:
        """What a request says, with the tools over the step, which is taken in so many parts at least."""
        sent = request.coupling_force, request.coupling_force_start, request.coupling_target, request.coupling_impedance
        return cls(tools, *sent, parts, request.turn)

    def part(self, number: int) -> StepInputs:
        """What acts over one of the parts, whose seam the other side does not follow."""
        first, last = number / self.parts, (number + 1) / self.parts
        start, force = self.seam_force_start, self.seam_force
        if len(start):
            start, force = (start + share * (force - start) for share in (first, last))
        return StepInputs(part_of(self.tools, first, last), force, start, self.seam_target[:0], self.seam_impedance)


class StepResult(NamedTuple):
    """What a step came to, beside the state at its end."""

    status: int
    """of `kernels.newton`; the rest is valid where it is CONVERGED"""
    arrays: Result
    """overwritten by the next step"""
    substeps: substeps.Substeps
    """what it took to get through"""
