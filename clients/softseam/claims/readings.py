"""What is read off a curve: its value at the end, its peak, its mean; each is claimed by itself."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Read = Callable[[Floats, Floats], tuple[float, float, float]]
"""of times (n,) [s] and values (n,): the number, by how much it changes where all comes a step later, and what changes
in a step beside a peak"""


def measured(entry: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Times (n,) [s] at which a quantity's entry in a report was measured, and its values (n,)."""
    time, values = (np.array(entry[name], dtype=np.float64) for name in ("time", "values"))
    known = np.isfinite(values)
    return time[known], values[known]


def _end(time: Floats, values: Floats) -> tuple[float, float, float]:
    return float(values[-1]), _largest(np.diff(values[-2:])), 0.0


def _peak(time: Floats, values: Floats) -> tuple[float, float, float]:
    """The value farthest from 0, whenever it comes."""
    at = int(np.argmax(np.abs(values)))
    return float(values[at]), 0.0, _largest(np.diff(values[max(0, at - 1) : at + 2]))


def _mean(time: Floats, values: Floats) -> tuple[float, float, float]:
    """Over time; a step later its last value is gone, and the first counts twice."""
    if len(time) < 2:
        return float(values[-1]), 0.0, 0.0
    late = abs(float(values[-1] - values[0])) / (len(values) - 1)
    return float(np.trapezoid(values, time) / (time[-1] - time[0])), late, 0.0


def _largest(changes: Floats) -> float:
    return float(np.abs(changes).max(initial=0.0))


READINGS: dict[str, Read] = {"end": _end, "peak": _peak, "mean": _mean}
"""By its name in a report."""
