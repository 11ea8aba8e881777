"""The integrators' kernels on one oscillator: their own difference equations, and how fast they damp."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_services.fem.integrators import bdf2, generalised_alpha, midpoint
from softseam_services.fem.integrators.scheme import (
    BDF2,
    GENERALISED_ALPHA,
    IMPLICIT_EULER,
    MIDPOINT,
    Scheme,
    begin,
    finish,
)

pytestmark = pytest.mark.kernels

EULER = Scheme(IMPLICIT_EULER, np.ones(1), 0)
BACKWARD = Scheme(BDF2, np.ones(1), bdf2.N_HISTORY)
TRAPEZOIDAL = Scheme(GENERALISED_ALPHA, generalised_alpha.trapezoidal(), generalised_alpha.N_HISTORY)
STEPS = (0.02, 0.03, 0.01, 0.025, 0.02, 0.04)
SQUARE = 30.0  # w^2 [1/s^2]


def theta(radius: float) -> Scheme:
    return Scheme(MIDPOINT, np.array([midpoint.theta(radius)]), 0)


def alpha(radius: float) -> Scheme:
    return Scheme(GENERALISED_ALPHA, generalised_alpha.parameters(radius), generalised_alpha.N_HISTORY)


def march(
    scheme: Scheme, square: float, steps: tuple[float, ...], x0: float = 1.0, v0: float = 0.5
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """x, v and the first array of the history of x'' = -w^2 x, from x0, v0."""
    x, v = np.full((1, 3), x0), np.full((1, 3), v0)
    history, past = np.zeros((scheme.n_history, 1, 3)), 0.0
    path = [(x0, v0, 0.0)]
    for dt in steps:
        x_hat, v_next, history_next = np.empty((1, 3)), np.empty((1, 3)), np.zeros_like(history)
        inertia, share = begin(scheme, dt, past, x, v, history, x_hat)
        # inertia (x1 - x_hat) = -w^2 (x + share (x1 - x))
        end = (inertia * x_hat - square * (1.0 - share) * x) / (inertia + square * share)
        finish(scheme, dt, past, x, v, history, end, v_next, history_next)
        x, v, history, past = end, v_next, history_next, dt
        path.append((x[0, 0], v[0, 0], history[0, 0, 0] if len(history) else 0.0))
    columns = np.array(path).T
    return columns[0], columns[1], columns[2]


def test_implicit_euler() -> None:
    x, v, _ = march(EULER, SQUARE, STEPS)
    np.testing.assert_allclose(np.diff(x), v[1:] * STEPS, rtol=1e-11)
    np.testing.assert_allclose(np.diff(v), -SQUARE * x[1:] * STEPS, rtol=1e-11)


@pytest.mark.parametrize("radius", [0.0, 0.5, 1.0])
def test_midpoint(radius: float) -> None:
    x, v, _ = march(theta(radius), SQUARE, STEPS)
    t = 1.0 / (1.0 + radius)
    np.testing.assert_allclose(np.diff(x), (v[:-1] + t * np.diff(v)) * STEPS, rtol=1e-11)
    np.testing.assert_allclose(np.diff(v), -SQUARE * (x[:-1] + t * np.diff(x)) * STEPS, rtol=1e-11)


def test_bdf2_with_uneven_steps() -> None:
    """The derivative at the end of the parabola through three values, by Lagrange's formula."""
    x, v, _ = march(BACKWARD, SQUARE, STEPS)
    for n in range(2, len(x)):
        h, k = STEPS[n - 1], STEPS[n - 2]
        weights = np.array([h / (k * (h + k)), -(h + k) / (h * k), (2.0 * h + k) / (h * (h + k))])
        assert weights @ x[n - 2 : n + 1] == pytest.approx(v[n], rel=1e-10)
        assert weights @ v[n - 2 : n + 1] == pytest.approx(-SQUARE * x[n], rel=1e-10)


@pytest.mark.parametrize(("scheme", "af"), [(alpha(0.0), 0.0), (alpha(0.6), 0.375), (TRAPEZOIDAL, 0.0)])
def test_generalised_alpha(scheme: Scheme, af: float) -> None:
    x, v, a = march(scheme, SQUARE, STEPS)
    _, am, beta, gamma = scheme.parameters
    dt = np.array(STEPS[1:])
    x0, x1, v0, v1, a0, a1 = x[1:-1], x[2:], v[1:-1], v[2:], a[1:-1], a[2:]
    np.testing.assert_allclose(x1, x0 + dt * v0 + dt**2 * ((0.5 - beta) * a0 + beta * a1), rtol=1e-11)
    np.testing.assert_allclose(v1, v0 + dt * ((1.0 - gamma) * a0 + gamma * a1), rtol=1e-10)
    np.testing.assert_allclose((1.0 - am) * a1 + am * a0, -SQUARE * ((1.0 - af) * x1 + af * x0), rtol=1e-10)


@pytest.mark.parametrize("scheme", [BACKWARD, TRAPEZOIDAL, alpha(0.5)])
def test_the_first_step_is_midpoint(scheme: Scheme) -> None:
    x, v, _ = march(scheme, SQUARE, (0.02,))
    expected = march(theta(1.0), SQUARE, (0.02,))
    np.testing.assert_array_equal((x, v), expected[:2])


@pytest.mark.parametrize("radius", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("family", [theta, alpha])
def test_radius_is_what_is_left_of_fast_oscillations(family: Callable[[float], Scheme], radius: float) -> None:
    """w dt = 1e4: the amplitude falls by the radius each step (generalised-alpha: a double root, n radius^n,
    so 1/n more)."""
    n = 40
    x, v, _ = march(family(radius), 1e8, (1.0,) * n)
    size = np.sqrt(1e8 * x**2 + v**2)
    rate = size[n] / size[n - 1]
    assert rate == pytest.approx(radius, rel=0.05)


def test_what_is_left_of_slow_oscillations() -> None:
    """w dt = 0.1, 100 steps: |amplification|^n of each scheme's characteristic polynomial."""
    z, n = 0.1j, 100
    roots = {
        "bdf2": (BACKWARD, max(abs(np.roots([1.5 - z, -2.0, 0.5])))),
        "midpoint": (theta(0.5), abs((1.0 + z / 3.0) / (1.0 - z / 1.5))),
        "euler": (EULER, abs(1.0 / (1.0 - z))),
        "trapezoidal": (TRAPEZOIDAL, 1.0),
    }
    for name, (scheme, root) in roots.items():
        x, v, _ = march(scheme, 0.01, (1.0,) * n, x0=1.0, v0=0.0)
        size = np.sqrt(0.01 * x**2 + v**2)
        assert size[n] / size[2] == pytest.approx(root ** (n - 2), rel=0.01), name
