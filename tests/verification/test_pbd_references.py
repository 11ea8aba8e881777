"""PBD against independent codes and closed forms: small errors, and the right rates under refinement of cells.

The whole table is docs/results/xpbd.md, by tests/benchmarks/pbd_errors.py.
"""

from __future__ import annotations

import pytest
from pbd_cases import bar_wave, beam_at_rest, beam_falls, bonded_cube, order


def test_beam_at_rest() -> None:
    """Large deflection: -2.2 % on 2 blocks across, -0.9 % on 4, -0.5 % on 6, faster than linearly."""
    errors = [beam_at_rest(across) for across in (2, 4, 6)]
    assert abs(errors[1]) < 0.012 and abs(errors[2]) < 0.007
    assert 1.2 < order([1 / 2, 1 / 4, 1 / 6], errors) < 2.2


@pytest.mark.parametrize(("squeeze", "limit"), [(0.05, 0.045), (0.15, 0.06)])
def test_bonded_cube(squeeze: float, limit: float) -> None:
    """Singular at its edges, so hardly faster than linearly, and from above: blocks are too stiff, never too soft."""
    errors = [bonded_cube(across, squeeze) for across in (2, 4, 6)]
    assert 0.0 < errors[2] < limit
    assert 1.0 < order([1 / 2, 1 / 4, 1 / 6], errors) < 2.0


def test_beam_let_go() -> None:
    """By the automatic substeps the first lowest tip is as exact as the beam's rest: cells are what is wrong."""
    fall, substeps = beam_falls(4, "auto")
    assert abs(fall) < 0.012
    assert beam_falls(4, 8 * substeps)[0] == pytest.approx(fall, abs=0.003)


def test_pulse_in_a_bar() -> None:
    """On 80 and 160 blocks of 12.5 and 6.25 mm, with 4 substeps a step: the peak, and hardly anything behind it."""
    (coarse, _), (fine, tail) = bar_wave(80, 4), bar_wave(160, 4)
    assert abs(fine) < 0.08 and abs(fine) < 0.8 * abs(coarse)
    assert tail < 0.005
