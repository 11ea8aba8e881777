"""References that ship with the scenes: one file of plain JSON each, made once by `make references` in many minutes.

What is true of a scene does not depend on the machine, so whoever charts or plans it need not find it out again. A file
belongs to a scene by its hash (`Ladder.key`): of body, tools, motion and step, not of how it is simulated or which
quantities are asked for. Of a scene whose body, motion or probes were changed nothing ships. Numbers are rounded to a
hundredth of what they are known to.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from softseam.errors import BadInput
from softseam.scenes import references_folder
from softseam.study.assemble import counted
from softseam.study.errors import KNOWN, Truth, rms
from softseam.study.ladder import Ladder
from softseam.study.reference import TARGET, Level, Part, Reference

Floats = NDArray[np.float64]

DIGITS = 0.01
"""numbers are rounded to about this share of what they are known to [1]"""
SAME = 0.1
"""a level that moved by less than this share of what a quantity is known to, or by `MOVED`, is still the same [1]"""
MOVED = 1e-3
LOOSER = 5.0
"""times as much at a shorter step than the scene's, where contact chatters and results may hang on rounding [1]"""
CHECKED = 5.0
"""the levels that later code is checked with took no longer [s]: that of most cells at the longest step, and that of
the shortest step, where alone a material's viscosity shows and contact rings"""


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


class Shipped(_Strict):
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
            np.array(self.time), truth, parts, levels, self.integrator, True, tuple(self.nothing), shipped=True
        )


def shipped(ladder: Ladder, target: float = TARGET, known: float = KNOWN) -> Reference | None:
    """What ships for a ladder's scene and quantities, as it counts (`counted`); None where nothing does.

    Raises BadInput, naming a corrupt file.
    """
    found = read(path_of(ladder.scene))
    if found is None or found.scene != ladder.key or not found.knows(ladder.names):
        return None
    return counted(found.reference, ladder.names, target, known)


def moved(found: Shipped, ladder: Ladder, share: float = SAME, least: float = MOVED) -> dict[str, float]:
    """What of a file today's code no longer leads to: the ladder's quantities in a checked level that are not what they
    were, and by how much, relative to the scale [1]; infinite where it ends earlier. Runs those levels: seconds.

    share, least  of what a quantity is known to, and of its scale, that counts as no change [1]

    Raises SoftseamError where a level cannot be computed any more.
    """
    reference = found.reference
    asked = {name: true for name, true in reference.truth.items() if name in ladder.names}
    bound = {name: max(least, share * min(1.0, true.uncertainty)) for name, true in asked.items()}
    off: dict[str, float] = {}
    longest = max(check.step for check in found.checks)
    for check in found.checks:
        ladder.run(check.across, check.step, math.inf)
        series, time = ladder.series((check.across, check.step)), reference.time
        ended = series.time[-1] < time[-1] - 1e-9
        for name, true in asked.items():
            # at the common times, where all of it is looked at
            change = math.inf if ended else rms(series.at(name, time) - np.array(check.values[name]), time) / true.scale
            if not change <= (LOOSER if check.step < longest else 1.0) * bound[name]:
                off[name] = max(change, off.get(name, 0.0))
    return off


def better_of(ships: Reference, made: Reference) -> Reference:
    """Of two references of a scene the one that is known better: the one that was made here only where it is as fine,
    in cells and in steps, and what counts in both is known better.

    Few levels that happen to lie close together claim more than many that do not.
    """
    both = {*ships.counted} & {*made.counted}
    known = _worst(made, both) < _worst(ships, both)
    return made if both and known and is_as_fine(made, ships) else ships


def _worst(reference: Reference, names: Iterable[str]) -> float:
    """What the least known of these quantities is known to [1]; infinite for none."""
    return max((reference.truth[name].uncertainty for name in names), default=math.inf)


def is_as_fine(one: Reference, other: Reference) -> bool:
    """Whether the finest cells and the shortest step of one are no coarser than the other's."""

    def finest(reference: Reference) -> tuple[int, float]:
        equal = [level.n_cells for level in reference.levels if level.grading == 1.0]
        return max(equal), min(level.step for level in reference.levels)

    (n_cells, step), (n_others, others) = finest(one), finest(other)
    return n_cells >= n_others and step <= others * (1.0 + 1e-9)


def path_of(scene: str) -> Path:
    """Where the reference of a scene of this name lies, if any."""
    return references_folder() / f"{scene}.json"


def digest_of(scene: str) -> str:
    """Digest of what ships for scenes of this name; '' where nothing does."""
    path = path_of(scene)
    return hashlib.sha256(path.read_bytes()).hexdigest()[:8] if path.is_file() else ""


def read(path: Path) -> Shipped | None:
    """A file, or None where there is none. Raises BadInput, naming a corrupt one."""
    if not path.is_file():
        return None
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        digest = document.pop("digest", None)
        if digest != _digest(document):
            raise ValueError("its contents do not match its digest")
        found = Shipped.model_validate(document)
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


def shipping(reference: Reference, ladder: Ladder, code: str, machine: str) -> Shipped:
    """The file of a reference that was just made from the levels of a ladder."""
    equal = [level for level in reference.levels if level.grading == 1.0]
    quick = [level for level in equal if level.seconds <= CHECKED] or equal[:1]
    chosen = {
        max((level for level in quick if level.step == step), key=lambda level: level.n_cells)
        for step in {max(level.step for level in quick), min(level.step for level in quick)}
    }
    checks = []
    for level in sorted(chosen, key=lambda level: -level.step):
        series = ladder.series((level.across, level.step))
        did = {n: _rounded(replace(t, values=series.at(n, reference.time))) for n, t in reference.truth.items()}
        checks.append({"across": level.across, "step": level.step, "values": did})
    document = {
        "softseam_reference": 1,
        "scene": ladder.key,
        "code": code,
        "machine": machine,
        "integrator": reference.integrator,
        "levels": [asdict(replace(level, seconds=_digits(level.seconds, 3))) for level in reference.levels],
        "checks": checks,
        "nothing": list(reference.nothing),
        "time": [_digits(value, 9) for value in reference.time],
        "quantities": {
            name: {key: _digits(value, 5) for key, value in asdict(reference.parts[name]).items()}
            | {"scale": _digits(true.scale, 7), "values": _rounded(true)}
            for name, true in reference.truth.items()
        },
    }
    return Shipped.model_validate(document)


def write(found: Shipped, path: Path) -> None:
    """Write a file. Raises OSError."""
    document = found.model_dump()
    document["digest"] = _digest(document)
    path.parent.mkdir(exist_ok=True)
    fresh = path.with_suffix(".fresh")
    fresh.write_text(_text(document), encoding="utf-8")
    fresh.replace(path)


def _rounded(true: Truth) -> list[float]:
    """A quantity's values with the digits that mean something."""
    known = true.scale * min(1.0, max(1e-6, true.uncertainty))
    places = -math.floor(math.log10(DIGITS * known))
    return [round(float(value), places) if places > 0 else round(float(value)) for value in true.values]


def _digits(value: Any, digits: int) -> Any:
    """A number with so many digits; None where it is not finite."""
    if isinstance(value, bool):
        return value
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def _text(document: Mapping[str, Any]) -> str:
    """JSON, a line for each part, level and quantity."""

    def lines(items: Iterable[str], begin: str, end: str) -> str:
        return begin + ",".join(f"\n  {item}" for item in items) + f"\n {end}"

    parts = []
    for key, value in document.items():
        if key == "quantities":
            text = lines((f"{json.dumps(name)}: {_plain(one)}" for name, one in value.items()), "{", "}")
        else:
            text = lines(map(_plain, value), "[", "]") if key in ("levels", "checks") else _plain(value)
        parts.append(f" {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _plain(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def _digest(document: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True, separators=(",", ":")).encode()).hexdigest()[:16]
