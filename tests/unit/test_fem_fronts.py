"""Nested dissection and the multifrontal factor against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from fem_run import block
from numpy.typing import NDArray

from softseam_services.body.build import build_body
from softseam_services.body.region import build_region, shared_nodes
from softseam_services.fem.answers import root_of
from softseam_services.fem.kernels.cells import add_cell_tangents
from softseam_services.fem.kernels.fronts import add_diagonal, factor, seam_inverse, solve
from softseam_services.fem.model import FemModel
from softseam_services.fem.parameters import FemParameters
from softseam_services.fem.structures import build_tables
from softseam_services.fem.tree import Tree
from softseam_services.fem.work import Work, build_work

pytestmark = pytest.mark.kernels

CASES = ["one_cell", "clamped", "two_columns", "ring", "wide", "slab"]
"""wide and slab: panels beyond NARROW columns, and a seam as wide"""


def _problem(case: str) -> tuple[FemModel, FemParameters, Work, NDArray[np.float64]]:
    """Model, tree, work with the matrix assembled, and the same matrix dense in elimination order."""
    counts = {
        "one_cell": (1, 1, 1),
        "clamped": (3, 2, 2),
        "two_columns": (3, 1, 2),
        "ring": (3, 3, 1),
        "wide": (4, 4, 2),
        "slab": (3, 3, 2),
    }[case]
    size = (0.01 * counts[0], 0.01 * counts[1], 0.01 * counts[2])
    fixed = [{"min": (-1.0, -1.0, -1.0), "max": (-size[0] / 2, 1.0, 1.0)}] if case == "clamped" else []
    body = build_body(block(size, 0.01, body={"fixed": fixed}), {})
    cells = np.arange(body.n_cells, dtype=np.int32)
    if case == "two_columns":
        cells = cells[body.cell_grid[:, 0] != 1]
    if case == "ring":
        cells = cells[(body.cell_grid[:, :2] != 1).any(axis=1)]
    if case == "slab":
        cells = cells[body.cell_grid[:, 2] == 0]
    others = np.setdiff1d(np.arange(body.n_cells, dtype=np.int32), cells)
    region = build_region(body, cells, shared_nodes(body, cells, others))
    model, parameters = build_tables(body, region)
    tree = model.tree
    work = build_work(model, parameters, 0)
    rng = np.random.default_rng(4)
    x = parameters.x_rest @ (np.eye(3) + 0.05 * rng.standard_normal((3, 3)))
    add_diagonal(tree, work.values, parameters.mass, 1e7)
    add_cell_tangents(x, model, parameters, tree, work, False)
    return model, parameters, work, dense_of(model, tree, work)


def dense_of(model: FemModel, tree: Tree, work: Work) -> NDArray[np.float64]:
    n_free = np.count_nonzero(tree.position >= 0)
    dense = np.zeros((3 * n_free, 3 * n_free))
    for first, n_own, n_all, _, offset, row, *_ in tree.meta:
        dofs = (3 * tree.rows[row : row + n_all][:, None] + np.arange(3)).ravel()
        panel = np.tril(work.values[offset : offset + 9 * n_own * n_all].reshape(3 * n_own, 3 * n_all).T)
        dense[np.ix_(dofs, dofs[: 3 * n_own])] += panel
        assert np.array_equal(tree.rows[row : row + n_own], np.arange(first, first + n_own))
    return np.tril(dense) + np.tril(dense, -1).T


@pytest.mark.parametrize("case", CASES)
def test_solve_equals_dense(case: str) -> None:
    """Residual of the factored solve at rounding, relative to the matrix."""
    model, _, work, dense = _problem(case)
    tree = model.tree
    assert factor(tree, work.values, work.factoring) == 0
    b = np.random.default_rng(0).standard_normal(len(dense))
    x = b.copy()
    solve(tree, work.values, x, work.factoring)
    np.testing.assert_allclose(x, np.linalg.solve(dense, b), rtol=1e-9, atol=1e-12 * np.abs(x).max())


@pytest.mark.parametrize("case", ["two_columns", "ring", "slab"])
def test_last_fronts_hold_the_seam(case: str) -> None:
    """The last front is the seam's Schur complement, also of two components."""
    model, _, work, dense = _problem(case)
    tree = model.tree
    n = 3 * len(model.seam)
    assert n > 0
    assert factor(tree, work.values, work.factoring) == 0
    inverse = np.empty((n, n))
    seam_inverse(tree, work.values, work.seam_block, inverse, work.ints)
    dofs = (3 * tree.position[model.seam][:, None] + np.arange(3)).ravel()
    expected = np.linalg.inv(dense)[np.ix_(dofs, dofs)]
    np.testing.assert_allclose(inverse, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("n_asked", [1, 5, 17])
def test_nodes_anywhere_answer_by_rows_of_the_inverse(case: str, n_asked: int) -> None:
    """Also where more are asked for than there are unknowns below them, in any order."""
    model, _, work, dense = _problem(case)
    tree, free = model.tree, np.flatnonzero(model.tree.position >= 0).astype(np.int32)
    assert factor(tree, work.values, work.factoring) == 0
    nodes = np.random.default_rng(n_asked).permutation(free)[:n_asked]
    root = root_of(model._replace(seam=nodes), work, np.arange(n_asked, dtype=np.int32))
    dofs = (3 * tree.position[nodes][:, None] + np.arange(3)).ravel()
    expected = np.linalg.inv(dense)[np.ix_(dofs, dofs)]
    np.testing.assert_allclose(root @ root.T, expected, atol=1e-9 * np.abs(expected).max())


def test_every_free_node_is_eliminated_once() -> None:
    tree = _problem("clamped")[0].tree
    free = tree.position[tree.position >= 0]
    assert sorted(free) == list(range(len(free)))
    assert np.count_nonzero(tree.position < 0) == 25


def test_components_without_a_seam_have_trees_of_their_own() -> None:
    body = build_body(block((0.03, 0.01, 0.02), 0.01), {})
    cells = np.flatnonzero(body.cell_grid[:, 0] != 1).astype(np.int32)
    tree = build_tables(body, build_region(body, cells, np.zeros(0, dtype=np.int32))).model.tree
    assert np.count_nonzero(tree.meta[:, 3] < 0) == 2


def test_an_indefinite_matrix_is_reported() -> None:
    model, parameters, work, _ = _problem("clamped")
    tree = model.tree
    add_diagonal(tree, work.values, parameters.mass, -1e10)
    assert factor(tree, work.values, work.factoring) > 0
