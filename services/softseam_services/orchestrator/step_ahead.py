"""A step that is begun with the correction of the one before, in the same messages, where it follows for certain.

A correction ends a step, and says nothing that the loop does not know: the multipliers are found, and where parts are
moved to is their linear answer. So what the parts are asked for first in the step that follows is known, too, and goes
with it; over the bus that is one round of messages a step in place of two. Bits are those of steps begun one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.loop import PartRequest
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import Advance, Advanced, Reply, Request, ToolMotion

_NOTHING = np.zeros(0)
_NO_VECTORS, _AS_SENT = np.zeros((0, 3)), np.zeros((0, 0))


@dataclass(frozen=True, slots=True)
class StepAhead:
    """The step that follows, as far as it has begun."""

    motion: ToolMotion
    asked: dict[str, Advance]
    told: dict[str, Advanced | None]
    """None of those who left it"""

    @property
    def replies(self) -> dict[str, Reply]:
        """Of those who have begun it."""
        return {name: reply for name, reply in self.told.items() if reply is not None}

    @property
    def left(self) -> dict[str, Request]:
        """What is still to be asked of the others."""
        return {name: self.asked[name] for name, reply in self.told.items() if reply is None}


def advance_request(
    header: Header,
    dt: float,
    motion: ToolMotion,
    part: PartRequest,
    fields: bool = False,
    turn: NDArray[np.float64] = _NOTHING,
) -> Advance:
    """What a loop asks a part for, over a step of dt [s] with this motion of the tools, as a message.

    turn: of the whole body, see `Advance`
    """
    target = _NO_VECTORS if part.target is None else part.target
    impedance = _AS_SENT if part.impedance is None else part.impedance
    start = _NO_VECTORS if part.start is None else part.start
    return Advance(header, dt, part.force, motion, part.renew, target, impedance, fields, start, part.repeat, turn)
