"""One file an acceleration; the table has one row a name that `seam.acceleration` takes."""

from __future__ import annotations

from collections.abc import Callable

from softseam_coupling.accelerations.aitken import Aitken
from softseam_coupling.accelerations.constant import Constant
from softseam_coupling.accelerations.iqn_ils import IqnIls
from softseam_coupling.accelerations.memory import Acceleration
from softseam_protocol.table import Table

__all__ = ["ACCELERATIONS"]


def _exact() -> None:
    """No acceleration: the parts report their compliance."""


ACCELERATIONS: Table[Callable[[], Acceleration | None]] = Table(
    "builders of accelerations",
    {
        "exact": _exact,
        "iqn_ils": IqnIls,
        "aitken": Aitken,
        "constant": Constant,
    },
)
"""makes an acceleration; None: multipliers are found by the compliance that parts report"""
