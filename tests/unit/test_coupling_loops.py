"""Every coupling loop, with parts whose answers are known: what any number of parts agree on, and who is refused."""

from __future__ import annotations

import numpy as np
import pytest
from test_one_way import TOLERANCE, Chain, part, seam

from softseam_coupling.accelerations import ACCELERATIONS
from softseam_coupling.loops import LOOPS
from softseam_coupling.loops.loop import Unsuited, largest


def row(scheme: str, acceleration: str = "exact", weights: np.ndarray | None = None) -> Chain:
    """Three parts in a row; the middle one has nodes of both interfaces, which yield together."""
    parts = {"a": part(1), "m": part(3, 6), "b": part(2)}
    interfaces = [seam("a", "m"), seam("m", "b", at=(3, 0), weights=weights)]
    made = ACCELERATIONS[acceleration]()
    return Chain(parts, interfaces, most=200, build=LOOPS[scheme], acceleration=made, mobility=40.0)


@pytest.mark.parametrize("acceleration", list(ACCELERATIONS))
def test_three_parts_at_two_interfaces_agree_on_the_same_multipliers(acceleration: str) -> None:
    """Whatever finds them, beside the default; forces are what the interfaces' weights make of them."""
    weights = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.2, 0.3, 0.5]])
    chain, default = row("position", acceleration, weights), row("position", weights=weights)
    for _ in range(8):
        outcome, other = chain.step(), default.step()
    assert outcome.agreed and outcome.gap <= TOLERANCE
    a, m, b = (chain.parts[name] for name in ("a", "m", "b"))
    assert max(largest(a.x - m.x[:3]), largest(m.x[3:] - weights @ b.x)) <= TOLERANCE
    np.testing.assert_array_equal(m.force, np.concatenate([-outcome.multipliers[:3], outcome.multipliers[3:]]))
    np.testing.assert_allclose(b.force, -weights.T @ outcome.multipliers[3:], atol=1e-15)
    size = float(np.abs(other.multipliers).max())
    np.testing.assert_allclose(outcome.multipliers, other.multipliers, atol=0.15 * size)  # of gaps within the tolerance


@pytest.mark.parametrize("scheme", list(LOOPS))
def test_a_loop_goes_on_from_its_arrays_before_or_after_it_begins(scheme: str) -> None:
    one = Chain({"a": part(1), "b": part(2)}, [seam("a", "b")], build=LOOPS[scheme])
    if scheme != "ph":  # parts of springs know no velocities
        for _ in range(4):
            one.step()
    arrays = one.loop.to_arrays()
    for begins_first in (True, False):
        other = LOOPS[scheme](one.setup)
        if begins_first:
            other.begin(one.able)
        other.take(arrays)
        if not begins_first:
            other.begin(one.able)
        np.testing.assert_array_equal(other.multipliers(), one.loop.multipliers())
        for name, array in other.to_arrays().items():
            np.testing.assert_array_equal(array, arrays[name])
        with pytest.raises(KeyError):
            other.take({})


def test_staggered_is_of_two_parts_one_of_which_it_can_put() -> None:
    with pytest.raises(Unsuited, match=r"two parts at one interface, not 3 at 2: use seam: {scheme: position}"):
        row("staggered")
    with pytest.raises(Unsuited, match="puts all coupling nodes of 'a', of which this interface has some only"):
        Chain({"a": part(1, 5), "b": part(2)}, [seam("a", "b")], build=LOOPS["staggered"])
    with pytest.raises(Unsuited, match=r"leave out seam.acceleration"):
        made = ACCELERATIONS["aitken"]()
        Chain({"a": part(1), "b": part(2)}, [seam("a", "b")], build=LOOPS["staggered"], acceleration=made)
