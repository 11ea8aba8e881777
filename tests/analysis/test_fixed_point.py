"""Multipliers by fixed-point iterations on two marching sides, as loops take steps, against direct solves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analysis.lattice import compliance, couple, fixed_point, grid_bar
from analysis.linear_study.position_constant import PositionConstant
from analysis.linear_study.split import run

pytestmark = pytest.mark.kernels


def test_exact_compliance_equals_the_direct_scheme() -> None:
    split, start = grid_bar(6, 2, 1.0, 10, 0.05)
    found = fixed_point(split)
    direct = run(PositionConstant(), split, start, 40)
    now = start
    for step in range(40):
        now, n = couple(found, split, now, 1e-13)
        assert n <= 3
        assert_allclose(now.near, direct[step + 1].near, atol=1e-11)
    assert abs(float(now.work)) < 1e-10 * split.energy(start)


@pytest.mark.parametrize("mass_ratio", [0.1, 1.0, 10.0])
def test_exchanges_with_a_compliance_of_another_integrator(mass_ratio: float) -> None:
    """The compliance takes the far side for one implicit Euler step where it takes ten substeps."""
    split, start = grid_bar(6, 2, mass_ratio, 10, 0.05)
    found = fixed_point(split)
    now, counts = start, []
    for _ in range(60):
        now, n = couple(found, split, now, 1e-6, compliance(split, integrate_far_as=1))
        counts.append(n)
    assert np.abs(split.gap(now)).max() <= 1e-6
    assert max(counts) <= 8
    assert np.mean(counts[20:]) <= 4.0


def test_good_prediction_saves_exchanges() -> None:
    """A smooth motion, exact compliance: two exchanges a step where the last multiplier alone is known."""
    split, start = grid_bar(6, 2, 1.0, 1, 0.004)
    means = []
    for forgets in (True, False):
        found = fixed_point(split)
        now, total = start, 0
        for _ in range(150):
            if forgets:
                found = fixed_point(split, first=found.last)
            now, n = couple(found, split, now, 1e-5)
            total += n
        means.append(total / 150)
    assert means[0] > 1.9
    assert means[1] < 1.7


def test_a_compliance_that_says_nothing_is_asked_for_again() -> None:
    split, _ = grid_bar(6, 2, 1.0, 10, 0.05)
    found = fixed_point(split)
    found.begin(split.step)
    for nothing in (np.full((12, 12), np.nan), np.zeros((12, 12))):
        found.set_compliance(nothing)
        assert found.asks
    found.set_compliance(compliance(split))
    assert not found.asks
    found.next(np.zeros((4, 3)), np.ones((4, 3)))
    found.next(np.zeros((4, 3)), np.full((4, 3), 0.6))  # more than half is left
    assert found.asks
