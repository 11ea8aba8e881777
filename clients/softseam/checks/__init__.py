"""What is doubtful about a scene as it is written, and what its run did not do: one file a check, one row here.

What needs bodies that are built is in the table of the services (`softseam_services.checks`).
"""

import math
from collections.abc import Mapping, Sequence

from softseam.checks import (
    idle,
    law,
    length,
    locks,
    motion,
    plasticity,
    relaxation,
    swings,
    together,
    tools,
    units,
    unmet,
    viscosity,
)
from softseam.columns import Columns
from softseam.to_check import Ended, Written
from softseam_protocol.checks import Check, When, anything, look, require_files
from softseam_protocol.messages.session import Event
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.scene import Scene
from softseam_protocol.table import Table

__all__ = ["RUN", "SCENE", "When", "doubts", "not_done"]

SCENE: Table[Check[Written]] = Table(
    "checks of scenes",
    {
        "locks": Check(When.BEFORE, anything, locks.look),
        "length": Check(When.BEFORE, anything, length.look),
        "law": Check(When.BEFORE, anything, law.look),
        "plasticity": Check(When.BEFORE, lambda seen: seen.body.has_cells, plasticity.look),
        "relaxation": Check(When.BEFORE, lambda seen: seen.body.has_cells, relaxation.look),
        "motion": Check(When.BEFORE, anything, motion.look),
        "units": Check(When.BEFORE, anything, units.look),
        "tools": Check(When.BEFORE, anything, tools.look),
        "viscosity": Check(When.NOTE, lambda seen: seen.body.has_cells, viscosity.look),
    },
)
RUN: Table[Check[Ended]] = Table(
    "checks of runs",
    {
        "unmet": Check(When.AFTER, anything, unmet.look),
        "swings": Check(When.AFTER, anything, swings.look),
        "idle": Check(When.AFTER, lambda run: run.done, idle.look),
    },
)
COMPANY: Table[Check[Scene]] = Table(
    "checks of several bodies",
    {
        "together": Check(When.BEFORE, anything, together.look),
        "apart": Check(When.NOTE, anything, together.note),
    },
)
require_files(__path__, SCENE, RUN, COMPANY)


def doubts(scene: Scene, built: Mapping[str, tuple[float, Sequence[str]]], when: When = When.BEFORE) -> list[str]:
    """What is doubtful about a scene: sentences that begin with their key.

    built  of bodies that are built, by name: largest extent [m], and what the services find doubtful; of others the
           scene alone is looked at
    """
    found = of_company(scene, when)
    for name in scene.bodies:
        one = scene.of(name)
        size, texts = built.get(name, (max(one.body.own_lengths, default=math.inf), ()))
        texts = [*texts, *look(SCENE, Written(one, size), when)]
        group = repeated(name) if repeated(name) in scene.many else name  # what is said of copies, once
        found += texts if scene.one is not None else [_of_body(group, text) for text in texts]
    return list(dict.fromkeys(found))


def of_company(scene: Scene, when: When = When.BEFORE) -> list[str]:
    """What is doubtful about all bodies of a scene together."""
    return look(COMPANY, scene, when)


def not_done(scene: Scene, columns: Columns, events: Sequence[Event], done: bool) -> list[str]:
    """What a scene asks for and its run did not do, each with its remedy."""
    return look(RUN, Ended(scene, columns, events, done), When.AFTER)


def _of_body(name: str, text: str) -> str:
    """A sentence about `body`, about one of several."""
    return f"bodies.{name}.{text.removeprefix('body.')}" if text.startswith("body.") else text
