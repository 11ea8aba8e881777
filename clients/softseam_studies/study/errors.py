"""How far a run is from the reference: the L2 norm over time of what each quantity is off by.

e_k = |J_k - J_k^ref| / |J_k^ref|,   |J|^2 = (1/T) int_0^T J(t)^2 dt,   accuracy = 1 - max_k e_k

Slip is measured by how far the tools have travelled instead: a good grip slips by next to nothing, and a relative error
of that would say nothing, whereas 1 mm of slip on a way of 5 cm is an error of 2 %.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam.columns import rms, unit_of
from softseam.view.colors import label
from softseam_studies.study.series import Series

Floats = NDArray[np.float64]

KNOWN = 0.05
"""a quantity whose reference is not known better than this does not count: its error would be the reference's [1]"""
FAINT = 0.01
"""a stress below this share of the largest that is looked at lies beyond all that presses, and does not count [1]"""

BELIEVED = 0.2
"""a stress that is known worse bounds no run: beside an edge it may grow without end, and levels that are so far from
one another do not distinguish (docs/decisions/36) [1]"""


@dataclass(frozen=True)
class Truth:
    """A quantity's reference on the common times."""

    values: Floats
    """(n,)"""
    scale: float
    """what errors are divided by, in the quantity's unit"""
    uncertainty: float
    """of the reference, relative to `scale`; infinite where a single level says nothing about it [1]"""
    left_out: str = ""
    """why the quantity does not count in the accuracy; '' where it does"""
    has_limit: bool = True
    """whether finer cells lead anywhere"""


@dataclass(frozen=True)
class Error:
    """A quantity's error in one run."""

    value: float
    """[1]"""
    bound: bool
    """whether `value` is the reference's uncertainty, below which the error lies and is not known"""
    differs: float
    """what the run differs from the reference by, known or not [1]"""


def scale_of(name: str, values: Floats, travel: Floats, time: Floats) -> float:
    """What errors of a quantity are divided by: its own norm, of slip the tools' way."""
    return max(rms(values, time), rms(travel, time)) if name == "slip" else rms(values, time)


def largest_stress(norms: Mapping[str, float]) -> float:
    """Of the quantities' norms [Pa]; 0 where none is a stress."""
    return max((norm for name, norm in norms.items() if unit_of(name) == "Pa"), default=0.0)


def is_faint(name: str, scale: float, stress: float) -> bool:
    """Whether a quantity is a stress that is next to nothing beside the largest one [Pa]."""
    return unit_of(name) == "Pa" and scale < FAINT * stress


def is_hardly_known(name: str, uncertainty: float) -> bool:
    """Whether a quantity is a stress of which nobody knows whether it has a limit, or is not known at all."""
    return uncertainty > (BELIEVED if unit_of(name) == "Pa" else 1.0)


def errors(series: Series, time: Floats, truth: Mapping[str, Truth]) -> dict[str, Error]:
    """Error of every quantity of a run against its reference on common times (n,) [s].

    A run that ended earlier is compared for as long as it lasted. A quantity that the run lacks is infinitely wrong.
    One that is looked at every few steps is compared where it was: a line through a wave would be wrong between, where
    the run is not.
    """
    found = {}
    for name, true in truth.items():
        at = time[time <= series.time[-1] + 1e-9]
        if name in series.values and 2 * len(series.looked(name)) < len(series.time):
            at = series.looked(name)
            at = at[(at >= time[0]) & (at <= time[-1] + 1e-9)]
        if name not in series.values or not len(at):
            found[name] = Error(float("inf"), False, float("inf"))
            continue
        off = rms(series.at(name, at) - np.interp(at, time, true.values), at) / true.scale
        off = off if np.isfinite(off) else float("inf")
        below = off <= true.uncertainty < np.inf
        found[name] = Error(true.uncertainty if below else off, below, off)
    return found


def worst(found: Mapping[str, Error], truth: Mapping[str, Truth]) -> Error:
    """The largest error of the quantities that count; of equal ones, the one that is no mere bound."""
    counted = [error for name, error in found.items() if not truth[name].left_out]
    return max(counted, key=lambda error: (error.value, not error.bound))


def sure(found: Mapping[str, Error], truth: Mapping[str, Truth]) -> dict[str, float]:
    """What quantities that have a limit, but do not count, are off by at least: e - u, however little is known, but of
    stresses that are hardly known [1]."""
    return {
        name: 0.0 if error.bound else max(0.0, error.value - truth[name].uncertainty)
        for name, error in found.items()
        if truth[name].left_out and truth[name].has_limit and not is_hardly_known(name, truth[name].uncertainty)
    }


def not_counted(truth: Mapping[str, Truth]) -> str:
    """What does not count, and why: quantities of one reason together; '' where all count."""
    return uncounted({name: true.left_out for name, true in truth.items() if true.left_out})


def uncounted(reasons: Mapping[str, str]) -> str:
    """The same of quantities and their reasons."""
    groups: dict[str, list[str]] = {}
    for name, why in reasons.items():
        groups.setdefault(why, []).append(label(name))
    return "; ".join(f"{', '.join(names)} ({why})" for why, names in groups.items())
