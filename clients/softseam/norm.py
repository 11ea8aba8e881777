"""The norm of a curve over time, and the norms that count as zero: |J|^2 = (1/T) int_0^T J(t)^2 dt."""

import numpy as np
from numpy.typing import NDArray

from softseam.columns import unit_of

Floats = NDArray[np.float64]

NOTHING = {"m": 1e-6, "N": 1e-6, "Pa": 1e-3, "1": 1e-9}
"""a quantity whose norm is below this is zero in its scene, by unit"""


def rms(values: Floats, time: Floats) -> float:
    """|J| of a curve (n,) at times (n,) [s], by the trapezoidal rule; the plain value of a single time."""
    if len(time) < 2:
        return float(np.abs(values).max(initial=0.0))
    return float(np.sqrt(np.trapezoid(values * values, time) / (time[-1] - time[0])))


def is_nothing(name: str, scale: float) -> bool:
    """Whether a quantity is zero in this scene, so that no error is relative to it."""
    return not scale > NOTHING.get(unit_of(name), 0.0)
