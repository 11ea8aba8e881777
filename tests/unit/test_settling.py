"""The force that settles the far side: its move, its impulse, and a compliance that is singular."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_coupling.kernels.push import balance, push_far, solve_semidefinite
from softseam_coupling.mortar import SeamTie, stiffness_of
from softseam_coupling.seam import SeamSolver
from softseam_services.orchestrator.seam_loop import SeamLoop
from softseam_services.orchestrator.settling import Settling

Floats = NDArray[np.float64]


def _following(n_nodes: int) -> Floats:
    """Trilinear weights of nodes on a line that follow the two at its ends, for three axes (3 n, 6)."""
    share = np.linspace(0.0, 1.0, n_nodes)
    return np.asarray(np.kron(np.stack([1.0 - share, share], axis=1), np.eye(3)), dtype=np.float64)


def _moment(force: Floats, x: Floats) -> Floats:
    return np.concatenate([force.sum(axis=0), np.cross(x, force).sum(axis=0)])


@pytest.mark.parametrize("mortar", [False, True])
def test_where_nodes_follow_others_the_force_is_as_small_as_the_move(mortar: bool) -> None:
    """H = W H_free W^T has no inverse: the factor of its rounding made forces of 2 kN on a seam of 5 mN."""
    rng = np.random.default_rng(3)
    n = 5
    weights, free = _following(n), 1e-2 * np.diag(rng.uniform(0.5, 1.0, 6))
    compliance = weights @ free @ weights.T
    p = np.eye(n) + 0.1 * rng.standard_normal((n, n))
    tie = SeamTie(p if mortar else None, np.zeros((n, 3)))
    h = tie.far_compliance(compliance)
    settling = Settling(tie, n)
    settling.know(compliance, stiffness_of(h))
    sought = 1e-3 * rng.standard_normal(3 * n)
    given = (h @ sought).reshape(n, 3)
    zero = np.zeros((n, 3))
    force, moved, gap = settling.bend(given, zero, zero, zero, -given, False)
    np.testing.assert_allclose(tie.image(moved), -given, atol=1e-9 * np.abs(given).max())
    assert gap < 1e-9 * np.abs(given).max()
    assert np.linalg.norm(force) < 2.0 * np.linalg.norm(tie.far_force(sought.reshape(n, 3)))


@pytest.mark.parametrize("nodes", [1, 2, 3, 5])
def test_a_force_gets_resultant_and_moment_of_another_at_least_energy(nodes: int) -> None:
    """A single node has no moment, three on a line none about it, and five in space have all six."""
    rng = np.random.default_rng(nodes)
    a = rng.standard_normal((3 * nodes, 3 * nodes))
    stiffness = a @ a.T + np.eye(3 * nodes)
    x = rng.standard_normal((nodes, 3)) if nodes == 5 else np.arange(nodes)[:, None] * np.array([[1.0, 2.0, -1.0]])
    force, wanted = rng.standard_normal((2, nodes, 3))
    before = force.copy()
    balance(force.reshape(-1), wanted.reshape(-1), x.reshape(-1), stiffness)
    np.testing.assert_allclose(_moment(force, x), _moment(wanted, x), atol=1e-9)
    # least energy: what was added is S times a rigid motion, on which every force without resultant does no work
    added = np.linalg.solve(stiffness, (force - before).reshape(-1))
    rigid = np.array([_moment(unit.reshape(nodes, 3), x) for unit in np.eye(3 * nodes)])
    free = np.eye(3 * nodes) - rigid @ np.linalg.pinv(rigid)
    assert np.abs(free @ added).max() < 1e-9


def test_the_gap_that_a_push_leaves_is_that_of_the_moved_sides() -> None:
    rng = np.random.default_rng(4)
    n = 4
    p, compliance, stiffness = rng.standard_normal((n, n)), rng.standard_normal((12, 12)), np.eye(12)
    bent, change, image, x, moved_near = rng.standard_normal((5, 12))
    for matrix in (p, np.zeros((0, 0))):
        tie = SeamTie(matrix if len(matrix) else None, np.zeros((n, 3)))
        force, moved = np.empty((2, 12))
        gap = push_far(
            bent.copy(), False, change, image, stiffness, matrix, compliance.T.copy(), x, moved_near, force, moved
        )
        np.testing.assert_allclose(force.reshape(n, 3), tie.far_force(bent.reshape(n, 3)), atol=1e-12)
        np.testing.assert_allclose(moved, compliance @ force, atol=1e-12)
        left = (x + moved_near - image).reshape(n, 3) - tie.image(moved.reshape(n, 3))
        np.testing.assert_allclose(gap, np.linalg.norm(left, axis=1).max(), rtol=1e-12)


def test_unknowns_that_others_stand_for_are_zero() -> None:
    basis = np.random.default_rng(5).standard_normal((4, 3))
    matrix = basis @ basis.T
    b = matrix @ np.ones(4)
    z = b.copy()
    solve_semidefinite(matrix.copy(), z)
    np.testing.assert_allclose(matrix @ z, b, atol=1e-9)
    assert z[3] == 0.0


def test_after_steps_of_another_length_the_way_of_the_last_is_that_of_a_step() -> None:
    """The kinetic energy of a settled step is told by dt v: of a last part a quarter as long it was a quarter of it."""
    x, way = np.random.default_rng(5).standard_normal((2, 3, 3))
    loop = SeamLoop(SeamSolver(tolerance=1e-6), SeamTie(None, np.zeros((3, 3))), np.ones(9), None, True, 9)
    loop._change(0.01)
    loop.begin(x, way)
    for dt, share in ((0.0025, 0.25), (0.01, 1.0)):
        loop._change(dt)
        before, start = loop._link._settling._x[0]
        np.testing.assert_allclose(start - before, share * way, atol=1e-14)
        np.testing.assert_array_equal(start, x)
