"""Sweeps of the product's distances over a chain: their spectral radius, the omega it suggests, and what that gains.
On sheets no omega gains anything.

XPBD solves A dlambda = -(C + alpha~ lambda), A = J W J^T + alpha~ (Macklin, Mueller and Chentanez 2016); a sweep is one
of Gauss-Seidel. On a line A is constant: of m springs between equal masses w it has 2 w + alpha~ on its diagonal and -w
beside it, so that Jacobi's iteration has the spectral radius
    rho = 2 w cos(pi/(m + 1))/(2 w + alpha~),                                                                      (1)
Gauss-Seidel's rho^2, and over-relaxation omega - 1 with omega = 2/(1 + sqrt(1 - rho^2)) (Young 1954; the chapter's
9.3.4). The kernel over-relaxes where its inverse denominators are multiplied by omega.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from particle_run import G, ParticleRun, particle_scene
from spring_sweeps import SpringSweeps

from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.particles.batches import batches
from softseam_services.pbd.particles.kernels import distance

Floats = NDArray[np.float64]
SPRINGS = 40


class Chain:
    """m springs of length 1 and alpha~ = soft between m + 1 particles of weight 1 along x; all sweeps at one omega."""

    def __init__(self, soft: float, omega: float = 1.0) -> None:
        pairs = np.stack([np.arange(SPRINGS), np.arange(SPRINGS) + 1], axis=1).astype(np.int32)
        self.made = batches(SPRINGS + 1, pairs)
        self.soft = soft
        self.rest = self.made.lanes(np.ones(SPRINGS), 1.0)
        self.softs, self.inverse = (np.zeros(self.rest.shape) for _ in range(2))
        self.xw = np.zeros((SPRINGS + 9, 4))
        self.xw[: SPRINGS + 1, 0], self.xw[: SPRINGS + 1, 3] = np.arange(SPRINGS + 1), 1.0
        compliance = self.made.lanes(np.full(SPRINGS, soft))
        distance.prepare_distances(self.xw, self.made.nodes, compliance, 1.0, 0.0, self.inverse, self.softs)
        self.inverse *= omega
        self.lam = np.zeros(self.rest.shape)

    def sweep(self) -> float:
        """Norm of C + alpha~ lambda after one more sweep [m]."""
        work = np.zeros(distance.N_WORK)
        distance.project_distances(work, self.xw, self.made.nodes, self.rest, self.inverse, self.softs, self.lam)
        length = np.diff(self.xw[: SPRINGS + 1, 0])
        return float(np.linalg.norm(length - 1.0 + self.soft * self.made.back(self.lam)))


def radius(soft: float, omega: float = 1.0) -> float:
    """Measured: by what a sweep shrinks the residual, while it falls from 1e-9 to 1e-12 m."""
    chain = Chain(soft, omega)
    chain.xw[: SPRINGS + 1, 0] += 1e-3 * np.random.default_rng(0).standard_normal(SPRINGS + 1)
    residuals = [chain.sweep() for _ in range(1000)]
    assert residuals[-1] < 1e-12, "a thousand sweeps do not end"
    late = [residual for residual in residuals if 1e-12 < residual < 1e-9]
    return float((late[-1] / late[0]) ** (1.0 / (len(late) - 1)))


def jacobi(soft: float) -> float:
    """Eq. (1)."""
    return float(2.0 * np.cos(np.pi / (SPRINGS + 1)) / (2.0 + soft))


def best(of_jacobi: float) -> float:
    """omega of Young's formula."""
    return float(2.0 / (1.0 + np.sqrt(1.0 - of_jacobi**2)))


@pytest.mark.parametrize("soft", [0.02, 0.1, 0.5])
def test_a_sweep_shrinks_the_residual_by_the_square_of_jacobis_radius(soft: float) -> None:
    """So that the radius of the product's own sweeps, measured, suggests omega: 2/(1 + sqrt(1 - rho_GS))."""
    measured = radius(soft)
    assert measured == pytest.approx(jacobi(soft) ** 2, rel=3e-3)
    assert best(np.sqrt(measured)) == pytest.approx(best(jacobi(soft)), rel=5e-3)


@pytest.mark.parametrize("soft", [0.02, 0.1, 0.5])
def test_over_relaxed_sweeps_shrink_it_by_omega_less_one(soft: float) -> None:
    """Within 8 %: the eigenvalue is double, so that the residual of sweep k falls as k (omega - 1)^k. A larger or a
    smaller omega is worse."""
    omega = best(jacobi(soft))
    found = radius(soft, omega)
    assert found == pytest.approx(omega - 1.0, rel=0.08)
    assert found < radius(soft, omega - 0.1) and found < radius(soft, omega + 0.1)


def sag(stiffness: float, substeps: int, sweeps: int, omega: float = 1.0) -> float:
    """Of the chain hung by its first particle under g = 0.04, over the true one, after 200 steps with a drag of 0.04.

    Lengths of a spring, times of a step: a spring's stiffness then is k dt^2/m, and alpha~ is substeps^2 over that.
    """
    chain, h, v = Chain(substeps**2 / stiffness, omega), 1.0 / substeps, np.zeros(SPRINGS + 1)
    chain.xw[0, 3] = 0.0
    x = chain.xw[: SPRINGS + 1, 0]
    for _ in range(200 * substeps):
        start = x.copy()
        v[1:] += h * 0.04
        x[1:] += h * v[1:]
        chain.lam[:] = 0.0
        for _ in range(sweeps):
            chain.sweep()
        v = (x - start) / (h * (1.0 + 0.04 * h))
    true = 0.04 * SPRINGS * (SPRINGS + 1) / (2.0 * stiffness)
    return float((x[-1] - SPRINGS) / true)


def test_what_over_relaxation_gains_and_costs() -> None:
    """64 sweeps a step of a rope whose k dt^2/m is 533: of 40 spacings of 25 mm and 7.5 g with E A = 1 kN, in 10 ms.

    As 64 substeps it is 13 % too long, as 8 substeps of 8 sweeps more than 50 %, with these over-relaxed 5 %. But omega
    depends on substep, stiffness and shape; and a hundred times as stiff, 4 over-relaxed sweeps in each of 4 substeps,
    unfinished as they are, give the rope energy until it flies apart.
    """
    omega = {soft: best(jacobi(soft)) for soft in (64.0 / 533.0, 16.0 / 53300.0)}
    short = sag(533.0, 64, 1) - 1.0
    swept = sag(533.0, 8, 8) - 1.0
    relaxed = sag(533.0, 8, 8, omega[64.0 / 533.0]) - 1.0
    assert short == pytest.approx(0.13, abs=0.02) and swept > 0.5
    assert 0.0 < relaxed < short / 2.0
    assert abs(sag(53300.0, 4, 4, omega[16.0 / 53300.0])) > 10.0 * abs(sag(53300.0, 4, 4))


def hanging(**own: object) -> ParticleBody:
    """1 kN or 1 kN/m, 0.3 kg/m or kg/m^2, by its upper end."""
    top = {"min": (-1.0, -1.0, 0.4999), "max": (1.0, 1.0, 1.0)}
    return ParticleRun(particle_scene({"density": 0.3, "stretch": 1e3, "fixed": [top], **own})).body


def left(body: ParticleBody, substep: float, sweeps: int) -> dict[str, float]:
    """Of the residual, after so many sweeps of each kind."""
    ways = ("gauss_seidel", "sor", "jacobi", "chebyshev")
    return {way: SpringSweeps(body, substep, G).after(way, sweeps) for way in ways}


def test_what_a_rope_gains_depends_on_sweeps_and_substep() -> None:
    """Sixteen sweeps in a short substep: over-relaxed they leave a hundredth of what Gauss-Seidel's do, Chebyshev's a
    fifth. In a long one they leave more. Jacobi's always do."""
    rope = hanging(kind="rope", length=1.0, divisions=40, rotation=(0.0, np.pi / 2, 0.0))
    short, long = left(rope, 0.00125, 16), left(rope, 0.01, 16)
    assert short["sor"] < 0.01 * short["gauss_seidel"] and short["chebyshev"] < 0.2 * short["gauss_seidel"]
    assert long["sor"] > 2.0 * long["gauss_seidel"] and long["chebyshev"] > 1.5 * long["gauss_seidel"]
    assert all(found["jacobi"] > found["gauss_seidel"] for found in (short, long))


def test_on_a_sheet_gauss_seidel_is_best() -> None:
    """Its springs can be ordered in no consistent way: Jacobi's radius is 2.9, so that there is no omega by eq. (1);
    1.3 is slower than 1; Chebyshev's polynomials grow, as the directions of springs change between sweeps."""
    sheet = hanging(kind="sheet", size=(1.0, 1.0), divisions=(30, 30), rotation=(np.pi / 2, 0.0, 0.0))
    spectrum = SpringSweeps(sheet, 0.01, G).spectrum
    assert spectrum.jacobi > 2.5 and spectrum.omega is None
    found = left(sheet, 0.01, 16)
    assert found["sor"] > found["gauss_seidel"] < found["jacobi"]
    assert found["chebyshev"] > 1.0
