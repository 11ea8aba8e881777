"""A light body between plates rings where nothing damps it, and loses friction on the ground: in both models.

FEM in implicit steps of 10 ms damps as a retardation time of 5 ms does, and holds the body more firmly than an elastic
one is held.
"""

from __future__ import annotations

import numpy as np
import pytest
from test_default_cells import squeezed

from softseam.session import open_as_given

HOLD = 0.1
"""[s], at the end of the run"""
XPBD, VISCOUS = "regions={default: pbd}", "body.material.retardation_time=0.005"


def held(step: float, *settings: str) -> float:
    """Mean force of the plates on `bent` over the hold [N]."""
    forces: list[float] = []
    with open_as_given(squeezed("bent"), settings=(f"step={step}", *settings)) as session:
        session.reset()
        session.run(lambda seen: forces.append(seen.grip_force))
    return float(np.mean(forces[-round(HOLD / step) :]))


def test_without_viscosity_short_steps_ring_as_xpbd_does() -> None:
    rings, by_xpbd, damped = held(5e-4), held(0.01, XPBD), held(0.01)
    assert by_xpbd == pytest.approx(rings, rel=0.2)
    assert max(rings, by_xpbd) < 0.75 * damped


def test_with_viscosity_models_and_steps_agree() -> None:
    right = held(1e-3, VISCOUS)
    assert held(0.01, XPBD, VISCOUS) == pytest.approx(right, rel=0.05)
    assert held(0.01, VISCOUS) == pytest.approx(right, rel=0.1)
