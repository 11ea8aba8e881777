"""Solvers that softseam's services run: one row a model that no service from outside takes (`tables.check_tables`)."""

from __future__ import annotations

from softseam_protocol.table import Table
from softseam_services.fem import row as fem
from softseam_services.pbd import row as pbd
from softseam_services.solver_row import SolverRow

SOLVERS: Table[SolverRow] = Table("solvers", {each.MODEL: each.ROW for each in (fem, pbd)})
"""by model; an extension adds its own beside its row in softseam_protocol.models.MODELS"""
