"""The seam between light and heavy, soft and stiff; over 1e5 steps; and a wave that passes through it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.lattice import compliance, couple, fixed_point, grid_bar
from analysis.linear_study.integrators import LinearSide
from analysis.linear_study.position_constant import PositionConstant
from analysis.linear_study.split import Scheme, Split, SplitState, amplification, spectral_radius
from analysis.linear_study.staggered import Staggered
from analysis.linear_study.velocity_constant import VelocityConstant

Floats = NDArray[np.float64]
MASSES = (0.01, 0.1, 1.0, 10.0, 100.0)
STIFFNESSES = (1e-3, 1e-1, 1.0, 10.0, 1e3)
SHORT, LONG = 0.005, 0.05
"""against the lattice's shortest period of 0.2"""


def _counts(split: Split, now: SplitState, rough: bool) -> list[int]:
    """Exchanges of 40 steps to a gap of 1e-6, where a free step opens up to 1; rough: the compliance takes the far side
    for one implicit Euler step where it takes ten substeps."""
    found, told = fixed_point(split), compliance(split, 1 if rough else None)
    counts = []
    for _ in range(40):
        now, n = couple(found, split, now, 1e-6, told)
        counts.append(n)
    return counts


@pytest.mark.kernels
@pytest.mark.parametrize("step", [SHORT, LONG])
def test_no_ratio_of_mass_or_stiffness_matters(step: float) -> None:
    """Exact compliance: two exchanges at most, for all 25 pairs. Rough: 7 at most, 4.2 in the mean of the worst."""
    for mass, stiffness in itertools.product(MASSES, STIFFNESSES):
        split, start = grid_bar(6, 2, mass, 10, step, stiffness)
        assert max(_counts(split, start, rough=False)) <= 2, (mass, stiffness)
        rough = _counts(split, start, rough=True)
        assert max(rough) <= 7, (mass, stiffness)
        assert np.mean(rough) < 4.2, (mass, stiffness)


@pytest.mark.parametrize(
    ("mass", "stiffness", "step", "at_least"),
    [(10.0, 1e-3, SHORT, 4.0), (100.0, 1.0, SHORT, 50.0), (0.01, 1e3, LONG, 1000.0), (1.0, 10.0, LONG, 10.0)],
)
def test_staggered_fails(mass: float, stiffness: float, step: float, at_least: float) -> None:
    """The control: every one of these grows, however short the step, by about the ratio a step."""
    split, _ = grid_bar(6, 2, mass, 10, step, stiffness)
    assert spectral_radius(Staggered(), split) > at_least
    assert spectral_radius(PositionConstant(), split) < 1.0 + 1e-12


def test_staggered_is_stable_where_the_near_side_is_light_and_soft() -> None:
    """So that it fails for its reason: here it agrees with the seam that is closed."""
    split, start = grid_bar(6, 2, 0.01, 1, SHORT, 1e-3)
    assert spectral_radius(Staggered(), split) < 1.0 + 1e-12
    one = two = start
    for _ in range(100):
        one, two = Staggered().step(split, one), PositionConstant().step(split, two)
    assert np.abs(one.far - two.far).max() < 0.01 * np.abs(two.far).max()


def _gaps(scheme: Scheme, n_steps: int) -> Floats:
    """Largest gap within each tenth of a run of the split oscillator (m 1, k 4 pi^2, 10 substeps, 50 steps a period),
    with a load on its near half."""
    k = 4.0 * np.pi**2
    far = LinearSide(np.array([[0.5]]), np.array([[0.8 * k]]), -np.eye(1))

    def split(load: float) -> Split:
        near = LinearSide(np.array([[0.5]]), np.array([[0.2 * k]]), np.eye(1), load=np.array([load]))
        return Split(near, far, 0.02, "implicit_euler", "implicit_euler", 10)

    none = np.zeros(1)
    matrix = amplification(scheme, split(0.0))
    loaded = scheme.step(split(3.0), split(3.0).init(none, none, none, none, none))
    share = np.concatenate([loaded.near, loaded.far, loaded.lambda_])
    start = split(0.0).init(np.ones(1), none, np.ones(1), none, none)
    y = np.concatenate([start.near, start.far, start.lambda_])
    worst = np.zeros(n_steps)
    for i in range(n_steps):
        y = matrix @ y + share
        worst[i] = abs(y[0] - y[4])
    return np.asarray(worst.reshape(10, -1).max(axis=1))


def test_the_gap_does_not_drift_in_a_hundred_thousand_steps() -> None:
    """Position continuity: rounding, in the last steps as in the first. Velocity continuity keeps what it opened."""
    assert _gaps(PositionConstant(), 100_000).max() < 1e-14
    assert _gaps(VelocityConstant(), 1_000)[-1] > 1e-3


def _chain(n: int, fine: int, density: float = 1.0) -> tuple[Floats, Floats]:
    """Mass and stiffness of n cells of length 1/fine of a bar with E A = 1 and rho A = density, lumped."""
    length = 1.0 / fine
    mass, stiffness = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    for i in range(n):
        mass[[i, i + 1], [i, i + 1]] += 0.5 * density * length
        stiffness[i : i + 2, i : i + 2] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / length
    return mass, stiffness


def _reflected(fine: int, density: float = 1.0, substeps: int = 4) -> float:
    """Energy of the near part over that of the far part, after a pulse of 20 near nodes a wave has met the seam [1].

    The far part's cells are `fine` times shorter, its bar so many times as heavy.
    """
    n_near, n_far, step = 100, 100, 0.05
    near_mass, near_stiffness = _chain(n_near, 1)
    far_mass, far_stiffness = _chain(fine * n_far, fine, density)
    near = LinearSide(near_mass, near_stiffness, np.eye(1, n_near + 1, n_near))
    far = LinearSide(far_mass, far_stiffness, -np.eye(1, fine * n_far + 1))
    split = Split(near, far, step, "implicit_euler", "implicit_euler", substeps)
    x = np.arange(n_near + 1.0)
    shape = np.exp(-(((x - 60.0) / 15.0) ** 2))
    wave = 2.0 * np.pi / 20.0
    u = shape * np.cos(wave * (x - 60.0))
    v = -np.gradient(u, x, edge_order=2)  # to the right
    state = split.init(u, v, np.zeros(fine * n_far + 1), np.zeros(fine * n_far + 1), np.zeros(1))
    matrix = amplification(PositionConstant(), split)
    y = np.concatenate([state.near, state.far, state.lambda_])
    for _ in range(round(75.0 / step)):
        y = matrix @ y
    return split.near.energy(y[: 4 * (n_near + 1)]) / split.far.energy(y[4 * (n_near + 1) : -1])


@pytest.mark.parametrize(("fine", "most"), [(1, 1e-3), (2, 1e-2)])
def test_a_wave_passes_the_seam(fine: int, most: float) -> None:
    """Reflected energy at 20 coarse nodes a wavelength: below 1 %, for equal cells and for cells half as long."""
    assert _reflected(fine) < most


def test_a_heavier_bar_reflects_what_its_impedance_says() -> None:
    """The measure itself, with a far bar four times as heavy: R = (Z_far - Z_near)/(Z_far + Z_near) with the impedance
    of lumped cells, Z = rho c sqrt(1 - (omega dx/(2 c))^2), where rho c is 1 and 2, c 1 and 1/2."""
    half = np.pi / 20.0
    near, far = np.sqrt(1.0 - half**2), 2.0 * np.sqrt(1.0 - (2.0 * half) ** 2)
    back = ((far - near) / (far + near)) ** 2
    assert _reflected(1, density=4.0, substeps=1) == pytest.approx(back / (1.0 - back), rel=0.03)
