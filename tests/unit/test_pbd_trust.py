"""What a step of XPBD leaves for the next one: how long its substeps are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_services.pbd.kernels import summary as k
from softseam_services.pbd.kernels import trust

Floats = NDArray[np.float64]
STORED = 1.0
"""energy of the body [J]"""
FLOOR = 1e-9
"""and what of it is roundoff [J]"""


def after(monitor: Floats, gains: float, planned: bool, touched: bool = True) -> int:
    """Halvings after a step that gains so much of what is stored."""
    result = np.zeros(k.N_RESULTS)
    result[k.STRAIN] = STORED
    result[k.N_CONTACTS] = float(touched)
    monitor[trust.STRAIN] = STORED * (1.0 - gains)
    trust.remember(monitor, result, FLOOR, planned, False)
    return int(monitor[trust.HALVINGS])


@pytest.mark.kernels
def test_substeps_are_longer_again_after_a_while() -> None:
    """After 8 steps without a gain, and after 16 where that was too early; roundoff is none."""
    monitor = np.zeros(trust.N_MONITOR)
    for patience in (8, 16, 32):
        assert after(monitor, 1.1 * trust.GAIN, True) == 1
        found = [after(monitor, -0.01, True), after(monitor, 0.9 * FLOOR / STORED, True)]
        found += [after(monitor, -0.01, True) for _ in range(patience - 2)]
        assert found == [1] * (patience - 1) + [0]


@pytest.mark.kernels
def test_substeps_stay_short_where_they_go_on_gaining_or_are_the_scene_s() -> None:
    """A little every eighth step is not calm; a number of the scene's may be unstable for good."""
    monitor = np.zeros(trust.N_MONITOR)
    assert after(monitor, 1.1 * trust.GAIN, True) == 1
    found = [after(monitor, -0.01 if n % 8 else 0.2 * trust.GAIN, True) for n in range(80)]
    assert found == [1] * 80
    monitor[:] = 0.0
    assert after(monitor, 1.1 * trust.GAIN, False) == 1
    assert [after(monitor, -0.01, False) for _ in range(80)] == [1] * 80


@pytest.mark.kernels
def test_who_lets_go_of_all_tools_begins_anew() -> None:
    """With planned substeps, and no more patience than at first."""
    monitor = np.zeros(trust.N_MONITOR)
    for _ in range(3):
        after(monitor, 1.1 * trust.GAIN, True)
        for _ in range(40):
            after(monitor, -0.01, True)
    assert monitor[trust.DOUBLINGS] > 0.0 and after(monitor, 0.0, True, touched=False) == 0
    assert not monitor[trust.CALM :].any()
