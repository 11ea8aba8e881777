"""What rounds teach of the far side's line: exact for what they showed, and a round with it closes both lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.learned_line import keep_new, solve_small
from softseam_coupling.kernels.link import link_round
from softseam_coupling.learned_line import PAIRS, LearnedLine

Floats = NDArray[np.float64]
N = 12


def _inverse(matrix: Floats) -> Floats:
    return np.linalg.inv(matrix).astype(np.float64)


def _definite(seed: int) -> Floats:
    a = np.random.default_rng(seed).standard_normal((N, N))
    return a @ a.T / N + np.eye(N)


def _line(h: Floats) -> LearnedLine:
    line = LearnedLine(N)
    line.renew(h, _inverse(h))
    return line


def _compliance(line: LearnedLine) -> Floats:
    """H' of eq. (1), written out."""
    kept = line.kept
    d, e, along = line.changes[kept], line.defects[kept], line.along[kept]
    return np.asarray(line.h + e.T @ np.linalg.solve(d @ along.T, along))


def _slipping(h: Floats, rank: int) -> Floats:
    """The compliance of a far side that gives way further in so many directions, not symmetrically."""
    rng = np.random.default_rng(5)
    return h + rng.standard_normal((N, rank)) @ rng.standard_normal((rank, N)) * 0.3


def test_pairs_are_met_exactly_and_the_rest_is_left_alone() -> None:
    h = _definite(1)
    true, line, rng = _slipping(h, 3), _line(h), np.random.default_rng(2)
    changes = rng.standard_normal((3, N))
    for change in changes:
        line.learn(change, -true @ change)
    learned = _compliance(line)
    np.testing.assert_allclose(learned @ changes.T, true @ changes.T, atol=1e-12)
    across = np.linalg.svd(changes @ h)[2][3:]  # orthogonal to all changes in the energy
    np.testing.assert_allclose(learned @ across.T, h @ across.T, atol=1e-12)


def test_the_newest_pair_counts_most_and_old_ones_are_forgotten() -> None:
    h = _definite(1)
    true, line, rng = _slipping(h, 3), _line(h), np.random.default_rng(2)
    change = rng.standard_normal(N)
    line.learn(change, -h @ change)
    line.learn(1.01 * change, -1.01 * true @ change)
    assert list(line.kept) == [0]
    np.testing.assert_allclose(_compliance(line) @ change, true @ change, atol=1e-12)
    for _ in range(PAIRS):
        other = rng.standard_normal(N)
        line.learn(other, -h @ other)
    np.testing.assert_allclose(_compliance(line), h, atol=1e-12)


def test_a_change_that_costs_nothing_teaches_nothing() -> None:
    line = _line(_definite(1))
    line.learn(np.ones(N), np.ones(N))
    line.learn(np.zeros(N), np.ones(N))
    assert len(line.kept) == 0


def test_a_new_compliance_keeps_what_rounds_showed() -> None:
    h = _definite(1)
    true, line = _slipping(h, 3), _line(h)
    changes = np.random.default_rng(2).standard_normal((3, N))
    for change in changes:
        line.learn(change, -true @ change)
    newer = _definite(4)
    line.renew(newer, _inverse(newer))
    np.testing.assert_allclose(_compliance(line) @ changes.T, true @ changes.T, atol=1e-12)


def _round(line: LearnedLine, y: Floats, rooted: bool) -> tuple[float, Floats, Floats, Floats]:
    """Gap, dx, lambda and -P dx_far of a round whose answers are random."""
    line.beside(y, rooted)
    x_near, image, anchor, told = np.random.default_rng(7).standard_normal((4, N))
    found = told + line.s @ (anchor - x_near)
    _, _, moved, multiplier, given = out = np.empty((5, N))
    gap, _, _ = link_round(
        *(line.h, line.s, y, rooted, x_near, found, image, anchor, line.h @ told, told),
        *(line.kept, line.changes, line.defects, line.along, line.pushes, line.moves, line.answers, *out),
    )
    # both lines: the near side's yield beside S, and the far side's compliance as it is known
    whole = y @ y.T if rooted else y
    push = line.s @ moved + multiplier - found
    np.testing.assert_allclose(whole @ push, moved, atol=1e-10)
    np.testing.assert_allclose(_compliance(line) @ (multiplier - told), given, atol=1e-10)
    return gap, moved, multiplier, given


def test_a_round_with_what_was_learned_closes_the_gap_of_both_lines() -> None:
    h, softer = _definite(1), _definite(3) + _definite(1)
    true, line = _slipping(h, 2), _line(h)
    y = _inverse(line.s + softer)
    plain = _round(line, y, False)[2]
    for change in np.random.default_rng(2).standard_normal((2, N)):
        line.learn(change, -true @ change)
    gap, moved, multiplier, _ = _round(line, y, False)
    assert gap < 1e-12
    assert np.abs(multiplier - plain).max() > 1e-2
    again = _round(line, np.linalg.cholesky(y).astype(np.float64), True)
    assert again[0] < 1e-12
    np.testing.assert_allclose(again[1], moved, atol=1e-11)


def test_it_goes_on_from_its_array_bit_for_bit() -> None:
    h = _definite(1)
    true, one, rng = _slipping(h, 3), _line(h), np.random.default_rng(2)
    y = np.linalg.cholesky(_inverse(h)).astype(np.float64)
    for change in rng.standard_normal((PAIRS + 2, N)):
        one.learn(change, -true @ change)
    other = LearnedLine(N)
    other.take(one.h, one.s, one.to_array())
    for change in rng.standard_normal((2, N)):
        for line in (one, other):
            line.learn(change, -true @ change)
            line.beside(y, True)
        assert np.array_equal(one.kept, other.kept)
        for name in ("changes", "defects", "along", "pushes", "moves", "answers"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_small_systems_are_solved_and_singular_ones_refused() -> None:
    rng = np.random.default_rng(3)
    matrix, b = rng.standard_normal((4, 4)), rng.standard_normal(4)
    want = np.linalg.solve(matrix, b)
    assert solve_small(matrix.copy(), b)
    np.testing.assert_allclose(b, want, rtol=1e-10)
    assert not solve_small(np.ones((2, 2)), np.ones(2))
    assert solve_small(np.zeros((0, 0)), np.zeros(0))
    assert keep_new(np.zeros((PAIRS, N)), np.zeros((PAIRS, N)), 0, np.zeros(PAIRS, dtype=np.int64)) == 0
