"""Which time integrator may meet which coupling scheme: the scan of the documents; bad pairs also diverge in time."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from analysis.linear_study.gravouil_combescure import GravouilCombescure
from analysis.linear_study.integrators import LinearSide
from analysis.linear_study.position_constant import PositionConstant
from analysis.linear_study.prakash_hjelmstad import PrakashHjelmstad
from analysis.linear_study.split import Scheme, Split, spectral_radius
from analysis.linear_study.velocity_constant import VelocityConstant

POSITION, VELOCITY = PositionConstant(), VelocityConstant()
PH, GC = PrakashHjelmstad(), GravouilCombescure()
RATIOS, STEPS, SUBSTEPS = (0.01, 0.1, 1.0, 10.0, 99.0), (0.002, 0.02, 0.1, 0.3, 0.7, 2.0), (1, 3, 20)
Case = tuple[float, float, float, int]


def _split(near: str, case: Case) -> Split:
    mass, stiffness, step, substeps = case
    period = 2.0 * np.pi * np.sqrt((mass + 1.0) / (stiffness + 1.0))
    return Split(
        LinearSide(np.array([[mass]]), np.array([[stiffness]]), np.array([[1.0]])),
        LinearSide(np.eye(1), np.eye(1), -np.eye(1)),
        step * period,
        near,
        "implicit_euler",
        substeps,
    )


def _worst(scheme: Scheme, near: str) -> tuple[float, Case]:
    cases = itertools.product(RATIOS, RATIOS, STEPS, SUBSTEPS)
    return max((spectral_radius(scheme, _split(near, case)) - 1.0, case) for case in cases)


@pytest.mark.parametrize(
    ("scheme", "near"),
    [
        (POSITION, "implicit_euler"),
        (POSITION, "midpoint"),
        (POSITION, "theta"),
        *itertools.product((PH,), ("implicit_euler", "midpoint", "theta", "bdf2", "newmark", "generalised_alpha")),
        *itertools.product((GC,), ("implicit_euler", "bdf2", "newmark")),
    ],
)
def test_good_pairs_never_grow(scheme: Scheme, near: str) -> None:
    grown, case = _worst(scheme, near)
    assert grown < 1e-12, case


@pytest.mark.parametrize(
    ("scheme", "near", "at_least"),
    [
        (POSITION, "bdf2", 0.04),
        (POSITION, "newmark", 0.2),
        (POSITION, "generalised_alpha", 0.002),
        (GC, "midpoint", 0.1),
        (GC, "theta", 0.1),
        *itertools.product((VELOCITY,), ("implicit_euler", "midpoint", "theta", "bdf2", "newmark"), (2.0,)),
    ],
)
def test_bad_pairs_grow_and_diverge_in_time(scheme: Scheme, near: str, at_least: float) -> None:
    """Failing controls: the worst case of the scan grows, and a run of it from rest gains energy without bound."""
    grown, case = _worst(scheme, near)
    assert grown > at_least
    split = _split(near, case)
    state = split.init(np.ones(1), np.zeros(1), np.ones(1), np.zeros(1), np.zeros(1))
    start = split.energy(state)
    for _ in range(int(np.ceil(np.log(1e12) / np.log1p(grown)))):
        state = scheme.step(split, state)
    assert split.energy(state) > 1e3 * start
