"""What every run of a scene is compared with: curves, how well each is known, and the levels that led to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.study.errors import Truth

Floats = NDArray[np.float64]

TARGET = 0.005
"""refined until the cells and the step each leave less than this uncertain: together less than 1 % [1]"""


@dataclass(frozen=True)
class Level:
    """One computation of the ladder."""

    across: float
    """cells along the body's shortest edge; halves between two other levels"""
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
    shipped: bool = False
    """whether it came with the scene (shipped.py), so that no run was made for it"""

    @property
    def counted(self) -> list[str]:
        """Quantities that count in the accuracy."""
        return [name for name, true in self.truth.items() if not true.left_out]

    @property
    def uncertainty(self) -> float:
        """The worst of the quantities that count [1]."""
        return max(self.truth[name].uncertainty for name in self.counted)


def described(reference: Reference) -> dict[str, Any]:
    """The reference as plain data that JSON can hold; no number is a NaN."""
    return {
        "integrator": reference.integrator,
        "complete": reference.complete,
        "shipped": reference.shipped,
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


def origin(reference: Reference) -> str:
    """Where a reference comes from and what it is known to, as a predicate."""
    whence = "ships with the scene, made" if reference.shipped else "was made here"
    return f"{whence} from {len(reference.levels)} runs, known to {in_words(reference.uncertainty)}"


def in_words(uncertainty: float) -> str:
    """An uncertainty in per cent."""
    return f"{100 * uncertainty:.2g} %" if np.isfinite(uncertainty) else "an unknown degree"


def _number(value: float) -> float | None:
    if isinstance(value, bool):
        return value
    return float(f"{value:.5g}") if np.isfinite(value) else None
