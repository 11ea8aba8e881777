"""FEM statics against converged solutions of independent codes and closed forms.

Statics are reached by implicit Euler with long steps, which dissipates all motion.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block, tofu

from softseam_protocol.scene.scene import Scene

# Tip uz [m] of the clamped beam 0.1 x 0.02 x 0.02 m, E 100 kPa, rho 1000, under gravity: reference case
# 02_cantilever_static (felupe, CalculiX, dolfinx mixed), uncertainties 0.03 % and 0.08 %.
TIP_02 = {0.3: -0.0345404, 0.495: -0.0337740}


def clamped_beam(
    size: tuple[float, float, float], cell: float | tuple[float, float, float], poisson: float, **keys: Any
) -> Scene:
    clamp = {"min": (-1e-6, -1.0, -1.0), "max": (1e-6, 1.0, 1.0)}
    body = {"position": (size[0] / 2, 0.0, -size[2] / 2), "fixed": [clamp]}
    return block(size, cell, 1e5, poisson, 1000.0, body=body, **keys)


def _settled_tip(run: FemRun, length: float) -> float:
    """uz of the middle of the end face after the motion has died out [m]."""
    tip = np.argmin(np.linalg.norm(run.body.x_rest - np.array([length, 0.0, 0.0]), axis=1))
    for _ in range(40):
        run.step(dt=0.2)
    assert np.abs(run.solver.state.v).max() < 1e-8
    return float(run.x[tip, 2] - run.body.x_rest[tip, 2])


@pytest.mark.parametrize("poisson", [0.3, 0.495])
def test_cantilever_converges_to_the_reference(poisson: float) -> None:
    """Large deflection, also nearly incompressible: within 3 % on 5 x 1 x 1 cells, 1 % on 10 x 2 x 2, no locking."""
    coarse = _settled_tip(FemRun(clamped_beam((0.1, 0.02, 0.02), 0.02, poisson)), 0.1)
    fine = _settled_tip(FemRun(clamped_beam((0.1, 0.02, 0.02), 0.01, poisson)), 0.1)
    expected = TIP_02[poisson]
    assert abs(coarse / expected - 1.0) < 0.03
    assert abs(fine / expected - 1.0) < 0.01
    assert abs(fine - expected) < 0.6 * abs(coarse - expected)


@pytest.mark.parametrize(("cells", "limit"), [(4, 0.025), (8, 0.012)])
def test_scene_a_settles_where_independent_codes_do(cells: int, limit: float) -> None:
    """0.20 x 0.05 x 0.05 m, E 100 kPa, nu 0.40, rho 1000: tip -85.75 mm (CalculiX and felupe)."""
    cell = 0.2 / cells
    tip = _settled_tip(FemRun(clamped_beam((0.2, 0.05, 0.05), (cell, min(cell, 0.05), min(cell, 0.05)), 0.4)), 0.2)
    assert abs(tip / -0.08575 - 1.0) < limit


def test_linear_cantilever_agrees_with_beam_theory() -> None:
    """Small load, slender beam: w = rho g A L^4/(8 E I) + rho g L^2/(2 k G), k = 5/6; clamp: below 2 %."""
    length, width, young, g = 0.2, 0.02, 1e5, 0.01
    run = FemRun(clamped_beam((length, width, width), (0.02, 0.02, 0.02), 0.3, kind="linear", gravity=(0.0, 0.0, -g)))
    shear = young / 2.6
    bending = 1000.0 * g * length**4 / (8.0 * young * width**2 / 12.0)
    expected = -(bending + 1000.0 * g * length**2 / (2.0 * 5.0 / 6.0 * shear))
    assert abs(_settled_tip(run, length) / expected - 1.0) < 0.02


def test_frictionless_squeeze_is_exact() -> None:
    """Plates without friction press uniformly: 2.625, 5.536, 8.798 N at 5, 10, 15 % (closed form), on any mesh."""
    scene = tofu(cell=0.05, friction=0.0, gravity=0.0)
    run = FemRun(scene)
    run.run(0.025, CLOSE)
    for expected in (2.62492, 5.53565, 8.79767):
        run.run(0.0625, CLOSE)
        for _ in range(10):
            reply = run.step(dt=0.02)
        # the ground's share: the cube barely touches it; what is left is the penetration's r g, below 1e-4
        np.testing.assert_allclose([-reply.wrench[1, 0], reply.wrench[2, 0]], expected, rtol=2e-3)
    stress = run.solver.fields(reply.header).cauchy
    np.testing.assert_allclose(stress[..., 0], -3043.58, rtol=5e-3)
    assert np.abs(stress[..., 1:]).max() < 15.0


def test_bonded_plates_on_a_free_ground() -> None:
    """Plates that stick and a smooth ground: 3.35, 7.04, 11.13 N (converged); 2 x 2 x 2 cells within 3 %."""
    run = FemRun(tofu(friction=0.0, gravity=-0.01))
    rough = FemRun(tofu(friction=50.0, ground=0.0, gravity=-0.01))
    rough.run(0.025, CLOSE)
    for expected in (3.35, 7.04, 11.13):
        reply = rough.run(0.0625, CLOSE)[-1]
        assert abs(reply.wrench[2, 0] / expected - 1.0) < 0.03
    assert reply.extras["penetration"] < 2e-5
    assert run.solver.n_nodes == 125
