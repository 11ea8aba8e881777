"""A lift within an acceleration begins without the jerk of one that has its speed at once."""

from __future__ import annotations

import numpy as np
from test_opening import FINGERS, HOLD, run


def test_the_force_of_a_lift_is_weight_and_inertia() -> None:
    """30 mm at 0.15 m/s: m (g + a) at most, within what a soft body swings by; at once it is 2.2 times the weight."""
    largest, weights = [], []
    for limit in ({}, {"acceleration": 4.0}, {"acceleration": 1.0}):
        up = {"tools": FINGERS, "move": [0, 0, 0.03], "speed": 0.15, **limit}
        reports, told = run([HOLD, {"hold": 0.2}, up, {"hold": 0.3}])
        force = np.array([-report.wrench[1:, 2].sum() for report in reports])
        largest.append(force[[report.phase >= 2 for report in reports]].max() / force[-1])
        weights.append(force[-1])
        assert told == []
    np.testing.assert_allclose(weights, 0.03**3 * 1000.0 * 9.81, rtol=1e-3)
    assert largest[0] > 2.0
    for found, acceleration in zip(largest[1:], (4.0, 1.0), strict=True):
        inertia = acceleration / 9.81
        assert 1.0 + 0.5 * inertia < found < 1.0 + 1.6 * inertia
