"""The study's loops with parts whose answers are known: what three parts agree on, and how a loop goes on."""

from __future__ import annotations

import numpy as np
import pytest
from known_parts import TOLERANCE, Chain, part, seam

from analysis.rows import ACCELERATED, ROWS
from softseam_coupling.loops import LOOPS
from softseam_coupling.loops.loop import largest

pytestmark = pytest.mark.kernels


def row(scheme: str, weights: np.ndarray) -> Chain:
    """Three parts in a row; the middle one has nodes of both interfaces, which yield together."""
    parts = {"a": part(1), "m": part(3, 6), "b": part(2)}
    interfaces = [seam("a", "m"), seam("m", "b", at=(3, 0), weights=weights)]
    return Chain(parts, interfaces, most=200, build=LOOPS[scheme], mobility=40.0)


@pytest.mark.parametrize("scheme", ACCELERATED)
def test_three_parts_at_two_interfaces_agree_on_the_same_multipliers(scheme: str) -> None:
    """Whatever finds them, beside the default; forces are what the interfaces' weights make of them."""
    weights = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.2, 0.3, 0.5]])
    chain, default = row(scheme, weights), row("position", weights)
    for _ in range(8):
        outcome, other = chain.step(), default.step()
    assert not outcome.note and outcome.gap <= TOLERANCE
    a, m, b = (chain.parts[name] for name in ("a", "m", "b"))
    assert max(largest(a.x - m.x[:3]), largest(m.x[3:] - weights @ b.x)) <= TOLERANCE
    np.testing.assert_array_equal(m.force, np.concatenate([-outcome.multipliers[:3], outcome.multipliers[3:]]))
    np.testing.assert_allclose(b.force, -weights.T @ outcome.multipliers[3:], atol=1e-15)
    size = float(np.abs(other.multipliers).max())
    np.testing.assert_allclose(outcome.multipliers, other.multipliers, atol=0.15 * size)  # of gaps within the tolerance


@pytest.mark.parametrize("scheme", ROWS)
def test_a_loop_goes_on_from_its_arrays(scheme: str) -> None:
    one = Chain({"a": part(1), "b": part(2)}, [seam("a", "b")], build=LOOPS[scheme], mobility=40.0, most=200)
    if scheme in ACCELERATED:  # parts of springs know no velocities
        for _ in range(4):
            one.step()
    arrays = one.loop.to_arrays()
    other = LOOPS[scheme](one.setup)
    other.take(arrays)
    other.begin(one.able)
    np.testing.assert_array_equal(other.multipliers(), one.loop.multipliers())
    for name, array in other.to_arrays().items():
        np.testing.assert_array_equal(array, arrays[name])
    with pytest.raises(KeyError):
        other.take({})
