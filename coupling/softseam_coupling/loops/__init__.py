"""One file a coupling loop; the table has one row a name that `seam.scheme` takes."""

from __future__ import annotations

from collections.abc import Callable

from softseam_coupling.loops.accelerated import Accelerated
from softseam_coupling.loops.loop import Loop, LoopSetup
from softseam_coupling.loops.one_way import OneWay
from softseam_coupling.loops.prakash_hjelmstad import PrakashHjelmstad
from softseam_coupling.loops.staggered import Staggered
from softseam_protocol.table import Table

__all__ = ["LOOPS"]


def _position(setup: LoopSetup) -> Loop:
    """The default; where an acceleration is asked for, what does without the parts' compliance."""
    return OneWay(setup) if setup.acceleration is None else Accelerated(setup)


LOOPS: Table[Callable[[LoopSetup], Loop]] = Table(
    "coupling loops", {"position": _position, "ph": PrakashHjelmstad, "staggered": Staggered}
)
"""builds a loop for one epoch; raises Unsuited where it cannot couple such parts and interfaces"""
