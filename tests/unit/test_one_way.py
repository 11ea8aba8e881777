"""The one way to take a step, with parts whose answers are known: linear ones, and one that errs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_coupling.accelerations.memory import Acceleration
from softseam_coupling.interface import Interface
from softseam_coupling.loops.loop import (
    Correction,
    First,
    Loop,
    LoopSetup,
    Outcome,
    PartRequest,
    StepDiverged,
    StepRefused,
    largest,
)
from softseam_coupling.loops.one_way import OneWay
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import Advanced, Capabilities

Floats = NDArray[np.float64]

DT, CELL, TOLERANCE = 0.01, 0.02, 5e-6
NONE, NOWHERE = np.zeros((0, 0)), np.zeros((0, 3))


@dataclass
class Part:
    """Nodes that yield by H: x = free + H f + bend (H f)^2/cell; free moves on by `way` a step."""

    yields: Floats
    free: Floats
    way: Floats
    takes_impedance: bool = False
    bend: float = 0.0
    claims: float = 1.0
    """what it says that it yields by, over what it does"""
    corrects: bool = True
    impedance: Floats = field(default_factory=lambda: NONE)
    told: bool = False
    x: Floats = field(default_factory=lambda: NOWHERE)
    force: Floats = field(default_factory=lambda: NOWHERE)
    asked: int = 0

    def answer(self, force: Floats) -> Floats:
        moved = (self.yields @ force.ravel()).reshape(-1, 3)
        return self.free + moved + self.bend * moved * np.abs(moved) / CELL

    def advance(self, request: PartRequest) -> Advanced:
        self.asked += 1
        self.force, root, told = request.force, NONE, NONE
        if request.impedance is not None:
            self.impedance, self.told = request.impedance, False
        if request.target is not None:  # f = request.force + S (target - x) and x = free + H f
            n = self.free.size
            spring = self.impedance @ (request.target - self.free).ravel()
            self.force = np.asarray(
                np.linalg.solve(np.eye(n) + self.impedance @ self.yields, request.force.ravel() + spring)
            ).reshape(-1, 3)
        self.x = self.answer(self.force)
        if self.takes_impedance:
            if not self.told or request.repeat:
                behind = self.impedance if request.target is not None else np.zeros_like(self.yields)
                root = np.asarray(np.linalg.cholesky(np.linalg.inv(np.linalg.inv(self.yields) + behind)))
                self.told = True
        elif request.renew:
            told = self.claims * self.yields
        return self.reply(root, told)

    def correct(self, correction: Correction) -> Advanced:
        behind = np.linalg.inv(self.yields) + (self.impedance if self.impedance.size else 0.0)
        self.x = self.x + np.linalg.solve(behind, correction.push.ravel()).reshape(-1, 3) * self.claims
        self.force = correction.force
        return self.reply(NONE, NONE)

    def reply(self, root: Floats, told: Floats) -> Advanced:
        header, three = Header(2, "test", "part", 0, 0, 0, 0.0), np.zeros(3)
        return Advanced(
            header, Status.CONVERGED, self.x.copy(), told, np.zeros((0, 6)), 0.0, 0.0, 0.0, 0.0, 0.0, three, three,
            0.0, 0.0, 0, 1, 0.0, np.zeros(0), np.zeros((2, 3)), self.force, correctable=self.corrects,
            seam_compliance_root=root,
        )  # fmt: skip


def part(seed: int, n: int = 3, scale: float = 1e-3, **options: object) -> Part:
    """Nodes that yield together, at random."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((3 * n, 3 * n))
    h = scale * (a @ a.T / (3 * n) + 0.3 * np.eye(3 * n))
    return Part(h, np.zeros((n, 3)), 1e-4 * rng.standard_normal((n, 3)), **options)  # type: ignore[arg-type]


def seam(a: str, b: str, n: int = 3, at: tuple[int, int] = (0, 0), weights: Floats | None = None) -> Interface:
    places = tuple(np.arange(first, first + n, dtype=np.int32) for first in at)
    return Interface(f"{a}-{b}", (a, b), (places[0], places[1]), (None, weights), np.zeros((n, 3)))


class Chain:
    """Parts and the loop that takes their steps; replies arrive in an order of choice."""

    def __init__(
        self,
        parts: Mapping[str, Part],
        interfaces: list[Interface],
        backwards: bool = False,
        most: int = 16,
        build: Callable[[LoopSetup], Loop] = OneWay,
        acceleration: Acceleration | None = None,
        mobility: float = 1.0,
    ) -> None:
        self.parts, self.backwards = dict(parts), backwards
        self.able = {
            name: Capabilities(True, one.corrects, one.takes_impedance, 1, False, False, 0.0)
            for name, one in parts.items()
        }
        by_mass = {name: np.full(len(one.free), mobility) for name, one in parts.items()}
        self.setup = LoopSetup(tuple(interfaces), by_mass, TOLERANCE, CELL, most, acceleration=acceleration)
        self.loop = build(self.setup)
        self.loop.begin(self.able)

    def _ordered(self, replies: dict[str, Advanced]) -> dict[str, Advanced]:
        return dict(reversed(replies.items())) if self.backwards else replies

    def step(self, may_refuse: bool = False) -> Outcome:
        for one in self.parts.values():
            one.free = one.free + one.way

        def advance(wanted: dict[str, PartRequest]) -> dict[str, Advanced]:
            return self._ordered({name: self.parts[name].advance(request) for name, request in wanted.items()})

        def correct(wanted: dict[str, Correction], first: First) -> dict[str, Advanced]:
            return self._ordered({name: self.parts[name].correct(one) for name, one in wanted.items()})

        return self.loop.solve(advance, correct, DT, may_refuse)


def pair(takes_impedance: bool = False) -> Chain:
    return Chain({"a": part(1, takes_impedance=takes_impedance), "b": part(2)}, [seam("a", "b")])


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


def test_a_part_that_yields_otherwise_than_it_says_costs_exchanges_not_accuracy() -> None:
    """By a half: what it does is found out, and learned for the steps to come. It says so again only if it is asked."""
    chain = Chain({"a": part(1), "b": part(2, claims=0.5)}, [seam("a", "b")])
    outcomes = [chain.step() for _ in range(16)]
    assert max(outcome.exchanges for outcome in outcomes[:4]) > 1, "the control: a wrong compliance is not believed"
    a, b = chain.parts["a"], chain.parts["b"]
    exact = -np.linalg.solve(a.yields + b.yields, (a.free - b.free).ravel()).reshape(-1, 3)
    np.testing.assert_allclose(outcomes[-1].multipliers, exact, rtol=0.02, atol=0.02 * np.abs(exact).max())
    assert all(outcome.agreed for outcome in outcomes)


def test_a_part_that_yields_backwards_in_some_directions_is_told_of_as_one_that_resists() -> None:
    """As XPBD of stone says after too few sweeps: with an impedance that pushes the near side could not be solved."""
    far = part(2)
    values, vectors = np.linalg.eigh(far.yields)
    values[:2] *= -0.1
    far.yields = (vectors * values) @ vectors.T
    chain = Chain({"a": part(1, takes_impedance=True), "b": far}, [seam("a", "b")])
    outcomes = [chain.step() for _ in range(6)]
    assert np.linalg.eigvalsh(chain.parts["a"].impedance).min() > 0.0
    assert all(outcome.agreed and outcome.gap <= TOLERANCE for outcome in outcomes)


def test_parts_that_cannot_be_corrected_are_redone_until_the_gap_is_closed() -> None:
    chain = Chain({"a": part(1, corrects=False, bend=0.3), "b": part(2)}, [seam("a", "b")])
    for _ in range(6):
        outcome = chain.step()
        assert outcome.agreed and outcome.gap <= TOLERANCE
    assert largest(chain.parts["a"].x - chain.parts["b"].x) <= TOLERANCE


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


def test_a_step_that_will_not_agree_is_refused_where_it_may_be() -> None:
    chain = Chain({"a": part(1, corrects=False, bend=40.0), "b": part(2)}, [seam("a", "b")], most=2)
    chain.parts["a"].way *= 40.0
    with pytest.raises(StepRefused, match="not within 2 exchanges"):
        chain.step(may_refuse=True)
    assert not chain.step().agreed


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
