"""References that come with the scenes: one file of plain JSON each, made once by `make references` in many minutes.

What is true of a scene does not depend on the machine, so whoever charts or plans it need not find it out again. A file
belongs to a scene by its hash (`Levels.key`): of body, tools, motion and step, not of how it is simulated or which
quantities are asked for. Of a scene whose body, motion or probes were changed there is none.
"""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from softseam.errors import BadInput
from softseam.scenes import references_folder
from softseam_studies.study.errors import KNOWN, Truth
from softseam_studies.study.levels import Levels
from softseam_studies.study.reference import TARGET, Level, Part, Reference, counted


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class _Quantity(_Strict):
    """Curve and limit of a quantity, as in `Truth` and `Part`; None for what is not a number, or infinite."""

    scale: float
    uncertainty_cells: float | None
    uncertainty_steps: float | None
    order_cells: float | None
    order_steps: float | None
    extrapolated: float
    converges: bool
    values: list[float]


class _Level(_Strict):
    across: int | float
    step: float
    n_cells: int
    n_nodes: int
    seconds: float
    grading: float = 1.0


class Check(_Strict):
    """A moderate level, and what it did at the reference's times when that was made."""

    across: int | float
    step: float
    values: dict[str, list[float]]


class File(_Strict):
    """A file."""

    softseam_reference: Literal[1]
    scene: str
    """hash"""
    code: str
    """digest of the solvers' sources that it was made with"""
    machine: str
    integrator: str
    levels: list[_Level]
    checks: list[Check]
    nothing: list[str]
    time: list[float]
    quantities: dict[str, _Quantity]

    def knows(self, names: Iterable[str]) -> bool:
        """Whether all these quantities were looked at when it was made."""
        return {*names} <= {*self.quantities, *self.nothing}

    @property
    def reference(self) -> Reference:
        """With all its quantities, none of which is judged yet."""
        truth, parts = {}, {}
        for name, one in self.quantities.items():
            part = parts[name] = Part(
                math.inf if one.uncertainty_cells is None else one.uncertainty_cells,
                math.inf if one.uncertainty_steps is None else one.uncertainty_steps,
                math.nan if one.order_cells is None else one.order_cells,
                math.nan if one.order_steps is None else one.order_steps,
                one.extrapolated,
                one.converges,
            )
            truth[name] = Truth(np.array(one.values), one.scale, part.uncertainty)
        levels = tuple(Level(**level.model_dump()) for level in self.levels)
        return Reference(
            np.array(self.time), truth, parts, levels, self.integrator, True, tuple(self.nothing), bundled=True
        )


def bundled(levels: Levels, target: float = TARGET, known: float = KNOWN) -> Reference | None:
    """What comes with the scene of these levels, of their quantities, as it counts (`counted`); None where nothing
    does.

    Raises BadInput, naming a corrupt file.
    """
    found = read(path_of(levels.scene))
    if found is None or found.scene != levels.key or not found.knows(levels.names):
        return None
    return counted(found.reference, levels.names, target, known)


def path_of(scene: str) -> Path:
    """Where the reference of a scene of this name lies, if any."""
    return references_folder() / f"{scene}.json"


def digest_of(scene: str) -> str:
    """Digest of what ships for scenes of this name; '' where there is none."""
    path = path_of(scene)
    return hashlib.sha256(path.read_bytes()).hexdigest()[:8] if path.is_file() else ""


def read(path: Path) -> File | None:
    """A file, or None where there is none. Raises BadInput, naming a corrupt one."""
    if not path.is_file():
        return None
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        digest = document.pop("digest", None)
        if digest != digest_of_document(document):
            raise ValueError("its contents do not match its digest")
        found = File.model_validate(document)
        if not found.levels or not found.quantities:
            raise ValueError("it has no levels, or no quantities")
        if not found.checks:
            raise ValueError("it has nothing to be checked with")
        columns = [check.values[name] for check in found.checks for name in found.quantities]
        columns += [one.values for one in found.quantities.values()]
        if any(len(column) != len(found.time) for column in columns):
            raise ValueError("columns of unequal length")
    except (OSError, ValueError, AttributeError, TypeError, KeyError) as error:
        first = error.errors()[0] if isinstance(error, ValidationError) else None
        why = f"{'.'.join(map(str, first['loc']))}: {first['msg']}" if first else str(error)
        remedy = "install softseam anew, or delete it and have a reference made here"
        raise BadInput(f"{path} is corrupt ({why}): {remedy}") from None
    return found


def digest_of_document(document: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True, separators=(",", ":")).encode()).hexdigest()[:16]
