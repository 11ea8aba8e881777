"""Newmark's average acceleration, the trapezoidal rule: second order, dissipates nothing (`generalised_alpha`)."""

import numpy as np

from softseam_services.body.body import Floats


def parameters() -> Floats:
    """share, am, beta, gamma [1]."""
    return np.array([1.0, 0.0, 0.25, 0.5])
