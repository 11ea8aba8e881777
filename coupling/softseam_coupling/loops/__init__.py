"""One file a coupling loop; the table has one row a name that `seam.scheme` takes."""

from collections.abc import Callable

from softseam_coupling.loops.loop import Loop, LoopSetup
from softseam_coupling.loops.one_way import OneWay
from softseam_coupling.loops.staggered import Staggered
from softseam_protocol.table import Table

__all__ = ["LOOPS"]

LOOPS: Table[Callable[[LoopSetup], Loop]] = Table("coupling loops", {"position": OneWay, "staggered": Staggered})
"""builds a loop for one epoch; raises Unsuited where it cannot couple such parts and interfaces"""
