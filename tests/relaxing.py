"""A point of a material that relaxes, taken through steps, and integrals to hold it beside."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softseam_protocol.scene.materials import material_spec
from softseam_services.body.materials import build_material, with_state

Floats = np.ndarray
MU, BULK = 9e3, 90e3
YOUNG, POISSON = 9.0 * BULK * MU / (3.0 * BULK + MU), (3.0 * BULK - 2.0 * MU) / (6.0 * BULK + 2.0 * MU)
TWO, ALL = ((0.45, 0.08), (0.30, 1.5)), ((0.6, 0.05), (0.4, 2.0))
"""branches of the two cases"""
CASES = json.loads(Path(__file__).with_name("relaxation_cases.json").read_text())
"""by integration of the differential equation with tight tolerances (scipy, 1e-10), of bars whose sides are free: of
mu, K and TWO squeezed by 25 % in .4 s and held; of ALL squeezed by 20 % at rates"""


YIELDING_CASES = json.loads(Path(__file__).with_name("yielding_cases.json").read_text())
"""by roots of one equation a leg of its way, of bars whose sides are free: nominal stress along it [Pa] and equivalent
plastic strain at five stretches a leg"""


def said(branches: Sequence[tuple[float, float]]) -> list[dict[str, float]]:
    """As a scene has them."""
    return [{"share": share, "time": time} for share, time in branches]


class Point:
    """A point of the material, from rest on."""

    def __init__(self, branches: Sequence[tuple[float, float]], kind: str = "neo_hookean", **own: Any) -> None:
        values: dict[str, Any] = {"kind": kind, "young": YOUNG, "poisson": POISSON, "density": 1e3}
        if branches:
            values["relaxation"] = said(branches)
        spec = material_spec(values | own)
        self.material = build_material(spec)
        self.state = np.zeros(self.material.n_state)
        self.stored = self.dissipated = 0.0

    def respond(self, F: Floats, dt: float, definite: bool = False) -> tuple[float, float, Floats, Floats, Floats]:
        P, A, following = np.empty((3, 3)), np.empty((9, 9)), np.empty_like(self.state)
        law = self.material.respond, np.ascontiguousarray(F), self.state.copy(), dt, self.material.parameters
        psi, lost = with_state.respond(*law, P, A, following, definite)
        alone = np.empty((3, 3))
        with_state.stress_at_end(*law, alone, np.empty((9, 9)), np.empty_like(self.state))
        np.testing.assert_allclose(alone, P, atol=1e-10 * MU)
        return psi, lost, P, A, following

    def go(self, F: Floats, dt: float) -> Floats:
        self.stored, lost, P, _, self.state = self.respond(F, dt)
        self.dissipated += lost
        assert lost >= 0.0
        for own in self.state[6 : len(self.state) // 6 * 6].reshape(-1, 6):
            x, y, z, s, t, u = own
            assert np.linalg.det([[1.0 + x, u, t], [u, 1.0 + y, s], [t, s, 1.0 + z]]) == pytest.approx(1.0, abs=1e-10)
        return P

    @property
    def slipped(self) -> float:
        """Equivalent plastic strain."""
        return float(self.state[-1])

    def pull(self, stretch: float, dt: float) -> float:
        """Nominal stress along z with the sides free."""
        side, begun, across = getattr(self, "side", 1.0), self.state, 1.0
        for _ in range(30):
            _, _, P, A, _ = self.respond(np.diag([side, side, stretch]), dt)
            across = P[0, 0] / (A[0, 0] + A[0, 4])
            side -= across
            if abs(across) < 1e-14:
                break
        np.testing.assert_array_equal(begun, self.state)
        self.side = side
        return float(self.go(np.diag([side, side, stretch]), dt)[2, 2])

    def carry(self, stress: float, dt: float) -> float:
        """The stretch along z under a nominal stress that is held, the sides free."""
        side, stretch = getattr(self, "side", 1.0), getattr(self, "stretch", 1.0)
        for _ in range(30):
            _, _, P, A, _ = self.respond(np.diag([side, side, stretch]), dt)
            matrix = [[A[0, 0] + A[0, 4], A[0, 8]], [A[8, 0] + A[8, 4], A[8, 8]]]
            change = np.linalg.solve(matrix, [P[0, 0], P[2, 2] - stress])
            side, stretch = side - change[0], stretch - change[1]
            if np.abs(change).max() < 1e-14:
                break
        self.side, self.stretch = side, stretch
        self.go(np.diag([side, side, stretch]), dt)
        return float(stretch)
