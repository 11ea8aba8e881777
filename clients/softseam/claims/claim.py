"""What each quantity of a run is claimed to be off by: the L2 norm over time of its difference to the sibling's, times
a factor.

claim = factor |J - J_sibling|,   |J|^2 = (1/T) int_0^T J(t)^2 dt                                                (1)

The factor was chosen on half of the scenes of docs/results/claims.md, and checked on the other half.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.study.errors import is_nothing, rms
from softseam_protocol.quantities import quantity

Floats = NDArray[np.float64]

FACTOR = 2.0
"""of the difference to a sibling whose cells and steps are twice as long [1]"""
FACTOR_FINER = 2.0
"""and of that to one whose are half as long [1]"""
GROWS = 1.1
"""of what need not settle: times by which the finer run's exceeds the coarser's from which on it is said to grow [1]"""
_LEAST = 1e-4
"""share of a quantity that no run is more exact than: iterations, contacts and digits shown leave so much open [1]"""


def claims(run: Mapping[str, Any], sibling: Mapping[str, Any], factor: float) -> dict[str, dict[str, float | None]]:
    """By quantity: `absolute`, eq. (1) in its unit, and `share`, over the run's own |J|, None of one that is nothing.

    run, sibling: `quantities` of both reports. Both are taken at the sibling's times at which it was measured, the run
    between its own by straight lines. What says how far this one run is off, such as a residual, is claimed nothing of.
    """
    found: dict[str, dict[str, float | None]] = {}
    for name, entry in run.items():
        if name not in sibling or quantity(name).group == "error":
            continue
        off, size = difference(entry, sibling[name])
        if np.isfinite(off):
            off = max(off, _LEAST * size)
            share = None if is_nothing(name, size) else factor * off / size
            found[name] = {"absolute": factor * off, "share": share}
    return found


def growing(run: Mapping[str, Any], sibling: Mapping[str, Any], finer: bool) -> dict[str, float]:
    """|J| on the shorter cells over that on the longer ones, of quantities that need not settle and grew by `GROWS`.

    run, sibling: `quantities` of both reports; finer: whether the sibling has the shorter cells.
    """
    found = {}
    for name, entry in run.items():
        if name not in sibling or quantity(name).settles:
            continue
        at, here, there = _together(entry, sibling[name])
        sizes = [rms(values, at) for values in ((there, here) if finer else (here, there))]
        if sizes[1] > 0.0 and sizes[0] > GROWS * sizes[1]:
            found[name] = sizes[0] / sizes[1]
    return found


def difference(run: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[float, float]:
    """|J - J'| and |J| of a quantity's entries in two reports; NaN where they have no time in common."""
    at, here, there = _together(run, other)
    time, values = _measured(run)
    return (rms(here - there, at), rms(values, time)) if len(at) else (float("nan"), float("nan"))


def _together(run: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[Floats, Floats, Floats]:
    """Times (n,) [s] of the other's within the run's, and the values (n,) of both, the run's between its own."""
    (time, values), (at, others) = _measured(run), _measured(other)
    within = (at >= time[0] - 1e-9) & (at <= time[-1] + 1e-9) if len(time) else np.zeros(len(at), dtype=bool)
    at = at[within]
    return at, np.interp(at, time, values) if len(at) else at, others[within]


def _measured(entry: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Times (n,) [s] at which a quantity was measured, and its values (n,)."""
    time, values = (np.array(entry[name], dtype=np.float64) for name in ("time", "values"))
    known = np.isfinite(values)
    return time[known], values[known]
