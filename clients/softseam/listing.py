"""What the tables hold, for people: the rows that a scene may name."""

from rich.table import Table

from softseam_protocol.quantities import QUANTITIES

_BODIES = {"any": "", "cells": "bodies in cells", "particles": "sheets, ropes, tetrahedra"}


def quantity_table() -> Table:
    """All quantities with their units, meanings and the bodies that have them."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading in ("quantity", "unit", "", "of"):
        table.add_column(heading)
    for name, row in QUANTITIES.items():
        table.add_row(name, row.unit, row.meaning, _BODIES[row.of])
    return table
