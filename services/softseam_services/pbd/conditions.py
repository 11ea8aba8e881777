"""How hard a run's XPBD is to sweep: condition numbers at its start and at its end, for people and reports."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import Frame
from softseam_services.pbd.condition import condition_of
from softseam_services.server import build_setup


def conditions(bundle: Bundle, start: Mapping[str, Frame], end: Mapping[str, Frame]) -> dict[str, Any]:
    """Of each body of a scene that XPBD moves, from its fields at the start and at the end: numbers and a sentence."""
    found: dict[str, Any] = {}
    for name in start:
        setup = build_setup(bundle, name)
        begun, ended = (
            condition_of(setup.scene, setup.body, setup.tools, frame.x, np.asarray(frame.cell_near, dtype=np.bool_))
            for frame in (start[name], end[name])
        )
        known = ended or begun
        if known is not None:
            found[name] = {
                "start": None if begun is None else begun.spectrum.condition,
                "end": None if ended is None else ended.spectrum.condition,
                "sweeps_for_a_tenth": known.spectrum.sweeps,
                "sweeps": known.sweeps,
                "substeps": known.substeps,
            }
            found[name]["text"] = sentence(found[name])
    return found


def sentence(condition: Mapping[str, Any]) -> str:
    """What a condition number means for the number of sweeps."""
    numbers = [
        f"{condition[key]:.3g} at the {key}" if condition[key] is not None else f"none at the {key}, which is FEM's"
        for key in ("start", "end")
    ]
    taken, wanted = (_counted(condition[key], "sweep") for key in ("sweeps", "sweeps_for_a_tenth"))
    text = f"condition number of XPBD's system: {', '.join(numbers)}, in {_counted(condition['substeps'], 'substep')} "
    text += f"a step. The slowest part of an error falls to a tenth in some {wanted}; a substep takes {taken}"
    if condition["sweeps_for_a_tenth"] > condition["sweeps"]:
        text += ", and leaves the rest to the next: shorter substeps need fewer"
    return text


def _counted(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
