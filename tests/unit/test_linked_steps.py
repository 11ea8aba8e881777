"""Two linear sides that can be settled: one exchange a step, and the motion of one body."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_coupling.kernels.link import link_round
from softseam_coupling.mortar import identity_tie, stiffness_of
from softseam_coupling.seam import SeamSolver
from softseam_protocol.messages import SCHEMA_VERSION, Advanced, Header
from softseam_protocol.outcomes import Status
from softseam_protocol.scene_regions import SeamSpec
from softseam_services.orchestrator import far_stiffness
from softseam_services.orchestrator.linked import MOST_ROUNDS
from softseam_services.orchestrator.seam_answers import SeamDiverged, SideRequest
from softseam_services.orchestrator.seam_loop import SeamLoop
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]
DT = 0.01
TOLERANCE = 1e-6


@dataclass
class Side:
    """Two nodes joined by a spring, implicit Euler; the first is the seam, the other feels `load`, in three axes."""

    spring: float
    off: float = 1.0
    """what the answer to a change of the seam's force is, relative to that of the matrix, where the step is settled"""
    skew: Floats = field(default_factory=lambda: np.eye(3))
    """the same, of a far side whose answer is not symmetric, as with friction (3, 3)"""
    x: Floats = field(default_factory=lambda: np.zeros((2, 3)))
    v: Floats = field(default_factory=lambda: np.zeros((2, 3)))
    load: Floats = field(default_factory=lambda: np.zeros(3))
    touches: int = 0
    asked: int = 0
    told: Floats = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def matrix(self) -> Floats:
        return np.eye(2) / DT**2 + self.spring * np.array([[1.0, -1.0], [-1.0, 1.0]])

    def advance(self, side: SideRequest) -> Advanced:
        self.asked += 1
        self.coupled = side.anchor is not None
        matrix = np.kron(self.matrix, np.eye(3))
        right = (self.x + DT * self.v) / DT**2
        right[0] += side.force[0]
        right[1] += self.load
        if side.anchor is not None:
            self.told = self.told if side.stiffness is None else side.stiffness
            matrix[:3, :3] += self.told
            right[0] += self.told @ side.anchor[0]
        self.inverse = np.linalg.inv(matrix)
        self.next_x = (self.inverse @ right.ravel()).reshape(2, 3)
        self.next_v = (self.next_x - self.x) / DT
        seam = self.next_x[:1].copy()
        force = side.force if side.anchor is None else side.force + (side.anchor - seam) @ self.told
        work = float((force * (seam - self.x[:1])).sum())
        energy = 0.5 * float((self.next_v**2).sum())
        strain = 0.5 * self.spring * float(((self.next_x[1] - self.next_x[0]) ** 2).sum())
        return Advanced(
            Header(SCHEMA_VERSION, "", "", 0, 0, 0, 0.0), Status.CONVERGED, seam,
            self.off * self.inverse[:3, :3] @ self.skew if side.compliance else np.zeros((0, 0)), np.zeros((0, 6)),
            energy, strain, 0.0, 0.0, work, self.next_v.sum(axis=0), np.zeros(3), 0.0, 0.0, self.touches, 2, 0.0,
            np.zeros(0), np.zeros((2, 3)), force, settles=True,
            seam_yield=self.off * self.inverse[:3, :3] if self.coupled else np.zeros((0, 0)),
        )  # fmt: skip

    def commit(self, settle: Floats | None) -> None:
        if settle is not None:
            moved = self.off * (self.inverse[:, :3] @ (self.skew @ settle[0])).reshape(2, 3)
            self.next_x, self.next_v = self.next_x + moved, self.next_v + moved / DT
        self.x, self.v = self.next_x, self.next_v


def _loop() -> SeamLoop:
    return SeamLoop(SeamSolver(tolerance=TOLERANCE), identity_tie(1), np.ones(3), None, True, 16)


def _run(sides: dict[str, Side], n_steps: int) -> tuple[list[int], Floats, list[dict[str, Advanced]]]:
    """Exchanges, gaps of the states, and replies; the far end is pulled about, ever more."""
    loop = _loop()
    exchanges, gaps, replies = [], [], []
    for step in range(n_steps):
        sides[FAR].load = np.array([np.sin(0.3 * step), 0.5 * np.cos(0.2 * step), 0.01 * step])
        solution = loop.solve(lambda wanted: {name: sides[name].advance(side) for name, side in wanted.items()}, DT)
        for name, side in sides.items():
            side.commit(solution.settle.get(name))
        exchanges.append(solution.exchanges)
        gaps.append(float(np.abs(sides[NEAR].x[0] - sides[FAR].x[0]).max()))
        replies.append(solution.replies)
    return exchanges, np.array(gaps), replies


def _whole(sides: dict[str, Side], n_steps: int) -> Floats:
    """The same as one body, its seam node of both masses: positions of the three nodes (n_steps, 3, 3)."""
    matrix = np.zeros((3, 3))
    matrix[:2, :2] += sides[NEAR].matrix[::-1, ::-1]
    matrix[1:, 1:] += sides[FAR].matrix
    mass = np.array([[1.0], [2.0], [1.0]])
    x: Floats = np.zeros((3, 3))
    v: Floats = np.zeros((3, 3))
    out = []
    for step in range(n_steps):
        right = mass * (x + DT * v) / DT**2
        right[2] += [np.sin(0.3 * step), 0.5 * np.cos(0.2 * step), 0.01 * step]
        before, x = x, np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
        v = (x - before) / DT
        out.append(x)
    return np.array(out)


def test_linear_sides_need_one_exchange_and_move_as_one_body() -> None:
    """Once it is measured that the linear answers are right, they are taken at their word: states agree to rounding."""
    sides = {NEAR: Side(4e3), FAR: Side(2e3)}
    exchanges, gaps, _ = _run(sides, 80)
    assert exchanges[8:] == [1] * 72
    assert gaps[8:].max() < 1e-13
    whole = _whole(sides, 80)[-1]
    np.testing.assert_allclose(np.stack([sides[NEAR].x[1], sides[FAR].x[0], sides[FAR].x[1]]), whole, atol=1e-9)


def test_after_a_cut_of_what_moves_the_far_side_is_foretold_to_move_on() -> None:
    """From the second step on; it was foretold to stand still up to the third, a whole way off, and kinetic energy with
    it, which is reckoned with the force that makes up for that."""
    v = np.array([1.0, -0.5, 0.2])
    sides = {name: Side(spring, v=np.tile(v, (2, 1))) for name, spring in ((NEAR, 4e3), (FAR, 2e3))}
    loop, way = _loop(), DT * v
    loop.begin(np.zeros((1, 3)), way[None])
    missed = []

    def ask(wanted: dict[str, SideRequest]) -> dict[str, Advanced]:
        replies = {name: sides[name].advance(side) for name, side in wanted.items()}
        if replies.keys() == sides.keys():
            anchor = wanted[NEAR].anchor
            assert anchor is not None
            missed.append(np.abs(anchor - replies[FAR].seam_x).max())
        return replies

    for step in range(5):
        sides[FAR].load = np.array([0.2 * step, 0.0, 0.0])
        solution = loop.solve(ask, DT)
        for name, side in sides.items():
            side.commit(solution.settle.get(name))
    assert len(missed) >= 4 and max(missed[:2]) < 0.02 * np.abs(way).max()


def test_replies_are_those_of_the_settled_step() -> None:
    """Seam and momentum exactly, the energy to first order; the seam's work of both sides cancels."""
    sides = {NEAR: Side(4e3), FAR: Side(2e3)}
    _, _, before = _run(sides, 40)
    for name, side in sides.items():
        reply = before[-1][name]
        np.testing.assert_allclose(reply.seam_x, side.x[:1], atol=1e-13)
        np.testing.assert_allclose(reply.momentum, side.v.sum(axis=0), atol=1e-12)
        energy = 0.5 * (side.v**2).sum() + 0.5 * side.spring * ((side.x[1] - side.x[0]) ** 2).sum()
        assert abs(reply.kinetic + reply.strain - energy) < 1e-5 * energy
    near, far = before[-1][NEAR].seam_work, before[-1][FAR].seam_work
    assert abs(near + far) < 1e-12 < 1e-3 * abs(near)


def test_a_wrong_answer_is_found_out_and_costs_exchanges_not_accuracy() -> None:
    """With an answer of the near side that is 40 % off the gap of the states still closes: steps are solved again."""
    right, wrong = ({NEAR: Side(4e3, off), FAR: Side(2e3)} for off in (1.0, 1.4))
    few, _, _ = _run(right, 60)
    more, gaps, _ = _run(wrong, 60)
    assert sum(more) > sum(few)
    assert gaps.max() <= 1.001 * TOLERANCE
    np.testing.assert_allclose(wrong[FAR].x, right[FAR].x, atol=100 * TOLERANCE)


def test_a_wrong_answer_of_the_far_side_is_learned() -> None:
    """Its rounds teach its line: 40 % off costs one exchange more, once. It touches: what it touches takes the rest."""
    right, wrong = ({NEAR: Side(4e3), FAR: Side(2e3, off, touches=1)} for off in (1.0, 1.4))
    few, _, _ = _run(right, 60)
    more, gaps, _ = _run(wrong, 60)
    assert sum(more) <= sum(few) + 2
    assert gaps.max() <= 1.001 * TOLERANCE
    np.testing.assert_allclose(wrong[FAR].x, right[FAR].x, atol=100 * TOLERANCE)


def test_the_gap_of_the_states_closes_where_the_far_side_is_not_symmetric() -> None:
    """The near side is told a symmetric stiffness; what the far side has of the other kind is learned and settled."""
    skew = np.array([[1.0, 0.3, 0.0], [-0.3, 1.0, 0.1], [0.0, -0.1, 1.0]])
    sides = {NEAR: Side(4e3), FAR: Side(2e3, skew=skew, touches=1)}
    _, gaps, _ = _run(sides, 40)
    assert gaps[2:].max() < 1e-13


def test_a_far_side_that_touches_nothing_is_settled_by_the_impulse_of_its_multiplier() -> None:
    """However its line errs: where that leaves a gap beyond the tolerance there is another round instead."""
    sides = {NEAR: Side(4e3), FAR: Side(2e3, 1.4)}
    loop, told = _loop(), np.zeros((1, 3))

    def ask(wanted: dict[str, SideRequest]) -> dict[str, Advanced]:
        if FAR in wanted:
            told[:] = wanted[FAR].force
        return {name: sides[name].advance(side) for name, side in wanted.items()}

    n_settled = 0
    for step in range(60):
        sides[FAR].load = np.array([np.sin(0.3 * step), 0.5 * np.cos(0.2 * step), 0.01 * step])
        solution = loop.solve(ask, DT)
        for name, side in sides.items():
            side.commit(solution.settle.get(name))
        if FAR in solution.settle:
            n_settled += 1
            np.testing.assert_allclose(solution.settle[FAR], -solution.lambda_ - told, atol=1e-12)
        assert np.abs(sides[NEAR].x[0] - sides[FAR].x[0]).max() <= 1.001 * TOLERANCE
    assert n_settled > 50


def _learned(loop: SeamLoop) -> Floats:
    """Changes of the multiplier that the loop remembers, of length 1 (k, 3)."""
    changes = loop.to_arrays()["link_pairs"][0]
    return np.asarray(changes / np.linalg.norm(changes, axis=1, keepdims=True))


def _jolted(loop: SeamLoop, sides: dict[str, Side], steps: range, dt: float = DT) -> None:
    """Steps in which the far side is pulled about as no line foretells."""
    for step in steps:
        sides[FAR].load = np.array([(-1.0) ** step, np.sin(step), np.cos(1.7 * step)])
        solution = loop.solve(lambda wanted: {name: sides[name].advance(side) for name, side in wanted.items()}, dt)
        for name, side in sides.items():
            side.commit(solution.settle.get(name))


@pytest.mark.parametrize("status", ["converged", "it diverged"])
def test_answers_of_a_step_that_failed_or_was_tried_again_teach_nothing(status: str) -> None:
    """Every second answer of a step is such a one, and far off: what is remembered is what the side does."""

    class Torn(Side):
        odd: bool = False

        def advance(self, side: SideRequest) -> Advanced:
            reply, self.odd = super().advance(side), not self.odd
            return replace(reply, status=status, settles=False, seam_x=reply.seam_x + 0.1) if self.odd else reply

    sides = {NEAR: Side(4e3), FAR: Torn(2e3, 1.4, touches=1)}
    loop = _loop()
    for step in range(12):
        sides[FAR].load = np.array([(-1.0) ** step, np.sin(step), np.cos(1.7 * step)])
        loop.solve(lambda wanted: {name: sides[name].advance(side) for name, side in wanted.items()}, DT)
        for side in sides.values():
            side.commit(None)
    changes, defects, along = loop.to_arrays()["link_pairs"]
    np.testing.assert_allclose(defects + along, changes @ sides[FAR].inverse[:3, :3], rtol=1e-6)


def test_what_is_not_finite_teaches_nothing_and_is_not_forgotten_for() -> None:
    """The near side cannot be settled and, condensed, answers nothing finite; the far side answers as before to it."""

    class Lost(Side):
        def advance(self, side: SideRequest) -> Advanced:
            reply = replace(super().advance(side), settles=not lost)
            if not lost or self.asked - before == 1:
                return reply
            return replace(reply, seam_force=reply.seam_force * np.nan, seam_x=reply.seam_x * np.nan)

    class Deaf(Side):
        def advance(self, side: SideRequest) -> Advanced:
            return super().advance(replace(side, force=np.nan_to_num(side.force)))

    near = Lost(4e3)
    sides: dict[str, Side] = {NEAR: near, FAR: Deaf(2e3, 1.4, touches=1)}
    loop, lost, before = _loop(), False, 0
    _jolted(loop, sides, range(6))
    pairs, before, lost = _learned(loop), near.asked, True
    with pytest.raises(SeamDiverged):
        _jolted(loop, sides, range(6, 9))
    assert len(pairs) > 0
    np.testing.assert_array_equal(_learned(loop), pairs)


def test_steps_of_another_length_forget_what_rounds_taught() -> None:
    sides = {NEAR: Side(4e3), FAR: Side(2e3, 1.4, touches=1)}
    loop = _loop()
    _jolted(loop, sides, range(6))
    before = _learned(loop)
    _jolted(loop, sides, range(6, 7), 0.5 * DT)
    assert len(before) > 0
    assert all(np.abs(before @ change).max() < 1.0 - 1e-6 for change in _learned(loop))


def test_a_compliance_is_inverted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the far side tells it but cannot be settled, a direct step goes on with it."""

    class Rigid(Side):
        n_told: int = 0

        def advance(self, side: SideRequest) -> Advanced:
            self.n_told += side.compliance
            return replace(super().advance(side), settles=False)

    inverted = []

    def counted(h: Floats) -> Floats:
        inverted.append(h)
        return stiffness_of(h)

    monkeypatch.setattr(far_stiffness, "stiffness_of", counted)
    far = Rigid(2e3)
    _run({NEAR: Side(4e3), FAR: far}, 40)
    assert len(inverted) == far.n_told > 0


def test_sides_that_cannot_be_settled_are_not() -> None:
    class Rigid(Side):
        def advance(self, side: SideRequest) -> Advanced:
            return replace(super().advance(side), settles=False)

    sides: dict[str, Side] = {NEAR: Side(4e3), FAR: Rigid(2e3)}
    exchanges, gaps, _ = _run(sides, 40)
    assert gaps.max() <= TOLERANCE
    assert max(sides[NEAR].asked, sides[FAR].asked) <= sum(exchanges)


@pytest.mark.parametrize("side", [NEAR, FAR])
def test_a_side_that_could_once_not_be_settled_is_linked_again(side: str) -> None:
    """In free motion, where no step is condensed: put off for a step, not for the rest of the run."""

    class Odd(Side):
        def advance(self, side: SideRequest) -> Advanced:
            return replace(super().advance(side), settles=self.asked != 20)

    sides = {NEAR: Side(4e3), FAR: Side(2e3)}
    sides[side] = Odd(sides[side].spring)
    exchanges, _, _ = _run(sides, 40)
    assert sum(exchanges) > 40
    assert exchanges[-15:] == [1] * 15
    assert sides[NEAR].coupled


def test_steps_are_seldom_tried_where_sides_can_never_be_settled() -> None:
    class Rigid(Side):
        n_tried: int = 0

        def advance(self, side: SideRequest) -> Advanced:
            self.n_tried += side.anchor is not None
            return replace(super().advance(side), settles=False)

    near = Rigid(4e3)
    _run({NEAR: near, FAR: Side(2e3)}, 130)
    assert 1 <= near.n_tried <= 8  # after 1, 3, 7, 15, 31, 31, 31 steps


def test_what_is_known_is_not_asked_again_and_fields_are_not_asked_in_vain() -> None:
    """A step that cannot be linked goes on from what the far side said; one that is settled brings no fields along."""

    class Odd(Side):
        def advance(self, side: SideRequest) -> Advanced:
            return replace(super().advance(side), settles=not 20 <= step < 30)

    sides = {NEAR: Odd(4e3), FAR: Side(2e3, 1.4)}
    loop, asked = _loop(), list[dict[str, SideRequest]]()

    def ask(wanted: dict[str, SideRequest]) -> dict[str, Advanced]:
        asked.append(wanted)
        return {name: sides[name].advance(side) for name, side in wanted.items()}

    kinds = []
    for step in range(80):
        asked.clear()
        rough = np.sin(0.3 * step) + (0.3 * (-1.0) ** step if step > 20 else 0.0)
        sides[FAR].load = np.array([rough, 0.0, 0.1 * step])
        solution = loop.solve(ask, DT)
        for name, side in sides.items():
            side.commit(solution.settle.get(name))
        for before, after in itertools.pairwise(wanted[FAR] for wanted in asked if FAR in wanted):
            assert after.compliance or not np.array_equal(before.force, after.force)
        linked = [side.fields for wanted in asked for side in wanted.values()]
        if solution.settle:
            assert not any(linked)
        kinds.append((bool(solution.settle), all(linked)))
    assert {(True, False), (False, False), (False, True)} <= set(kinds)


@pytest.mark.parametrize("node", [0, 1])
def test_a_round_that_is_not_finite_says_so_whatever_node_it_is(node: int) -> None:
    rng = np.random.default_rng(3)
    h, s, y = rng.standard_normal((3, 6, 6))
    vectors, pairs = rng.standard_normal((11, 6)), np.zeros((6, 0, 6))
    vectors[0, 3 * node] = np.nan
    nothing = np.zeros(0, dtype=np.int64)
    arguments = (h, s, y, False, *vectors[:6], nothing, *pairs, *vectors[6:])
    assert np.isnan(link_round(*arguments)[0])


def test_a_loop_goes_on_from_its_arrays() -> None:
    """Every number that decides on the next step is in them."""
    ends = []
    for again in (False, True):
        sides = {NEAR: Side(4e3), FAR: Side(2e3, 1.1)}

        def ask(wanted: dict[str, SideRequest], sides: dict[str, Side] = sides) -> dict[str, Advanced]:
            return {name: sides[name].advance(side) for name, side in wanted.items()}

        loop = _loop()
        counts = []
        for step in range(30):
            if again:
                arrays = loop.to_arrays()
                loop = _loop()
                loop.take(arrays)
            else:
                loop.forget_told()
            sides[FAR].load = np.array([np.sin(0.3 * step), 0.0, 0.1 * step])
            solution = loop.solve(ask, DT)
            for name, side in sides.items():
                side.commit(solution.settle.get(name))
            counts.append(solution.exchanges)
        ends.append((counts, sides[NEAR].x.tobytes(), sides[FAR].v.tobytes()))
    assert ends[0] == ends[1]


def _exchanges_at_random(seed: int, most: int) -> list[int]:
    """Of some steps beside a far side that answers at random, though it says that it can be settled."""
    rng = np.random.default_rng(seed)

    class Random(Side):
        def advance(self, side: SideRequest) -> Advanced:
            reply = super().advance(side)
            return replace(reply, seam_x=reply.seam_x + 1e3 * TOLERANCE * rng.standard_normal((1, 3)))

    sides: dict[str, Side] = {NEAR: Side(4e3), FAR: Random(2e3, touches=seed % 2)}
    loop, counts = SeamLoop(SeamSolver(tolerance=TOLERANCE), identity_tie(1), np.ones(3), None, True, most), []
    for _ in range(4):
        solution = loop.solve(lambda wanted: {name: sides[name].advance(side) for name, side in wanted.items()}, DT)
        counts.append(solution.exchanges)
        for name, side in sides.items():
            side.commit(solution.settle.get(name))
    return counts


def test_exchanges_are_as_many_as_the_key_says_after_those_of_both_sides_at_once() -> None:
    most = 4
    counts = [count for seed in range(10) for count in _exchanges_at_random(seed, most)]
    assert 6 + most <= max(counts) <= MOST_ROUNDS + 1 + most
    told = SeamSpec.model_fields["exchanges"].description
    assert told is not None and "fifteen of these at most come before" in told


def test_a_step_that_failed_where_compliances_were_asked_for_begins_with_a_new_one() -> None:
    """The far side answered at random, so that a direct step called for new compliances, and then it failed."""

    class Unsteady(Side):
        settles, shakes = True, False

        def advance(self, side: SideRequest) -> Advanced:
            reply = super().advance(side)
            if self.shakes and side.compliance:
                raise ArithmeticError
            shaken = reply.seam_x + 1e3 * TOLERANCE * (rng.standard_normal((1, 3)) if self.shakes else 0.0)
            return replace(reply, seam_x=shaken, settles=self.settles)

    rng = np.random.default_rng(3)
    far = Unsteady(2e3)
    sides: dict[str, Side] = {NEAR: Side(4e3), FAR: far}
    loop, asked = _loop(), []

    def ask(wanted: dict[str, SideRequest]) -> dict[str, Advanced]:
        asked.append(wanted)
        return {name: sides[name].advance(side) for name, side in wanted.items()}

    for settles in (True, False):  # the second step is not linked, and neither is the next one
        far.settles = settles
        solution = loop.solve(ask, DT)
        for name, side in sides.items():
            side.commit(solution.settle.get(name))
    far.shakes = True
    with pytest.raises(ArithmeticError):
        loop.solve(ask, DT)
    far.settles, far.shakes = True, False
    asked.clear()
    solution = loop.solve(ask, DT)
    assert solution.settle, "it was linked"
    assert asked[0].keys() == {FAR}
    assert asked[0][FAR].compliance
