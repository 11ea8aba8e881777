"""Rungs: what a body may be simulated as while it runs; each kind is a row of RUNGS."""

from typing import Annotated

from softseam_protocol.scene.spec import OfKind, Spec
from softseam_protocol.table import Table


class RungSpec(Spec):
    """What every kind has. Each kind is a subclass with the parameters of its own."""

    kind: str


RUNGS: Table[type[RungSpec]] = Table("kinds of rung")
"""the specification of each kind; `softseam_coupling.ladder.RUNGS` has what becomes of a body there"""
AnyRung = Annotated[RungSpec, OfKind(RUNGS)]
