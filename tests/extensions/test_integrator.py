"""An integrator from outside: Hilber, Hughes and Taylor's alpha, as coefficients of the family that is there.

alpha in [0, 1/3]: internal forces at x1 - alpha (x1 - x0), beta = (1 + alpha)^2/4, gamma = 1/2 + alpha
(Earthquake Eng. Struct. Dyn. 5, 1977).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import softseam
from softseam_protocol.scene import kinds
from softseam_protocol.scene.scene import Scene
from softseam_services.fem.integrators.table import INTEGRATORS, Setting, of_family

ALPHA = 0.3


def hht(setting: Setting):  # type: ignore[no-untyped-def]
    return of_family(1.0 - ALPHA, 0.0, 0.25 * (1.0 + ALPHA) ** 2, 0.5 + ALPHA)


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    kinds.INTEGRATORS.add("hht", kinds.IntegratorFacts())
    INTEGRATORS.add("hht", hht)
    yield
    kinds.INTEGRATORS.remove("hht")
    INTEGRATORS.remove("hht")


YOUNG, DENSITY, LENGTH, STEP = 1e5, 1000.0, 0.1, 0.004
SCENE = {
    "softseam": 1,
    "name": "hht",
    "gravity": [0, 0, 0],
    "step": STEP,
    "duration": 0.6,
    "body": {
        "shape": {"kind": "block", "size": [LENGTH, 0.02, 0.02]},
        "cell": 0.02,
        "material": {"kind": "linear", "young": YOUNG, "poisson": 0.0, "density": DENSITY},
        "fixed": [{"min": [-0.051, -1, -1], "max": [-0.049, 1, 1]}],
        "velocity": [0.01, 0, 0],
    },
    "regions": {"default": "fem"},
    "models": {"fem": {"integrator": "hht"}},
    "probes": {"tip": [0.05, 0, 0.01]},
}


def decay() -> float:
    """Of the slowest axial oscillation, per step: the spectral radius of HHT's amplification at omega dt [1]."""
    square = (0.5 * np.pi * np.sqrt(YOUNG / DENSITY) / LENGTH * STEP) ** 2
    beta, gamma = 0.25 * (1.0 + ALPHA) ** 2, 0.5 + ALPHA
    # unknowns d1, v1, a1 (in units of the step) of d0, v0, a0
    left = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [(1.0 - ALPHA) * square, 0.0, 1.0]])
    right = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma], [-ALPHA * square, 0.0, 0.0]])
    return float(np.abs(np.linalg.eigvals(np.linalg.solve(left, right))).max())


def test_an_integrator_from_outside_decays_as_its_amplification_says() -> None:
    """A bar that starts even and swings along itself: the tip's swings in time, of its slowest mode at last."""
    with softseam.open(Scene.model_validate(SCENE)) as sim:
        sim.reset(seed=0)
        energy = []
        while not sim.done:
            now = sim.step().energies
            energy.append(now["kinetic"] + now["strain"])
    n = len(energy) // 2
    rate = (np.array(energy[n:])[-40:].mean() / np.array(energy[n:])[:40].mean()) ** (0.5 / (len(energy) - n - 40))
    assert rate == pytest.approx(decay(), abs=0.05 * (1.0 - decay()))


def test_an_integrator_without_coefficients_fails_at_start() -> None:
    kinds.INTEGRATORS.add("forgotten", kinds.IntegratorFacts())
    try:
        with pytest.raises(softseam.BadInput, match="table of integrators' coefficients: no row 'forgotten'"):
            softseam.open(Scene.model_validate(SCENE))
    finally:
        kinds.INTEGRATORS.remove("forgotten")
