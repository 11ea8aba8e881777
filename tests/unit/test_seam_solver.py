"""The seam solver alone: linear and slightly nonlinear seams given by a compliance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from softseam_coupling.kernels.extrapolate import NAMES, WEIGHTS
from softseam_coupling.seam import Outcome, SeamSolver
from softseam_coupling.seam_state import SeamState

Floats = NDArray[np.float64]


def seam(n_nodes: int, seed: int = 0, condition: float = 100.0) -> tuple[Floats, Floats]:
    """A random compliance with the given condition number, and the multiplier that closes its gap."""
    rng = np.random.default_rng(seed)
    basis, _ = np.linalg.qr(rng.normal(size=(3 * n_nodes, 3 * n_nodes)))
    h = (basis * np.geomspace(1.0, 1.0 / condition, 3 * n_nodes)) @ basis.T
    return 0.5 * (h + h.T), rng.normal(size=(n_nodes, 3))


def linear(h: Floats, target: Floats) -> Callable[[Floats], Floats]:
    return lambda lambda_: (h @ (lambda_ - target).ravel()).reshape(-1, 3)


def perturbed(h: Floats, error: float, seed: int = 1) -> Floats:
    """L (I + E) L^T with h = L L^T and E symmetric of spectral norm `error`."""
    e = np.random.default_rng(seed).normal(size=h.shape)
    e += e.T
    lower = np.linalg.cholesky(h)
    return lower @ (np.eye(len(h)) + error * e / np.linalg.norm(e, 2)) @ lower.T


def exchanges(
    solver: SeamSolver, state: SeamState, answer: Callable[[Floats], Floats], most: int = 50
) -> tuple[int, Floats, list[Outcome]]:
    """One step as the orchestrator takes it; exchanges used, multiplier, outcomes."""
    lambda_ = solver.predict(state)
    outcomes = []
    for n in range(1, most + 1):
        reply = solver.update(state, lambda_, answer(lambda_))
        outcomes.append(reply.outcome)
        if reply.outcome is Outcome.ACCEPT:
            solver.commit(state, lambda_)
            return n, lambda_, outcomes
        lambda_ = reply.lambda_
    raise AssertionError(f"no agreement after {most} exchanges")


@pytest.mark.parametrize("n_nodes", [1, 25, 60])
def test_exact_compliance_needs_one_correction(n_nodes: int) -> None:
    h, target = seam(n_nodes)
    solver = SeamSolver(tolerance=1e-12)
    state = solver.init(n_nodes)
    assert solver.reset(state, h) == 3 * n_nodes
    reply = solver.update(state, solver.predict(state), linear(h, target)(np.zeros((n_nodes, 3))))
    assert reply.outcome is Outcome.AGAIN
    assert_allclose(reply.lambda_, target, atol=1e-11)  # rounding times the condition number
    n, lambda_, _ = exchanges(solver, state, linear(h, target))
    assert n == 2
    assert np.abs(linear(h, target)(lambda_)).max() < 1e-12
    assert_allclose(state.multiplier, lambda_, rtol=1e-15)


def test_a_positive_multiplier_pushes_the_near_side_along_the_axis() -> None:
    """Near lags behind far by 1 mm: the near side has to be pushed forward, by gap/(H_near + H_far)."""
    solver = SeamSolver(tolerance=1e-9)
    state = solver.init(1)
    solver.reset(state, (2e-4 + 3e-4) * np.eye(3))
    gap = np.array([[-1e-3, 0.0, 0.0]])
    assert_allclose(solver.update(state, np.zeros((1, 3)), gap).lambda_, [[2.0, 0.0, 0.0]], rtol=1e-14)


@pytest.mark.parametrize(("error", "most"), [(0.01, 4), (0.1, 6), (0.3, 10)])
def test_wrong_compliance_is_corrected(error: float, most: int) -> None:
    h, target = seam(25)
    start = np.abs(linear(h, target)(np.zeros((25, 3)))).max()
    solver = SeamSolver(tolerance=1e-6 * start)
    state = solver.init(25)
    solver.reset(state, perturbed(h, error))
    n, _, outcomes = exchanges(solver, state, linear(h, target))
    assert n <= most
    assert Outcome.REBUILD not in outcomes


def test_frozen_compliance_contracts_by_its_error() -> None:
    """With B = (L (I + E) L^T)^-1 the error in the norm of H^-1 shrinks by (I + E)^-1 E: at most |E|/(1 - |E|)."""
    h, target = seam(20)
    inverse = np.linalg.inv(h)
    solver = SeamSolver(tolerance=1e-13, noise=np.inf)  # never learn
    state = solver.init(20)
    solver.reset(state, perturbed(h, 0.2))
    lambda_, norms = solver.predict(state), []
    for _ in range(6):
        gap = linear(h, target)(lambda_)
        norms.append(np.sqrt(gap.ravel() @ inverse @ gap.ravel()))
        lambda_ = solver.update(state, lambda_, gap).lambda_
    factors = np.array(norms[1:]) / np.array(norms[:-1])
    assert (factors <= 0.25 + 1e-9).all()
    assert factors[-1] > 0.1  # it really is frozen


def test_corrections_are_kept_across_steps() -> None:
    h, target = seam(4)
    solver = SeamSolver(tolerance=1e-8, predictor="constant")
    state = solver.init(4)
    solver.reset(state, perturbed(h, 0.3))
    rng = np.random.default_rng(5)
    counts = [exchanges(solver, state, linear(h, target + rng.normal(size=(4, 3))))[0] for _ in range(60)]
    assert np.mean(counts[:3]) > 7
    assert np.mean(counts[-10:]) < 4.6


def test_friction_makes_the_seam_unsymmetric() -> None:
    """Neither the metric of the corrections nor the symmetrised compliance needs a symmetric seam."""
    h, target = seam(10)
    skew = np.random.default_rng(2).normal(size=h.shape)
    skew -= skew.T
    lower = np.linalg.cholesky(h)
    unsymmetric = lower @ (np.eye(30) + 0.3 * skew / np.linalg.norm(skew, 2)) @ lower.T
    solver = SeamSolver(tolerance=1e-6)
    state = solver.init(10)
    solver.reset(state, unsymmetric)
    n, lambda_, _ = exchanges(solver, state, linear(unsymmetric, target))
    assert n <= 10
    assert_allclose(lambda_, target, atol=1e-3)


def test_a_seam_that_yields_backwards_is_survived() -> None:
    """Where a correction along s would turn the compliance negative, the pair is damped: B stays finite."""
    solver = SeamSolver(tolerance=1e-9)
    state = solver.init(1)
    solver.reset(state, np.eye(3))
    lambda_ = np.zeros((1, 3))
    for gap in (1.0, 2.0, 5.0, 4.0):  # the answer to a negative multiplier is a growing gap
        before = state.inverse[0, 0]
        reply = solver.update(state, lambda_, np.array([[gap, 0.0, 0.0]]))
        lambda_ = reply.lambda_
        assert 0.0 < state.inverse[0, 0] <= 10.0 * before * (1.0 + 1e-12)


def test_mildly_nonlinear_seam() -> None:
    h, target = seam(10)
    solver = SeamSolver(tolerance=1e-10)
    state = solver.init(10)
    solver.reset(state, h)
    n, lambda_, _ = exchanges(solver, state, lambda a: linear(h, target)(a + 0.02 * a**3))
    assert n <= 10
    assert_allclose(lambda_ + 0.02 * lambda_**3, target, atol=1e-7)


def test_redundant_and_clamped_constraints() -> None:
    """Two constraints on the same node (a cross point) and one on a clamped node: rank n - 6, gap closed elsewhere."""
    h, target = seam(6)
    tie = np.vstack([np.eye(18), np.eye(3, 18, 0), np.zeros((3, 18))])  # node 6 repeats node 0, node 7 is clamped
    wide = tie @ h @ tie.T
    solver = SeamSolver(tolerance=1e-10)
    state = solver.init(8)
    assert solver.reset(state, wide) == 18

    def answer(lambda_: Floats) -> Floats:
        return (tie @ h @ (tie.T @ lambda_.ravel() - target.ravel())).reshape(-1, 3)

    n, lambda_, _ = exchanges(solver, state, answer)
    assert n == 2
    assert_allclose(lambda_[7], 0.0, atol=1e-12)  # nothing pulls where nothing yields
    assert_allclose(lambda_[0], lambda_[6], atol=1e-9)  # least norm: shared equally


def test_tiny_eigenvalues_are_dropped() -> None:
    h, _ = seam(5, condition=1e12)
    solver = SeamSolver(tolerance=1e-9)
    state = solver.init(5)
    eigenvalues = np.geomspace(1.0, 1e-12, 15)
    assert solver.reset(state, h) == np.count_nonzero(eigenvalues > 1e-8)
    assert np.linalg.norm(state.inverse, 2) < 1.1e8


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_bad_numbers_change_nothing(bad: float) -> None:
    h, target = seam(3)
    solver = SeamSolver(tolerance=1e-9)
    state = solver.init(3, target)
    solver.reset(state, h)
    before = state.to_arrays()
    gap = np.zeros((3, 3))
    gap[1, 2] = bad
    reply = solver.update(state, np.zeros((3, 3)), gap)
    assert reply.outcome is Outcome.NOT_FINITE
    assert_array_equal(reply.lambda_, target)
    for name, array in state.to_arrays().items():
        assert_array_equal(array, before[name])
    with pytest.raises(ValueError, match="NaN"):
        solver.reset(state, np.full((9, 9), bad))
    with pytest.raises(ValueError, match="yields"):
        solver.reset(state, np.zeros((9, 9)))
    with pytest.raises(ValueError, match="shape"):
        solver.reset(state, np.eye(8))
    with pytest.raises(ValueError, match="unknown predictor"):
        SeamSolver(tolerance=1e-9, predictor="cubic")


def test_outcomes_follow_kappa() -> None:
    solver = SeamSolver(tolerance=1e-3, slack=10.0, noise=np.inf)
    state = solver.init(1)

    def outcomes(*gaps: float) -> list[Outcome]:
        solver.reset(state, np.eye(3))
        return [solver.update(state, np.zeros((1, 3)), np.array([[gap, 0.0, 0.0]])).outcome for gap in gaps]

    assert outcomes(5e-4) == [Outcome.ACCEPT]
    assert outcomes(5e-3) == [Outcome.AGAIN]
    assert outcomes(1.0, 9e-3) == [Outcome.AGAIN, Outcome.ACCEPT]  # kappa below 0.1, within the slack
    assert outcomes(5e-2, 9e-3) == [Outcome.AGAIN, Outcome.AGAIN]  # kappa 0.18
    assert outcomes(1.0, 0.4, 0.3) == [Outcome.AGAIN, Outcome.AGAIN, Outcome.REBUILD]


def test_a_round_that_made_things_worse_is_taken_back() -> None:
    """A compliance ten times too small overshoots tenfold; the next try starts from the better one and knows more."""
    solver = SeamSolver(tolerance=1e-9)
    state = solver.init(1)
    solver.reset(state, 0.1 * np.eye(3))
    target = np.array([[1.0, 0.0, 0.0]])
    first = solver.update(state, np.zeros((1, 3)), -target)
    assert_allclose(first.lambda_, 10.0 * target)
    second = solver.update(state, first.lambda_, first.lambda_ - target)
    assert second.outcome is Outcome.REBUILD
    assert_allclose(second.lambda_, target, atol=1e-12)


def test_the_next_try_starts_from_the_best_one() -> None:
    h, _ = seam(3)
    solver = SeamSolver(tolerance=1e-9)
    state = solver.init(3)
    solver.reset(state, h)
    rng = np.random.default_rng(8)
    tries = [(rng.normal(size=(3, 3)), size * rng.normal(size=(3, 3))) for size in (3.0, 1.0, 9.0, 5.0)]
    for lambda_, gap in tries:
        reply = solver.update(state, lambda_, gap)
    best_lambda, best_gap = tries[1]
    expected = best_lambda.ravel() - state.inverse @ best_gap.ravel()
    assert_allclose(reply.lambda_.ravel(), expected, rtol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
@settings(deadline=None, max_examples=20)
def test_restored_state_goes_on_bit_for_bit(seed: int, n_nodes: int) -> None:
    h, target = seam(n_nodes, seed)
    solver = SeamSolver(tolerance=1e-7)
    state = solver.init(n_nodes)
    solver.reset(state, perturbed(h, 0.2))
    rng = np.random.default_rng(seed)
    for _ in range(4):
        exchanges(solver, state, linear(h, target + rng.normal(size=target.shape)))
    lambda_ = solver.predict(state)
    solver.update(state, lambda_, linear(h, target)(lambda_))  # also in the middle of a step
    first, second = state, SeamState.from_arrays(state.to_arrays())
    for k in range(4):
        drift = rng.normal(size=target.shape)
        results = []
        for each in (first, second):
            solver.commit(each, lambda_ + 0.01 * k)
            guess = solver.predict(each)
            reply = solver.update(each, guess, linear(h, target + drift)(guess))
            results.append((guess, reply.lambda_, *each.to_arrays().values()))
        for ours, theirs in zip(*results, strict=True):
            assert_array_equal(ours, theirs)


def committed(solver: SeamSolver, values: list[float]) -> SeamState:
    state = solver.init(1)
    solver.reset(state, np.eye(3))
    for value in values:
        solver.commit(state, np.full((1, 3), value))
    return state


@pytest.mark.parametrize("name", NAMES)
def test_predictors_are_exact_for_their_degree_and_damped_ones_hide_a_sawtooth(name: str) -> None:
    degree = {"constant": 0, "linear": 1, "damped linear": 1, "quadratic": 2, "damped quadratic": 2}[name]
    solver = SeamSolver(tolerance=1.0, predictor=name)
    values = [(1.0 + t) ** degree for t in range(6)]
    assert_allclose(solver.predict(committed(solver, values)), 7.0**degree, rtol=1e-13)
    sawtooth = float(solver.predict(committed(solver, [(-1.0) ** t for t in range(6)]))[0, 0])
    gain = {"constant": 1.0, "linear": 3.0, "damped linear": 0.0, "quadratic": 7.0, "damped quadratic": 0.0}[name]
    assert_allclose(abs(sawtooth), gain, atol=1e-14)
    assert_allclose(WEIGHTS[3 * NAMES.index(name), :4].sum(), 1.0, rtol=1e-15)


def test_auto_predictor_does_not_amplify_a_sawtooth_and_follows_smooth_motion() -> None:
    """The next point of a line with a sawtooth of 0.5 on it is 50 + 0.5, what a line through it makes of that 50 - 1.5;
    waves of any period are foretold by the fit of their differences."""
    solver = SeamSolver(tolerance=1.0)
    noisy = committed(solver, [10.0 + 2.0 * t + 0.5 * (-1.0) ** t for t in range(20)])
    assert_allclose(solver.predict(noisy), 50.0 + 0.5, atol=0.1)
    smooth = committed(SeamSolver(tolerance=1e-3), [np.sin(0.1 * t) for t in range(20)])
    assert_allclose(solver.predict(smooth), np.sin(2.0), atol=1e-3)
    jumps = committed(solver, [0.0] * 5 + [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] * 3)
    assert abs(solver.predict(jumps)).max() < 0.5


def test_the_fit_learns_how_a_miss_comes_back() -> None:
    """A closing multiplier that answers misses by -4.5, 7.7 and -4.3 times in the next steps is foretold."""
    echo = np.array([-4.5, 7.7, -4.3])
    solver = SeamSolver(tolerance=1e-3)
    state = solver.init(2)
    solver.reset(state, np.eye(6))
    rng = np.random.default_rng(3)
    misses = np.zeros((3, 6))
    for _ in range(30):
        closing = 5.0 + echo @ misses
        miss = rng.normal(scale=0.1, size=6)
        lambda_ = (closing + miss).reshape(2, 3)
        solver.update(state, lambda_, miss.reshape(2, 3))
        solver.commit(state, lambda_)
        misses = np.vstack((miss, misses[:-1]))
    predicted = solver.predict(state)
    assert state.predictor_name == "fitted"
    assert_allclose(predicted.reshape(-1), 5.0 + echo @ misses, atol=1e-3)


def test_what_is_learned_from_an_accepted_gap() -> None:
    """The history holds what would have closed the gap; a multiplier that was never tried is taken as it is."""
    solver = SeamSolver(tolerance=1.0)
    state = solver.init(1)
    solver.reset(state, 0.5 * np.eye(3))
    lambda_ = np.full((1, 3), 4.0)
    assert solver.update(state, lambda_, np.full((1, 3), 0.1)).outcome is Outcome.ACCEPT
    solver.commit(state, lambda_)
    assert_allclose(state.history[0], 4.0 - 0.1 / 0.5)
    assert_allclose(state.multiplier, lambda_)
    solver.update(state, lambda_, np.full((1, 3), 0.1))
    solver.commit(state, 2.0 * lambda_)
    assert_array_equal(state.history[0], [8.0, 8.0, 8.0])
    assert_array_equal(state.multiplier, 2.0 * lambda_)


def test_empty_seam() -> None:
    solver = SeamSolver(tolerance=1e-9)
    state = solver.init(0)
    assert solver.reset(state, np.zeros((0, 0))) == 0
    lambda_ = solver.predict(state)
    assert solver.update(state, lambda_, np.zeros((0, 3))).outcome is Outcome.ACCEPT
    solver.commit(state, lambda_)
