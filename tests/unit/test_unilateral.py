"""Rows that press: complementarity to rounding, whatever presses first, and when the active set cycles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_coupling.loops import unilateral
from softseam_coupling.loops.coupled_part import CoupledPart
from softseam_coupling.loops.unilateral import Unilateral

Floats = NDArray[np.float64]


def system(rng: np.random.Generator, n_rows: int, n_hold: int) -> tuple[Floats, Floats, Floats]:
    """Normals (c, 3), of which the last hold, a positive definite W (3c, 3c) and q (c, 3)."""
    normal = rng.normal(size=(n_rows, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal[n_rows - n_hold :] = 0.0
    half = rng.normal(size=(3 * n_rows, 3 * n_rows))
    return normal, half @ half.T + 0.1 * np.eye(3 * n_rows), rng.normal(size=(n_rows, 3))


@pytest.mark.kernels
@pytest.mark.parametrize("most", [50, 0])
@pytest.mark.parametrize("seed", range(8))
def test_rows_press_or_are_open_and_the_others_hold(seed: int, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """By active sets, and by sweeps alone."""
    monkeypatch.setattr(unilateral, "MOST", most)
    normal, w, q = system(np.random.default_rng(seed), 9, 3)
    found = Unilateral(normal).solve(w, q)
    left = q + (w @ found.reshape(-1)).reshape(-1, 3)
    size, presses = np.abs(q).max(), normal.any(axis=1)
    assert np.abs(left[~presses]).max() < 1e-8 * size
    p, s = (np.einsum("ck,ck->c", normal, each)[presses] for each in (found, left))
    assert p.min() >= 0.0 and s.min() > -1e-8 * size and np.abs(p * s).max() < 1e-8 * size
    assert np.abs(found[presses] - p[:, None] * normal[presses]).max() < 1e-12
    assert 0 < (p > 0.0).sum() < presses.sum()


@pytest.mark.kernels
@pytest.mark.parametrize("most", [50, 0])
@pytest.mark.parametrize("seed", range(8))
def test_rows_with_friction_stick_or_slide(seed: int, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """By Newton's method, and by sweeps alone: what sticks stays, what slides goes against its force, at the bound."""
    monkeypatch.setattr(unilateral, "MOST", most)
    rng = np.random.default_rng(100 + seed)
    normal, w, q = system(rng, 9, 2)
    q = q - normal  # most of them press
    w += 4.0 * np.eye(27)
    mu = np.where(np.arange(9) < 6, rng.uniform(0.1, 1.5, 9), 0.0)
    rows = Unilateral(normal, mu)
    found = rows.solve(w, q)
    left = q + (w @ found.reshape(-1)).reshape(-1, 3)
    size, force, presses = np.abs(q).max(), np.abs(found).max(), normal.any(axis=1)
    p, s = (np.einsum("ck,ck->c", normal, each) for each in (found, left))
    t, r = (each - along[:, None] * normal for each, along in ((found, p), (left, s)))
    assert np.abs(left[~presses]).max() < 1e-8 * size
    assert p[presses].min() >= 0.0 and s[presses].min() > -1e-8 * size
    assert np.abs((p * s)[presses]).max() < 1e-8 * size * force
    across, moved = np.linalg.norm(t, axis=1)[presses], np.linalg.norm(r, axis=1)[presses]
    bound = (mu * p)[presses]
    assert (across <= bound * (1.0 + 1e-9) + 1e-12 * force).all()
    sticks = across < bound * (1.0 - 1e-6)
    assert moved[sticks].max(initial=0.0) < 1e-8 * size
    slides = ~sticks & (bound > 1e-9 * force)
    against = np.einsum("ck,ck->c", t[presses], r[presses])
    np.testing.assert_allclose(against[slides], -(across * moved)[slides], atol=1e-8 * size * force)
    np.testing.assert_allclose(rows.allowed(found), found, atol=1e-12 * force)
    assert np.abs(rows.left(left, found)).max() < 1e-8 * size


def test_some_of_them_stick_and_some_slide() -> None:
    """In the systems of the test above."""
    stuck = slid = 0
    for seed in range(8):
        rng = np.random.default_rng(100 + seed)
        normal, w, q = system(rng, 9, 2)
        q = q - normal  # most of them press
        mu = np.where(np.arange(9) < 6, rng.uniform(0.1, 1.5, 9), 0.0)
        found = Unilateral(normal, mu).solve(w + 4.0 * np.eye(27), q)
        p = np.einsum("ck,ck->c", normal, found)
        across = np.linalg.norm(found - p[:, None] * normal, axis=1)
        rubs = (mu > 0.0) & (p > 0.0)
        stuck += int((across[rubs] < (1.0 - 1e-6) * (mu * p)[rubs]).sum())
        slid += int((across[rubs] >= (1.0 - 1e-6) * (mu * p)[rubs]).sum())
    assert stuck >= 3 and slid >= 3


def test_what_pulls_or_goes_across_is_not_allowed() -> None:
    one = Unilateral(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))
    forces = np.array([[1.0, 2.0, 3.0], [1.0, 0.0, -3.0], [1.0, 2.0, -3.0]])
    np.testing.assert_array_equal(one.allowed(forces), [[0, 0, 3], [0, 0, 0], [1, 2, -3]])


def test_what_is_left_of_an_open_row_is_what_overlaps() -> None:
    one = Unilateral(np.tile([0.0, 0.0, 1.0], (3, 1)))
    gaps = np.array([[5.0, 0.0, 0.1], [0.0, 0.0, 0.2], [0.0, 0.0, -0.3]])
    forces = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(one.left(gaps, forces), [[0, 0, 0.1], [0, 0, 0], [0, 0, -0.3]])


@pytest.mark.parametrize("as_root", [True, False])
def test_a_part_adds_what_its_own_rows_yield(as_root: bool) -> None:
    """B H B^T, of rows of which some act on other parts, or all do."""
    rng = np.random.default_rng(5)
    root, weights = rng.normal(size=(12, 7)), rng.normal(size=(5, 4))
    weights[[1, 3]] = weights[:, 2] = 0.0
    for rows in (weights, np.zeros((5, 4))):
        part = CoupledPart(rows, 0.0, root=root) if as_root else CoupledPart(rows, 0.0, compliance=root @ root.T)
        spread = np.kron(rows, np.eye(3))
        found = np.eye(15)
        part.add_row_compliance(found)
        np.testing.assert_allclose(found, np.eye(15) + spread @ root @ root.T @ spread.T, atol=1e-12)
