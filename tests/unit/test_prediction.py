"""Predictions from the last steps: exact for polynomials, smooth where steps alternate, kept in a snapshot."""

from __future__ import annotations

import numpy as np
import pytest

from softseam_coupling.prediction import N_KEPT, Prediction

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("steps", [[0.01] * 12, [0.01, 0.0025, 0.0025, 0.005, 0.01, 0.02] * 2])
def test_a_polynomial_in_time_goes_on(order: int, steps: list[float]) -> None:
    """Also where steps are of different lengths."""
    prediction, time = Prediction(2), 0.0
    a = np.random.default_rng(0).standard_normal((order + 1, 2, 3))
    for dt in steps:
        time += dt
        truth = sum(a[power] * (time / 0.1) ** power for power in range(order + 1))
        predicted = prediction.predict(dt)
        prediction.commit(np.asarray(truth), dt)
    np.testing.assert_allclose(predicted, truth, rtol=1e-9, atol=1e-12)


def test_what_alternates_is_not_amplified() -> None:
    """A line with a sawtooth on it: a parabola through three steps misses by eight times the tooth."""
    prediction, missed = Prediction(1), []
    for step in range(40):
        truth = np.full((1, 3), 0.1 * step + (-1.0) ** step * 0.05)
        missed.append(float(np.abs(prediction.predict(0.01) - truth).max()))
        prediction.commit(truth, 0.01)
    assert max(missed[10:]) < 2.1 * 0.05


def test_it_begins_with_what_belongs_to_the_state_and_goes_on_from_its_arrays() -> None:
    first = np.ones((2, 3))
    one, other = Prediction(2, first), Prediction(2)
    np.testing.assert_array_equal(one.predict(0.01), first)
    assert one.known and not other.known
    rng = np.random.default_rng(1)
    for _ in range(N_KEPT + 2):
        one.commit(rng.standard_normal((2, 3)), 0.01)
    other.take(one.to_arrays())
    for _ in range(3):
        np.testing.assert_array_equal(one.predict(0.01), other.predict(0.01))
        new = rng.standard_normal((2, 3))
        one.commit(new, 0.01)
        other.commit(new, 0.01)
