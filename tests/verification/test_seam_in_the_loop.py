"""The seam solver driving two marching sides, as an orchestrator does, against closed forms and direct solves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from softseam_coupling.schemes.constant_multiplier import answer, march
from softseam_coupling.schemes.integrators import LinearSide, propagate
from softseam_coupling.schemes.position_constant import PositionConstant
from softseam_coupling.schemes.split import Split, SplitState, run
from softseam_coupling.seam import Outcome, SeamSolver
from softseam_coupling.seam_state import SeamState

Floats = NDArray[np.float64]


def compliance(split: Split, integrate_far_as: int | None = None) -> Floats:
    """H_near + H_far of a macro step [m/N]; optionally with another number of substeps on the far side."""
    m = split.substeps if integrate_far_as is None else integrate_far_as
    far = split.far_propagator if m == split.substeps else propagate(split.far, split.far_integrator, split.step / m)
    near_x = answer(split.near_propagator, split.substeps_near)[: split.near.n]
    return split.near.link @ near_x + split.far.link @ answer(far, m)[: split.far.n]


def couple(
    solver: SeamSolver, state: SeamState, split: Split, now: SplitState, most: int = 20
) -> tuple[SplitState, int]:
    """One macro step; the new state and the exchanges it took."""
    lambda_ = solver.predict(state)
    for n in range(1, most + 1):
        flat = lambda_.ravel()
        near, work_near = march(split.near, split.near_propagator, now.near, split.substeps_near, now.lambda_, flat)
        far, work_far = march(split.far, split.far_propagator, now.far, split.substeps, now.lambda_, flat)
        after = SplitState(near, far, flat, now.work + work_near + work_far)
        reply = solver.update(state, lambda_, split.gap(after).reshape(-1, 3))
        if reply.outcome is Outcome.ACCEPT:
            solver.commit(state, lambda_)
            return after, n
        lambda_ = reply.lambda_
    raise AssertionError("the seam did not close")


def grid_bar(
    n_cells: int, cut: int, mass_ratio: float, substeps: int, step: float, stiffness_ratio: float = 1.0
) -> tuple[Split, SplitState]:
    """A lattice of 2 x 2 chains of springs in three directions, clamped at one end, cut at a layer: 4 seam nodes.

    mass_ratio: density of the near part over that of the far part; stiffness_ratio likewise.
    It starts with a uniform velocity.
    """

    def part(layers: int, density: float) -> tuple[Floats, Floats]:
        n = 4 * (layers + 1)
        mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
        for layer in range(layers):
            for c in range(4):
                nodes = [4 * layer + c, 4 * layer + 4 + c]
                mass[nodes, nodes] += 0.5 * density
                stiffness[np.ix_(nodes, nodes)] += 400.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
                across = [4 * layer + 4 + c, 4 * layer + 4 + (c + 1) % 4]
                stiffness[np.ix_(across, across)] += 150.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        eye = np.eye(3)
        return np.asarray(np.kron(mass, eye)), np.asarray(np.kron(stiffness, np.diag([1.0, 0.4, 0.3])))

    near_mass, near_stiffness = part(cut, mass_ratio)
    far_mass, far_stiffness = part(n_cells - cut, 1.0)
    near_mass, near_stiffness = (
        near_mass[12:, 12:],
        stiffness_ratio * near_stiffness[12:, 12:],
    )  # the first layer is clamped
    n_near, n_far = len(near_mass), len(far_mass)
    near = LinearSide(near_mass, near_stiffness, np.eye(12, n_near, n_near - 12))
    far = LinearSide(far_mass, far_stiffness, -np.eye(12, n_far))
    split = Split(near, far, step, "implicit_euler", "implicit_euler", substeps)
    rng = np.random.default_rng(3)
    kick = rng.normal(size=12)
    v_near, v_far = np.tile(kick, n_near // 12), np.tile(kick, n_far // 12)
    return split, split.init(np.zeros(n_near), v_near, np.zeros(n_far), v_far, np.zeros(12))


def test_exact_compliance_equals_the_direct_scheme() -> None:
    split, start = grid_bar(6, 2, 1.0, 10, 0.05)
    solver = SeamSolver(tolerance=1e-13)
    state = solver.init(4)
    solver.reset(state, compliance(split))
    direct = run(PositionConstant(), split, start, 40)
    now = start
    for step in range(40):
        now, n = couple(solver, state, split, now)
        assert n <= 3
        assert_allclose(now.near, direct[step + 1].near, atol=1e-11)
    assert abs(float(now.work)) < 1e-10 * split.energy(start)


@pytest.mark.parametrize("mass_ratio", [0.1, 1.0, 10.0])
def test_exchanges_with_a_compliance_of_another_integrator(mass_ratio: float) -> None:
    """The compliance takes the far side for one implicit Euler step where it takes ten substeps."""
    split, start = grid_bar(6, 2, mass_ratio, 10, 0.05)
    solver = SeamSolver(tolerance=1e-6)
    state = solver.init(4)
    solver.reset(state, compliance(split, integrate_far_as=1))
    now, counts = start, []
    for _ in range(60):
        now, n = couple(solver, state, split, now)
        counts.append(n)
    assert np.abs(split.gap(now)).max() <= 1e-6
    assert max(counts) <= 8
    assert np.mean(counts[20:]) <= 4.0


def test_good_prediction_saves_exchanges() -> None:
    """A smooth motion, exact compliance: constant prediction needs two exchanges a step, the best candidates one."""
    split, start = grid_bar(6, 2, 1.0, 1, 0.004)
    means = {}
    for predictor in ("constant", "auto"):
        solver = SeamSolver(tolerance=1e-5, predictor=predictor)
        state = solver.init(4)
        solver.reset(state, compliance(split))
        now, total = start, 0
        for _ in range(150):
            now, n = couple(solver, state, split, now)
            total += n
        means[predictor] = total / 150
    assert means["constant"] > 1.9
    assert means["auto"] < 1.1


@pytest.mark.parametrize(("substeps", "mass_ratio"), [(10, 1.0), (20, 9.0)])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.08])
def test_spring_damps_the_sawtooth(substeps: int, mass_ratio: float, share: float) -> None:
    """Free masses with the spring eps: (a + eps) r^2 + (b - a - 2 eps) r + eps = 0, in units of dT^2,

    a = 1/m_near + s/m_far, b = 1/m_near + 1/m_far, s = (m + 1)/(2 m): the roots of lambda(n+1) = r lambda(n).
    """
    eye = np.eye(3)
    near = LinearSide(mass_ratio * eye, 0.0 * eye, eye)
    far = LinearSide(eye, 0.0 * eye, -eye)
    split = Split(near, far, 1.0, "implicit_euler", "implicit_euler", substeps)
    a = 1.0 / mass_ratio + 0.5 * (substeps + 1) / substeps
    b = 1.0 / mass_ratio + 1.0
    assert_allclose(compliance(split), a * eye, atol=1e-13)
    solver = SeamSolver(tolerance=1e-14, regularisation=share, spring_gap=np.inf)
    state = solver.init(1)
    solver.reset(state, compliance(split))
    now = split.init(np.zeros(3), np.ones(3), np.zeros(3), np.zeros(3), np.zeros(3))
    lambdas = []
    for _ in range(12):
        now, _ = couple(solver, state, split, now)
        lambdas.append(now.lambda_[0])
    eps = share * a
    for earlier, middle, later in zip(lambdas[1:], lambdas[2:], lambdas[3:], strict=False):
        assert_allclose((a + eps) * later + (b - a - 2.0 * eps) * middle + eps * earlier, 0.0, atol=1e-12)
    assert_allclose(split.gap(now), -eps * now.lambda_, atol=1e-13)


def test_spring_gap_is_bounded() -> None:
    solver = SeamSolver(tolerance=1e-9, regularisation=0.1, spring_gap=1e-6)
    state = solver.init(1, np.array([[100.0, 0.0, 0.0]]))
    solver.reset(state, 1e-3 * np.eye(3))
    solver.predict(state)
    assert_allclose(state.spring, 1e-8)
