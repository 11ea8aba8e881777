"""What is doubtful about a body and its tools before anything moves: a function a check, one row here."""

import numpy as np

from softseam_protocol.checks import Check, When, anything, look
from softseam_protocol.table import Table
from softseam_services.body.contact_points import is_embedded
from softseam_services.body.interpolate import rest_points
from softseam_services.checks import of_materials, of_places, of_rolling, of_tools
from softseam_services.checks.seen import Cells, Particles
from softseam_services.server import Setup

__all__ = ["CELLS", "PARTICLES", "When", "doubts", "size_of"]


def _block(seen: Cells) -> bool:
    """Tools are felt at points inside faces of its cells."""
    return not is_embedded(seen.body)


CELLS: Table[Check[Cells]] = Table(
    "checks of bodies in cells",
    {
        "cells": Check(When.BEFORE, anything, of_places.cells),
        "materials": Check(When.BEFORE, anything, of_materials.materials),
        "boxes": Check(When.BEFORE, anything, of_places.boxes),
        "inclusions": Check(When.BEFORE, anything, of_places.inclusions),
        "leaps": Check(When.BEFORE, anything, of_tools.leaps),
        "friction": Check(When.BEFORE, anything, of_materials.friction),
        "factor": Check(When.BEFORE, anything, of_materials.factor),
        "narrow": Check(When.BEFORE, anything, of_tools.narrow_tools),
        "round_tools": Check(When.BEFORE, _block, of_tools.round_tools),
        "repaired": Check(When.BEFORE, anything, of_tools.repaired_tools),
        "hits": Check(When.BEFORE, anything, of_tools.hits),
        "rolls": Check(When.BEFORE, anything, of_rolling.rolls),
        "substeps": Check(When.BEFORE, anything, of_materials.substeps),
        "borders": Check(When.NOTE, anything, of_places.borders),
    },
)
PARTICLES: Table[Check[Particles]] = Table(
    "checks of bodies of particles", {"friction": Check(When.BEFORE, anything, of_materials.friction_of_particles)}
)


def size_of(setup: Setup) -> float:
    """Largest extent of a body [m]."""
    body = setup.body
    return float(np.ptp(rest_points(body) if body.has_cells else body.x_rest, axis=0).max())


def doubts(setup: Setup, when: When = When.BEFORE) -> list[str]:
    """Sentences about one body, in a scene with that body alone; thousands of cells take some hundredths of a second.

    Raises SettingError where the run would be refused.
    """
    if setup.body.has_cells:
        return look(CELLS, Cells(setup.scene, setup.spec, setup.body, setup.tools), when)
    return look(PARTICLES, Particles(setup.scene, setup.spec, setup.body, setup.tools), when)
