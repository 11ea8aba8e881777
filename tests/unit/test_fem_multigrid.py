"""Matrices that are not factored: products, coarse grid and conjugate gradients against dense linear algebra."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block, tofu
from numpy.typing import NDArray

from softseam_services.body.build import build_body
from softseam_services.body.region import build_region, shared_nodes
from softseam_services.fem import model as fem_model
from softseam_services.fem.kernels.elements import add_cell_tangents
from softseam_services.fem.kernels.fronts import add_diagonal
from softseam_services.fem.kernels.multigrid import (
    BLOCK_JACOBI,
    MULTIGRID,
    SWEEPS,
    coarse_matrix,
    conjugate_gradients,
    prepare,
)
from softseam_services.fem.kernels.sparse import product
from softseam_services.fem.model import FemModel, build_model
from softseam_services.fem.tree import Tree
from softseam_services.fem.work import Work, build_work

Matrix = NDArray[np.float64]


def _problem(case: str, kind: int = MULTIGRID) -> tuple[FemModel, Tree, Work, Matrix]:
    counts = (3, 3, 1) if case == "ring" else (3, 2, 2)
    size = (0.01 * counts[0], 0.01 * counts[1], 0.01 * counts[2])
    fixed = [{"min": (-1.0, -1.0, -1.0), "max": (-size[0] / 2, 1.0, 1.0)}] if case == "clamped" else []
    body = build_body(block(size, 0.01, body={"fixed": fixed}), {})
    cells = np.arange(body.n_cells, dtype=np.int32)
    if case == "ring":
        cells = cells[(body.cell_grid[:, :2] != 1).any(axis=1)]
    region = build_region(
        body, cells, shared_nodes(body, cells, np.setdiff1d(np.arange(body.n_cells, dtype=np.int32), cells))
    )
    model, tree = build_model(body, region, solution=kind)
    work = build_work(model, tree, 0)
    x = model.x_rest @ (np.eye(3) + 0.02 * np.random.default_rng(4).standard_normal((3, 3)))
    add_diagonal(tree, work.values, model.mass, 1e6)
    add_cell_tangents(x, model, tree, work, False)
    return model, tree, work, _dense(tree, work.values)


def _dense(tree: Tree, values: Matrix) -> Matrix:
    n = 3 * int(np.count_nonzero(tree.position >= 0))
    dense = np.zeros((n, n))
    for _, n_own, n_all, _, offset, row in tree.meta[:, :6]:
        dofs = (3 * tree.rows[row : row + n_all][:, None] + np.arange(3)).ravel()
        panel = values[offset : offset + 9 * n_own * n_all].reshape(3 * n_own, 3 * n_all).T
        dense[np.ix_(dofs, dofs[: 3 * n_own])] += np.tril(panel)
    return np.tril(dense) + np.tril(dense, -1).T


def _prolongation(work: Work, n_free: int) -> Matrix:
    grid = work.grid
    matrix = np.zeros((3 * n_free, len(grid.b)))
    for node in range(n_free):
        for e in range(grid.up_ptr[node], grid.up_ptr[node + 1]):
            for i in range(3):
                matrix[3 * node + i, 3 * grid.up_node[e] + i] = grid.up_share[e]
    return matrix


@pytest.mark.parametrize("case", ["free", "clamped", "ring"])
def test_the_coarse_matrix_is_the_projected_one(case: str) -> None:
    """P^T A P, and what the sparse product gives is A x."""
    model, tree, work, dense = _problem(case)
    x = np.random.default_rng(1).standard_normal(len(dense))
    y = np.empty_like(x)
    product(tree, work.values, x, y)
    np.testing.assert_allclose(y, dense @ x, atol=1e-12 * np.abs(dense).max())
    p = _prolongation(work, len(dense) // 3)
    assert prepare(tree, work.values, False, work.seam_stiffness, model.order[model.seam], work.grid)
    coarse_matrix(tree, work.values, work.grid)
    np.testing.assert_allclose(
        _dense(work.grid.tree, work.grid.values), p.T @ dense @ p, atol=1e-12 * np.abs(dense).max()
    )
    if case == "free":
        np.testing.assert_allclose(p.sum(axis=1), 1.0, rtol=1e-14)


@pytest.mark.parametrize("kind", [MULTIGRID, BLOCK_JACOBI, SWEEPS])
@pytest.mark.parametrize("case", ["free", "clamped", "ring"])
def test_iterations_solve_what_a_dense_factor_solves(case: str, kind: int) -> None:
    model, tree, work, dense = _problem(case, kind)
    n_seam = 3 * len(model.seam)
    seam_at = model.order[model.seam]
    coupled = n_seam > 0
    if coupled:
        # another body of the same kind at the other side of the seam: its Schur complement
        dofs = (3 * seam_at[:, None] + np.arange(3)).ravel()
        rest = np.setdiff1d(np.arange(len(dense)), dofs)
        across = dense[np.ix_(rest, dofs)]
        condensed = dense[np.ix_(dofs, dofs)] - across.T @ np.linalg.solve(dense[np.ix_(rest, rest)], across)
        work.seam_stiffness[:] = 0.5 * (condensed + condensed.T)
        dense[np.ix_(dofs, dofs)] += work.seam_stiffness
    assert prepare(tree, work.values, coupled, work.seam_stiffness, model.order[model.seam], work.grid)
    b = np.random.default_rng(3).standard_normal(len(dense))
    x = b.copy()
    iterations = conjugate_gradients(
        tree, work.values, work.grid, coupled, work.seam_stiffness, seam_at, 1e-9, x, work.ints
    )
    assert 0 < iterations < {MULTIGRID: 40, SWEEPS: 200, BLOCK_JACOBI: 500}[kind]
    expected = np.linalg.solve(dense, b)
    np.testing.assert_allclose(x, expected, atol=1e-6 * np.abs(expected).max())


def test_an_early_end_keeps_the_sum_of_forces() -> None:
    """After few iterations the residual is large, but its sum over the nodes of a free body is zero."""
    model, tree, work, dense = _problem("free")
    none = np.zeros(0, dtype=np.int32)
    assert prepare(tree, work.values, False, work.seam_stiffness, model.order[model.seam], work.grid)
    b = np.random.default_rng(3).standard_normal(len(dense))
    x = b.copy()
    assert conjugate_gradients(tree, work.values, work.grid, False, work.seam_stiffness, none, 0.1, x, work.ints) > 0
    left = b - dense @ x
    assert np.abs(left).max() > 1e-3
    assert np.abs(left.reshape(-1, 3).sum(axis=0)).max() < 1e-10 * np.abs(left).sum()


def test_an_indefinite_matrix_is_reported() -> None:
    model, tree, work, _ = _problem("free")
    add_diagonal(tree, work.values, model.mass, -1e10)
    assert not prepare(tree, work.values, False, work.seam_stiffness, model.order[model.seam], work.grid)


@pytest.mark.parametrize("seam", [False, True])
def test_a_squeeze_is_the_same_either_way(seam: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Contact with friction, and the compliance of a seam: as with a factor, within the tolerance of the iteration."""

    def squeeze() -> tuple[FemRun, Any]:
        parts: dict[str, Any] = {}
        if seam:
            parts["cells"] = lambda body: np.flatnonzero(body.cell_grid[:, 1] == 0).astype(np.int32)
            parts["seam"] = lambda body, own: shared_nodes(
                body, own, np.setdiff1d(np.arange(body.n_cells, dtype=np.int32), own)
            )
        run = FemRun(tofu(models={"fem": {"tolerance": 1e-7}}), **parts)
        run.run(0.1, CLOSE)
        return run, run.step(CLOSE, compliance=seam)

    factored, one = squeeze()
    monkeypatch.setattr(fem_model, "MOST_FACTORED", 0)
    iterated, two = squeeze()
    assert iterated.solver._stepper._tree.kind == MULTIGRID and factored.solver._stepper._tree.kind == 0
    np.testing.assert_allclose(iterated.x, factored.x, atol=1e-6 * 0.025)
    np.testing.assert_allclose(two.wrench, one.wrench, atol=2e-3 * np.abs(one.wrench).max())
    if seam:
        np.testing.assert_allclose(two.compliance, one.compliance, atol=1e-3 * np.abs(one.compliance).max())
