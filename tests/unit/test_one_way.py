"""The one way to take a step, with parts whose answers are known: linear ones, and one that errs."""

from __future__ import annotations

import numpy as np
import pytest
from known_parts import TOLERANCE, Chain, part, seam

from softseam_coupling.loops.loop import StepDiverged, StepRefused, Unsuited, largest
from softseam_coupling.loops.one_way import OneWay


def pair(takes_impedance: bool = False) -> Chain:
    return Chain({"a": part(1, takes_impedance=takes_impedance), "b": part(2)}, [seam("a", "b")])


@pytest.mark.kernels
@pytest.mark.parametrize("impedance", [False, True])
def test_linear_parts_need_one_exchange_and_close_the_gap(impedance: bool) -> None:
    """lambda is what both sides' compliances ask for; forces are opposite to the last bit."""
    chain = pair(takes_impedance=impedance)
    exchanges = [chain.step().exchanges for _ in range(12)]
    outcome = chain.step()
    a, b = chain.parts["a"], chain.parts["b"]
    assert max(exchanges[3:]) == outcome.exchanges == 1
    assert largest(a.x - b.x) < 1e-3 * TOLERANCE and outcome.gap < 1e-3 * TOLERANCE
    np.testing.assert_array_equal(a.force, -b.force)
    exact = -np.linalg.solve(a.yields + b.yields, (a.free - b.free).ravel()).reshape(-1, 3)
    np.testing.assert_allclose(outcome.multipliers, exact, rtol=1e-4, atol=1e-5)


@pytest.mark.kernels
def test_cross_terms_of_a_part_between_two_come_by_themselves() -> None:
    """A row of three: the middle one has nodes of both interfaces, which yield together."""
    chain = Chain({"a": part(1), "m": part(3, 6), "b": part(2)}, [seam("a", "m"), seam("m", "b", at=(3, 0))])
    for _ in range(6):
        outcome = chain.step()
    a, m, b = (chain.parts[name] for name in ("a", "m", "b"))
    assert outcome.exchanges == 1
    assert max(largest(a.x - m.x[:3]), largest(m.x[3:] - b.x)) < 1e-3 * TOLERANCE
    total = np.zeros((18, 18))
    rows = {"a": np.eye(9, 18), "m": np.block([[-np.eye(9), np.zeros((9, 9))], [np.zeros((9, 9)), np.eye(9)]])}
    rows["b"] = np.vstack([np.zeros((9, 9)), -np.eye(9)])
    rows["a"] = np.vstack([np.eye(9), np.zeros((9, 9))])
    gap = sum(rows[name] @ chain.parts[name].free.ravel() for name in rows)
    total = sum(rows[name] @ chain.parts[name].yields @ rows[name].T for name in rows)
    np.testing.assert_allclose(outcome.multipliers.ravel(), -np.linalg.solve(total, gap), rtol=1e-4, atol=1e-5)


@pytest.mark.kernels
def test_weights_of_an_interface_carry_forces_as_they_carry_places() -> None:
    """A mortar: rows on a's nodes, images of b's. The interface does no work."""
    weights = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.2, 0.3, 0.5]])
    chain = Chain({"a": part(1, takes_impedance=True), "b": part(2)}, [seam("a", "b", weights=weights)])
    for _ in range(6):
        outcome = chain.step()
    a, b = chain.parts["a"], chain.parts["b"]
    assert largest(a.x - weights @ b.x) < 1e-3 * TOLERANCE
    np.testing.assert_allclose(b.force, -weights.T @ outcome.multipliers, atol=1e-15)
    np.testing.assert_array_equal(a.force, outcome.multipliers)


@pytest.mark.kernels
def test_replies_may_arrive_in_any_order() -> None:
    """The same bits."""
    ends = []
    for backwards in (False, True):
        parts = {"a": part(1, takes_impedance=True, bend=0.2), "b": part(2)}
        chain = Chain(parts, [seam("a", "b")], backwards)
        for _ in range(8):
            outcome = chain.step()
        ends.append((outcome.multipliers, chain.parts["a"].x))
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    np.testing.assert_array_equal(ends[0][1], ends[1][1])


@pytest.mark.kernels
def test_a_part_that_yields_otherwise_than_it_says_costs_exchanges_not_accuracy() -> None:
    """By a half: what it does is found out, and learned for the steps to come. It says so again only if it is asked."""
    chain = Chain({"a": part(1), "b": part(2, claims=0.5)}, [seam("a", "b")])
    outcomes = [chain.step() for _ in range(16)]
    assert max(outcome.exchanges for outcome in outcomes[:4]) > 1, "the control: a wrong compliance is not believed"
    a, b = chain.parts["a"], chain.parts["b"]
    exact = -np.linalg.solve(a.yields + b.yields, (a.free - b.free).ravel()).reshape(-1, 3)
    np.testing.assert_allclose(outcomes[-1].multipliers, exact, rtol=0.02, atol=0.02 * np.abs(exact).max())
    assert all(not outcome.note for outcome in outcomes)


@pytest.mark.kernels
def test_a_part_that_yields_backwards_in_some_directions_is_told_of_as_one_that_resists() -> None:
    """As XPBD of stone says after too few sweeps: with an impedance that pushes the near side could not be solved."""
    far = part(2)
    values, vectors = np.linalg.eigh(far.yields)
    values[:2] *= -0.1
    far.yields = (vectors * values) @ vectors.T
    chain = Chain({"a": part(1, takes_impedance=True), "b": far}, [seam("a", "b")])
    outcomes = [chain.step() for _ in range(6)]
    assert np.linalg.eigvalsh(chain.parts["a"].impedance).min() > 0.0
    assert all(not outcome.note and outcome.gap <= TOLERANCE for outcome in outcomes)


@pytest.mark.kernels
def test_parts_that_cannot_be_corrected_are_redone_until_the_gap_is_closed() -> None:
    chain = Chain({"a": part(1, corrects=False, bend=0.3), "b": part(2)}, [seam("a", "b")])
    for _ in range(6):
        outcome = chain.step()
        assert not outcome.note and outcome.gap <= TOLERANCE
    assert largest(chain.parts["a"].x - chain.parts["b"].x) <= TOLERANCE


@pytest.mark.kernels
def test_what_is_not_finite_diverges_and_leaves_the_loop_as_it_was() -> None:
    """A step that fails and is taken again is the step of a loop that never failed, bit for bit."""
    failed, whole = pair(takes_impedance=True), pair(takes_impedance=True)
    for chain in (failed, whole):
        for _ in range(5):
            chain.step()
    way = failed.parts["b"].way
    failed.parts["b"].way = way * np.nan
    free = failed.parts["b"].free, failed.parts["a"].free
    with pytest.raises(StepDiverged):
        failed.step()
    failed.parts["b"].free, failed.parts["a"].free = free
    failed.parts["b"].way = way
    one, other = failed.step(), whole.step()
    np.testing.assert_array_equal(one.multipliers, other.multipliers)
    assert one.exchanges == other.exchanges


@pytest.mark.kernels
def test_a_step_that_will_not_agree_is_refused_where_it_may_be() -> None:
    chain = Chain({"a": part(1, corrects=False, bend=40.0), "b": part(2)}, [seam("a", "b")], most=2)
    chain.parts["a"].way *= 40.0
    with pytest.raises(StepRefused, match="not within 2 exchanges"):
        chain.step(may_refuse=True)
    assert chain.step().note


def test_a_part_that_tells_no_compliance_is_refused_by_name_with_the_remedy() -> None:
    with pytest.raises(Unsuited, match=r"part 'b' reports no compliance.*must report it.*write-a-participant\.md"):
        Chain({"a": part(1), "b": part(2, tells=False)}, [seam("a", "b")])
    chain = pair()
    with pytest.raises(Unsuited, match="part 'b' reports no compliance"):
        OneWay(chain.setup).begin({"a": chain.able["a"]})


@pytest.mark.kernels
@pytest.mark.parametrize("before_it_begins", [True, False])
def test_a_loop_goes_on_from_its_arrays(before_it_begins: bool) -> None:
    """As one that took a snapshot does, bit for bit."""
    one, other = pair(takes_impedance=True), pair(takes_impedance=True)
    for chain in (one, other):
        for _ in range(5):
            chain.step()
        for each in chain.parts.values():
            each.told = False  # as participants, which forget at a snapshot
    arrays = one.loop.to_arrays()
    one.loop.forget_sent()
    fresh = pair(takes_impedance=True)
    if before_it_begins:
        fresh.loop = OneWay(fresh.setup)
        fresh.loop.take(arrays)
        fresh.loop.begin(fresh.able)
    else:
        fresh.loop.take(arrays)
    fresh.parts = other.parts
    for _ in range(3):
        np.testing.assert_array_equal(one.step().multipliers, fresh.step().multipliers)
