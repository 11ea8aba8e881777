"""The far side's stiffness: learned from pairs, and inverted from its compliance."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from softseam_coupling.inverse import invert_definite
from softseam_coupling.kernels.stiffness import learn_stiffness
from softseam_coupling.mortar import stiffness_of


def definite(n: int, seed: int) -> np.ndarray:
    a = np.random.default_rng(seed).normal(size=(n, n))
    return np.asarray(a @ a.T + 0.1 * n * np.eye(n))


def test_a_pair_is_learned_and_the_stiffness_stays_definite() -> None:
    true, model = definite(9, 1), definite(9, 2)
    rng = np.random.default_rng(3)
    for _ in range(40):
        moved = rng.normal(size=9)
        learn_stiffness(model, moved, true @ moved)
        assert_allclose(model @ moved, true @ moved, rtol=1e-9)
        assert_allclose(model, model.T, atol=1e-10)
        assert np.linalg.eigvalsh(model)[0] > 0.0
    assert_allclose(model, true, rtol=0.05, atol=0.05 * float(np.abs(true).max()))


def test_a_pair_without_resistance_teaches_nothing() -> None:
    model = definite(6, 4)
    before = model.copy()
    moved = np.ones(6)
    for resisted in (np.zeros(6), -before @ moved, 1e-6 * before @ moved):
        learn_stiffness(model, moved, resisted)
        assert_array_equal(model, before)


def test_the_inverse_by_cholesky_is_symmetric_and_refuses_what_is_nearly_singular() -> None:
    matrix = definite(12, 5)
    inverse = invert_definite(matrix, 1e-8)
    assert inverse is not None
    assert_allclose(inverse @ matrix, np.eye(12), atol=1e-12)
    assert_array_equal(inverse, inverse.T)
    assert invert_definite(np.diag([1.0, -1.0]), 1e-8) is None
    assert invert_definite(np.diag([1.0, 1e-9]), 1e-8) is None


def test_directions_that_hardly_yield_are_held_no_stiffer_than_a_millionth() -> None:
    skew = np.array([[0.0, 0.3, 0.0], [-0.3, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert_allclose(stiffness_of(np.diag([2.0, 1.0, 0.0]) + skew), np.diag([0.5, 1.0, 0.5e6]), rtol=1e-12)
    soft = definite(6, 6)
    assert_allclose(stiffness_of(soft), np.linalg.inv(soft), rtol=1e-9)
