"""GMRES against what numpy solves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_services.fem.kernels.gmres import add_solution, begin_krylov, extend_krylov

pytestmark = pytest.mark.kernels

Floats = NDArray[np.float64]
SIZE = 12


def _solve(matrix: Floats, b: Floats, most: int) -> tuple[Floats, float, Floats]:
    """x after so many iterations, what it says is left of b, and the basis it is found in."""
    basis, h = np.zeros((most + 1, len(b))), np.zeros((most + 1, most + 3))
    left = float(np.linalg.norm(b))
    begin_krylov(b, left, basis, h)
    for n in range(most):
        left = extend_krylov(n, matrix @ basis[n], basis, h)
    x = np.zeros_like(b)
    add_solution(most, basis, h, x)
    return x, left, basis


def _system() -> tuple[Floats, Floats]:
    """A matrix that is not symmetric, its eigenvalues about 1 as with a factor that is nearly right; a right side."""
    random = np.random.default_rng(3)
    return np.eye(SIZE) + 0.2 * random.standard_normal((SIZE, SIZE)), random.standard_normal(SIZE)


def test_with_as_many_iterations_as_unknowns_it_is_exact() -> None:
    matrix, b = _system()
    x, left, _ = _solve(matrix, b, SIZE)
    np.testing.assert_allclose(x, np.linalg.solve(matrix, b), rtol=1e-10)
    assert left < 1e-12


@pytest.mark.parametrize("most", [1, 2, 5])
def test_with_fewer_it_is_the_nearest_in_its_space_and_says_what_is_left(most: int) -> None:
    matrix, b = _system()
    x, left, basis = _solve(matrix, b, most)
    space = basis[:most]
    np.testing.assert_allclose(space @ space.T, np.eye(most), atol=1e-12)
    nearest = space.T @ np.linalg.lstsq(matrix @ space.T, b, rcond=None)[0]
    np.testing.assert_allclose(x, nearest, rtol=1e-9)
    assert left == pytest.approx(np.linalg.norm(b - matrix @ x), rel=1e-10)


def test_a_space_that_ends_early_ends_in_the_solution() -> None:
    """b is an eigenvector: nothing lies beyond it, and no number is lost to 0/0."""
    b = np.eye(SIZE)[0]
    x, left, basis = _solve(np.diag(np.arange(2.0, 2.0 + SIZE)), b, 1)
    np.testing.assert_allclose(x, 0.5 * b, rtol=1e-15)
    assert left == 0.0 and np.isfinite(basis).all()
