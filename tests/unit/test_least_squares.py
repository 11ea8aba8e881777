"""Gauss-Newton's method on models whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from softseam_studies.fit.least_squares import Floats, fit, not_told

T = np.linspace(0.0, 1.0, 40)


def _decay(p: Floats) -> tuple[Floats, Floats]:
    """p_0 exp(-p_1 t) and its derivatives."""
    e = np.exp(-p[1] * T)
    return p[0] * e, np.stack([e, -p[0] * T * e], axis=1)


def _wide(n: int) -> tuple[Floats, Floats]:
    return np.full(n, 1e-3), np.full(n, 1e3)


def test_numbers_are_found_exactly_from_clean_data() -> None:
    answer = fit(_decay, _decay(np.array([5.0, 2.0]))[0], np.array([1.0, 0.5]), *_wide(2), ["a", "b"], 20)
    np.testing.assert_allclose(answer.values, [5.0, 2.0], rtol=1e-6)
    assert answer.settled and answer.runs <= 10 and answer.residual < 1e-6


def test_standard_errors_are_those_of_linear_regression_and_cover() -> None:
    """y = p_0 + p_1 t: s^2 (J^T J)^-1 in closed form; in 200 draws two of them hold the truth in about 95 %."""
    J = np.stack([np.ones_like(T), T], axis=1)
    random, truth, held = np.random.default_rng(1), np.array([2.0, 3.0]), 0
    for _ in range(200):
        measured = J @ truth + 0.1 * random.standard_normal(len(T))
        answer = fit(lambda p: (J @ p, J), measured, np.array([1.0, 1.0]), *_wide(2), ["a", "b"], 20)
        best, rest, *_ = np.linalg.lstsq(J, measured, rcond=None)
        expected = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * rest[0] / (len(T) - 2))
        np.testing.assert_allclose(answer.values, best, rtol=1e-3)
        np.testing.assert_allclose(answer.errors, expected, rtol=1e-3)
        held += abs(answer.values[1] - truth[1]) < 2.0 * answer.errors[1]
    assert 0.9 < held / 200 < 0.99


def test_a_number_that_changes_nothing_is_named_and_stays() -> None:
    def model(p: Floats) -> tuple[Floats, Floats]:
        return p[0] * T, np.stack([T, np.zeros_like(T)], axis=1)

    answer = fit(model, 3.0 * T, np.array([1.0, 7.0]), *_wide(2), ["a", "b"], 10)
    assert answer.untold == {1: "the curve does not change with it"}
    np.testing.assert_allclose(answer.values, [3.0, 7.0], rtol=1e-6)
    assert np.isnan(answer.errors[1]) and not np.isnan(answer.errors[0])


def test_numbers_that_act_alike_are_named() -> None:
    alike = np.stack([T, 2.0 * T + 1e-6 * T**2, np.ones_like(T)], axis=1)
    ((number, why),) = not_told(alike, T, ["a", "b", "c"]).items()
    assert number == 1 and "as it does with a:" in why


def test_a_bound_holds_and_the_others_go_on() -> None:
    low, high = np.array([1e-3, 1e-3]), np.array([4.0, 1e3])
    answer = fit(_decay, _decay(np.array([5.0, 2.0]))[0], np.array([1.0, 0.5]), low, high, ["a", "b"], 30)
    assert answer.at_bound == (0,) and answer.values[0] == 4.0
    best = min(
        np.linspace(1.0, 2.0, 2001), key=lambda b: float(np.sum((4.0 * np.exp(-b * T) - 5.0 * np.exp(-2.0 * T)) ** 2))
    )
    assert answer.values[1] == pytest.approx(best, abs=2e-3)


def test_runs_are_bounded() -> None:
    answer = fit(_decay, _decay(np.array([5.0, 2.0]))[0], np.array([0.01, 0.01]), *_wide(2), ["a", "b"], 3)
    assert answer.runs == 3 and not answer.settled
