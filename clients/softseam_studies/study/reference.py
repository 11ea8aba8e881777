"""What every run of a scene is compared with: curves, how well each is known, and the levels that led to them.

What cells and steps leave adds up,

    J_ref = lim_h J(h, dt) + [lim_dt J(h', dt') - J(h', dt)],                                                      (1)

and so does what either limit may be off by (richardson.py).
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.columns import is_nothing, rms, unit_of
from softseam.errors import SoftseamError
from softseam_studies.study.errors import (
    FAINT,
    KNOWN,
    Truth,
    is_faint,
    is_hardly_known,
    largest_stress,
    scale_of,
)
from softseam_studies.study.richardson import Limit
from softseam_studies.study.series import Series

Floats = NDArray[np.float64]

TARGET = 0.005
"""refined until the cells and the step each leave less than this uncertain: together less than 1 % [1]"""
NEAR = 0.2
"""levels that went by less than this share of what a quantity has to be known to are near enough, fall or not [1]"""


@dataclass(frozen=True)
class Level:
    """One run of the refinement."""

    across: float
    """cells along the body's shortest edge"""
    step: float
    """[s]"""
    n_cells: int
    n_nodes: int
    seconds: float
    """time of its run [s]"""
    grading: float = 1.0
    """of its cells, which are equal ones at 1"""


@dataclass(frozen=True)
class Part:
    """How a quantity's limit came about."""

    uncertainty_cells: float
    """relative to the quantity's scale [1]"""
    uncertainty_steps: float
    """[1]"""
    order_cells: float
    """NaN where none was found"""
    order_steps: float
    extrapolated: float
    """norm of what the limit differs from the finest cells by, relative to the scale [1]"""
    converges: bool = True
    """whether ever finer cells lead anywhere"""

    @property
    def uncertainty(self) -> float:
        """Of cells and steps together [1]."""
        return self.uncertainty_cells + self.uncertainty_steps


@dataclass(frozen=True)
class Reference:
    """What every run is compared with."""

    time: Floats
    """common times (n,) [s]"""
    truth: Mapping[str, Truth]
    parts: Mapping[str, Part]
    levels: tuple[Level, ...]
    integrator: str
    complete: bool
    """whether every quantity that has a limit is known as well as was asked for"""
    nothing: tuple[str, ...] = ()
    """quantities that are zero in this scene, so that no error is relative to them"""
    bundled: bool = False
    """whether it came with the scene (bundled.py), so that no run was made for it"""

    @property
    def counted(self) -> list[str]:
        """Quantities that count in the accuracy."""
        return [name for name, true in self.truth.items() if not true.left_out]

    @property
    def uncertainty(self) -> float:
        """The worst of the quantities that count [1]."""
        return self.uncertainty_but(())

    def uncertainty_but(self, names: Collection[str]) -> float:
        """The same without these [1]."""
        return max((self.truth[name].uncertainty for name in self.counted if name not in names), default=0.0)


def joined(
    time: Floats,
    cells: Mapping[str, Limit],
    steps: Mapping[str, Limit],
    *,
    finest: Series,
    base: Series,
    levels: tuple[Level, ...],
    integrator: str,
    complete: bool,
) -> Reference:
    """Eq. (1) at times (n,) [s], of limits by cells and by steps; none of its quantities is judged yet.

    finest  the run on the finest cells
    base    of the runs that differ in steps, the one with the step of those that differ in cells
    """
    travel = np.interp(time, finest.time, finest.travel)
    truth: dict[str, Truth] = {}
    parts: dict[str, Part] = {}
    for name, cell in cells.items():
        step = steps[name]
        values = cell.value + (step.value - base.at(name, time))
        scale = scale_of(name, values, travel, time)
        if is_nothing(name, scale):
            continue
        extrapolated = rms(cell.value - finest.at(name, time), time) / scale
        uncertain = cell.uncertainty / scale, step.uncertainty / scale
        parts[name] = Part(*uncertain, cell.order, step.order, extrapolated, cell.converges)
        truth[name] = Truth(values, scale, parts[name].uncertainty)
    nothing = tuple(name for name in cells if name not in truth)
    return Reference(time, truth, parts, levels, integrator, complete, nothing)


def counted(found: Reference, names: Iterable[str], target: float = TARGET, known: float = KNOWN) -> Reference:
    """The reference of these quantities, and which of them count where one has to be known to so much to do so.

    Complete is what was before, and leaves no quantity that counts more uncertain than twice the target.
    """
    truth = {name: found.truth[name] for name in names if name in found.truth}
    if not truth:
        raise SoftseamError("every quantity of the scene is zero: there is nothing to compare")
    parts, enough = {name: found.parts[name] for name in truth}, found.complete
    stress = largest_stress({name: true.scale for name, true in truth.items() if parts[name].converges})
    for name, true in truth.items():
        part, why = parts[name], ""
        # a force or a way has a limit, whichever way its levels go
        has_limit = part.converges or part.uncertainty_cells <= NEAR * known or unit_of(name) != "Pa"
        if is_faint(name, true.scale, stress):
            has_limit, why = False, f"below {100 * FAINT:g} % of the largest stress"
        elif not has_limit:
            why = "no limit: it grows with every refinement"
        elif part.uncertainty > known:
            why = (
                f"known to {in_words(part.uncertainty)} only"
                if part.uncertainty < 1.0
                else "not known: its levels disagree"
            )
            why += ", and perhaps without a limit" if is_hardly_known(name, part.uncertainty) else ""
        truth[name] = replace(true, left_out=why, has_limit=has_limit)
    if all(true.left_out for true in truth.values()):
        truth = {name: replace(true, left_out="", has_limit=True) for name, true in truth.items()}
        enough = False
    complete = enough and all(t.uncertainty <= 2 * target for t in truth.values() if not t.left_out)
    return replace(found, truth=truth, parts=parts, complete=complete)


def described(reference: Reference) -> dict[str, Any]:
    """The reference as plain data that JSON can hold; no number is a NaN."""
    return {
        "integrator": reference.integrator,
        "complete": reference.complete,
        "shipped": reference.bundled,
        "origin": origin(reference),
        "uncertainty": _number(reference.uncertainty),
        "levels": [asdict(level) for level in reference.levels],
        "quantities": {
            name: {
                "counts": not true.left_out,
                "left_out": true.left_out,
                "scale": true.scale,
                "uncertainty": _number(true.uncertainty),
                **{key: _number(value) for key, value in asdict(reference.parts[name]).items()},
                "values": [float(f"{value:.7g}") if np.isfinite(value) else None for value in true.values],
            }
            for name, true in reference.truth.items()
        },
        "time": [float(f"{value:.9g}") for value in reference.time],
    }


def origin(reference: Reference, but: Collection[str] = ()) -> str:
    """Where a reference comes from and what it is known to, as a predicate; `but` quantities that are not meant."""
    whence = "ships with the scene, made" if reference.bundled else "was made here"
    return f"{whence} from {len(reference.levels)} runs, known to {in_words(reference.uncertainty_but(but))}"


def in_words(uncertainty: float) -> str:
    """An uncertainty in per cent."""
    return f"{100 * uncertainty:.2g} %" if np.isfinite(uncertainty) else "an unknown degree"


def _number(value: float) -> float | None:
    if isinstance(value, bool):
        return value
    return float(f"{value:.5g}") if np.isfinite(value) else None
