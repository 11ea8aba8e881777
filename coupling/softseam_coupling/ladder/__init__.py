"""The ladder: what a body is simulated as, chosen anew before each step, and what carries over where that changes."""

from collections.abc import Callable
from typing import Any

from softseam_coupling.ladder.rung import Discretised, Rung, Standing
from softseam_protocol.table import Table

__all__ = ["RUNGS", "Discretised", "Rung", "Standing"]

RUNGS: Table[Callable[[Any], Rung]] = Table("rungs")
"""builds a rung of a kind that a scene may name, from its specification"""
