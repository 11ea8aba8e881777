"""Conjugate gradients, by which the study of FEM's factor is judged, solve what a dense solver solves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from conjugate_gradients import Floats, compressed, conjugate_gradients, incomplete_cholesky, substitute
from scipy.sparse import csr_array, kron, tril

pytestmark = pytest.mark.kernels

LINE = np.diag(np.full(12, 2.1)) - np.eye(12, k=1) - np.eye(12, k=-1)
PLANE = csr_array(kron(LINE, np.eye(12)) + kron(np.eye(12), LINE))


def test_incomplete_cholesky_of_a_chain_is_complete() -> None:
    """Its factor fills nothing in: one substitution is the answer."""
    lower, b = compressed(csr_array(np.tril(LINE))), np.arange(1.0, 13.0)
    assert incomplete_cholesky(lower, 0.0)
    x = b.copy()
    substitute(lower, x)
    np.testing.assert_allclose(x, np.linalg.solve(LINE, b), rtol=1e-12)


@pytest.mark.parametrize("kind", ["none", "jacobi", "incomplete_cholesky"])
def test_they_solve_a_plane_and_the_factor_saves_iterations(kind: str) -> None:
    lower = compressed(csr_array(tril(PLANE)))
    assert incomplete_cholesky(lower, 0.0)
    b = np.random.default_rng(0).standard_normal(144)

    def by_factor(r: Floats) -> Floats:
        z = r.copy()
        substitute(lower, z)
        return z

    def by_diagonal(r: Floats) -> Floats:
        return np.asarray(r / PLANE.diagonal())

    ways: dict[str, Callable[[Floats], Floats]] = {
        "none": np.copy,
        "jacobi": by_diagonal,
        "incomplete_cholesky": by_factor,
    }
    x, iterations = conjugate_gradients(compressed(PLANE), b, ways[kind], 1e-12)
    np.testing.assert_allclose(x, np.linalg.solve(PLANE.toarray(), b), rtol=1e-9)
    assert iterations < (25 if kind == "incomplete_cholesky" else 60)


def test_an_indefinite_matrix_has_no_factor() -> None:
    assert not incomplete_cholesky(compressed(csr_array(np.tril(LINE - 1.5 * np.eye(12)))), 0.0)
