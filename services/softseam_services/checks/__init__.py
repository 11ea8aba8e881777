"""What is doubtful about a body and its tools before anything moves: one file a check, one row here."""

import numpy as np

from softseam_protocol.checks import Check, When, anything, look, require_files
from softseam_protocol.table import Table
from softseam_services.body.contact_points import is_embedded
from softseam_services.body.interpolate import rest_points
from softseam_services.checks import (
    borders,
    boxes,
    cells,
    factor,
    friction,
    hits,
    inclusions,
    leaps,
    materials,
    narrow,
    repaired,
    round_tools,
    substeps,
)
from softseam_services.server import Setup
from softseam_services.to_check import Cells, Particles

__all__ = ["CELLS", "PARTICLES", "When", "doubts", "size_of"]


def _block(seen: Cells) -> bool:
    """Tools are felt at points inside faces of its cells."""
    return not is_embedded(seen.body)


CELLS: Table[Check[Cells]] = Table(
    "checks of bodies in cells",
    {
        "cells": Check(When.BEFORE, anything, cells.look),
        "materials": Check(When.BEFORE, anything, materials.look),
        "boxes": Check(When.BEFORE, anything, boxes.look),
        "inclusions": Check(When.BEFORE, anything, inclusions.look),
        "leaps": Check(When.BEFORE, anything, leaps.look),
        "friction": Check(When.BEFORE, anything, friction.look),
        "factor": Check(When.BEFORE, anything, factor.look),
        "narrow": Check(When.BEFORE, anything, narrow.look),
        "round_tools": Check(When.BEFORE, _block, round_tools.look),
        "repaired": Check(When.BEFORE, anything, repaired.look),
        "hits": Check(When.BEFORE, anything, hits.look),
        "substeps": Check(When.BEFORE, anything, substeps.look),
        "borders": Check(When.NOTE, anything, borders.look),
    },
)
PARTICLES: Table[Check[Particles]] = Table(
    "checks of bodies of particles", {"friction": Check(When.BEFORE, anything, friction.look_at_particles)}
)
require_files(__path__, CELLS, PARTICLES)


def size_of(setup: Setup) -> float:
    """Largest extent of a body [m]."""
    body = setup.body
    return float(np.ptp(rest_points(body) if body.has_cells else body.x_rest, axis=0).max())


def doubts(setup: Setup, when: When = When.BEFORE) -> list[str]:
    """Sentences about one body, in a scene with that body alone; thousands of cells take some hundredths of a second.

    Raises SettingError where the run would be refused.
    """
    if setup.body.has_cells:
        return look(CELLS, Cells(setup.scene, setup.body, setup.tools), when)
    return look(PARTICLES, Particles(setup.scene, setup.body, setup.tools), when)
