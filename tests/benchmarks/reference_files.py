"""Files of references that come with scenes: what is written into one, and whether today's code still agrees with it.

Numbers are rounded to a hundredth of what they are known to.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from softseam.columns import rms
from softseam_studies.study.bundled import File, digest_of_document
from softseam_studies.study.errors import Truth
from softseam_studies.study.levels import Levels
from softseam_studies.study.reference import Reference

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


def moved(found: File, levels: Levels, share: float = SAME, least: float = MOVED) -> dict[str, float]:
    """What of a file today's code no longer leads to: the levels' quantities in a checked level that are not what they
    were, and by how much, relative to the scale [1]; infinite where it ends earlier. Runs those levels: seconds.

    share, least  of what a quantity is known to, and of its scale, that counts as no change [1]

    Raises SoftseamError where a level cannot be computed any more.
    """
    reference = found.reference
    asked = {name: true for name, true in reference.truth.items() if name in levels.names}
    bound = {name: max(least, share * min(1.0, true.uncertainty)) for name, true in asked.items()}
    off: dict[str, float] = {}
    longest = max(check.step for check in found.checks)
    for check in found.checks:
        levels.run(check.across, check.step, math.inf)
        series, time = levels.series((check.across, check.step)), reference.time
        ended = series.time[-1] < time[-1] - 1e-9
        for name, true in asked.items():
            # at the common times, where all of it is looked at
            change = math.inf if ended else rms(series.at(name, time) - np.array(check.values[name]), time) / true.scale
            if not change <= (LOOSER if check.step < longest else 1.0) * bound[name]:
                off[name] = max(change, off.get(name, 0.0))
    return off


def is_as_fine(one: Reference, other: Reference) -> bool:
    """Whether the finest cells and the shortest step of one are no coarser than the other's."""

    def finest(reference: Reference) -> tuple[int, float]:
        equal = [level.n_cells for level in reference.levels if level.grading == 1.0]
        return max(equal), min(level.step for level in reference.levels)

    (n_cells, step), (n_others, others) = finest(one), finest(other)
    return n_cells >= n_others and step <= others * (1.0 + 1e-9)


def shipping(reference: Reference, levels: Levels, code: str, machine: str) -> File:
    """The file of a reference that was just made from the levels of a levels."""
    equal = [level for level in reference.levels if level.grading == 1.0]
    quick = [level for level in equal if level.seconds <= CHECKED] or equal[:1]
    chosen = {
        max((level for level in quick if level.step == step), key=lambda level: level.n_cells)
        for step in {max(level.step for level in quick), min(level.step for level in quick)}
    }
    checks = []
    for level in sorted(chosen, key=lambda level: -level.step):
        series = levels.series((level.across, level.step))
        did = {n: _rounded(replace(t, values=series.at(n, reference.time))) for n, t in reference.truth.items()}
        checks.append({"across": level.across, "step": level.step, "values": did})
    document = {
        "softseam_reference": 1,
        "scene": levels.key,
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
    return File.model_validate(document)


def write(found: File, path: Path) -> None:
    """Write a file. Raises OSError."""
    document = found.model_dump()
    document["digest"] = digest_of_document(document)
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
