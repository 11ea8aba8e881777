"""Solvers that softseam's services run: one row a model that no service from outside takes (`tables.check_tables`)."""

from collections.abc import Callable
from typing import TypeVar

from softseam_protocol.table import MissingRow, Table
from softseam_services.fem import row as fem
from softseam_services.pbd import row as pbd
from softseam_services.solver_row import SolverRow

T = TypeVar("T")

SOLVERS: Table[SolverRow] = Table("solvers", {each.MODEL: each.ROW for each in (fem, pbd)})
"""by model; an extension adds its own beside its row in softseam_protocol.models.MODELS"""


def offered(what: Callable[[SolverRow], T | None]) -> T:
    """What the first solver offers that offers this. Raises MissingRow where none does."""
    found = (what(row) for row in SOLVERS.values())
    for one in found:
        if one is not None:
            return one
    raise MissingRow("no solver in the table of solvers offers what is asked for")
