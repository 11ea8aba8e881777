"""One exchange a step: both sides advance at once, and are settled by their linear answers with the next request.

The near side needs the far side's answer, the far side the near side's force. Each is told what the other is expected
to say, and what they miss, which is little, is made up linearly. With H = P H_far P^T and S = H^-1 the far side is a
line, x = c - H lambda: c, where its image would be without the seam's force, is foretold as the multiplier is.

    near solves with S (c^ - x), the line foretold    -> x_near, lambda'
    far advances with lambda^, foretold               -> c, what was missed: m = c - c^                         (1)
    near moves on by dx = Y S m                       Y = L A^-1 L^T, its yield beside the other side
    lambda = lambda' + S (m - dx)                                                                               (2)
    far moves on by -H' (lambda - lambda^)            pushed by H^-1 of that move (`settling`)                  (3)

H' is H with what earlier rounds have taught (`learned_line`, decision 03); they add to m, dx and lambda what H alone
misses (`kernels.link`, eqs. (4) and (5)). After (2) and (3) both sides feel the same force, but for what the ground
took of it in (3), and x_near = c - H' lambda: the gap is closed in the states themselves, so that no miss comes back
(decision 03). What is not exact is that a state so moved answers that force. By how much was measured when a step took
another round, as shares kappa of the moves (2) and (3); where these times the moves exceed the tolerance, both sides
are asked again, each with what the other has answered.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels.learned_line import multiply_one
from softseam_coupling.kernels.link import foretell, link_round
from softseam_coupling.learned_line import LearnedLine
from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import Outcome, SeamSolver
from softseam_coupling.seam_state import SeamState
from softseam_protocol.messages import Advanced
from softseam_services.orchestrator.seam_answers import Ask, SeamDiverged, SeamSolution, SideRequest, largest
from softseam_services.orchestrator.settling import Settling
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]

ROUNDS, MOST_ROUNDS = 9, 14
"""more rounds of both sides at once, before the near side is asked with what the far side answered; and as long as the
last two left less than half of what was in doubt before them"""
_STRICT, _SLACK = 3, 3.0
"""exchanges of a step after which so many tolerances may be in doubt, as condensed steps may leave them: the gap is
closed all the same, and the next step does not add to it [1]"""
_SMOOTH, _ROUGH_STEPS = 2, 3
"""so many steps on which the sides did not agree, none of so many exchanges between them, make a compliance old"""
_LEAST_AGE = 32
"""steps that a compliance serves at least; doubled where a new one was no better"""
_DOUBT = 1.1
"""growth of a kappa a step in which it was not measured [1]"""
_CHANGED = 0.5
"""least kappa of a far side that touches at more or fewer points than before [1]"""
_LONGEST = 31
"""most steps between tries where sides would not agree [1]"""
_SEEN = 0.02
"""moves below this share of the tolerance measure no kappa [1]"""


class Link:
    """What it takes to settle both sides, for one epoch; everything in it evolves."""

    def __init__(self, tie: SeamTie, tolerance: float, n_nodes: int):
        self._tie, self._tolerance, self._shape = tie, tolerance, (n_nodes, 3)
        self._predictor = SeamSolver(tolerance=tolerance)
        self._line: SeamState = self._predictor.init(n_nodes)  # history of c
        n = 3 * n_nodes
        self._learned = LearnedLine(n)
        self._settling = Settling(tie, n_nodes)
        self._yield = np.zeros((0, 0))
        self._rooted = False  # whether the yield is known by its root
        self._kappa_near = self._kappa_far = 1.0
        self._rough = 0  # steps since the last one that took few rounds, on which the sides did not agree
        self._age, self._least_age = 0, _LEAST_AGE
        self._skip = self._patience = 0  # steps to come that are not linked
        self._can = True  # as far as is known, both sides can be settled

    def renew(self, far: Advanced, stiffness: Floats, lambda_: Floats) -> None:
        """The far side gave a new compliance, whose inverse is `stiffness`, with its answer to lambda_."""
        before = self._learned.h
        h = self._settling.know(far.compliance, stiffness)
        self._learned.renew(h, stiffness)
        if self._line.n_history:
            # the same answers on the new line
            self._line.history[:4] += (h - before) @ lambda_.reshape(-1)
        else:
            self._can = far.settles
        if self.worn:
            self._least_age *= 2
        self._kappa_far, self._rough, self._age = 1.0, 0, 0

    def begin(self, x: Floats, way: Floats) -> None:
        """The cut begins with the seam's nodes at x, moving by `way` in a step (s, 3) [m]."""
        self._settling.begin(x, way)

    def due(self) -> bool:
        """Whether the next step is to be linked."""
        if not self._can:
            return False
        self._skip = max(self._skip - 1, 0)
        return self._skip == 0

    def resume(self, replies: Mapping[str, Advanced]) -> None:
        """A step that was not linked was calm: where its answers could be settled the next one is worth a try."""
        if replies[NEAR].settles and replies[FAR].settles:
            self._skip = 0

    def _put_off(self) -> None:
        """A step could not be linked: the next ones are not, the more of them the more often that was so."""
        self._patience = min(2 * self._patience + 1, _LONGEST)
        self._skip = self._patience + 1

    @property
    def worn(self) -> bool:
        """Whether the far side's compliance is worth renewing."""
        return self._rough >= _ROUGH_STEPS and self._age >= self._least_age

    def note(self, replies: Mapping[str, Advanced], lambda_: Floats) -> None:
        """A step ended with these answers, the far side's to lambda_."""
        self._settling.leave(replies)
        self._age += 1
        self._can = self._can or replies[FAR].settles
        if self._settling.known:
            line = (self._learned.h @ _flat(lambda_)).reshape(self._shape) + self._tie.image(replies[FAR].seam_x)
            self._remember(line)

    def _remember(self, line: Floats) -> None:
        """The step that was left last had this line (s, 3) [m]. A cut's first one goes on as the near side's seam
        does, which is the line's way but for the gap: where the body moves, it would be foretold where it was, and the
        steps up to the third be a whole way off."""
        first = self._line.n_history == 0
        self._predictor.commit(self._line, line)
        if first and self._settling.moves:
            self._predictor.go_on(self._line, self._settling.last_way())

    def hear(self, near: Advanced) -> None:
        """Every answer of the near side beside a stiffness, because what it told once it does not tell again."""
        told = near.seam_yield_root if near.seam_yield_root.size else near.seam_yield
        if told.size:
            self._yield, self._rooted = told, bool(near.seam_yield_root.size)

    def solve(
        self,
        ask: Ask,
        lambda_: Floats,
        dt: float,
        coupled: Callable[[Floats, Floats], SideRequest],
        n_contacts: int,
        before: int = 0,
        far: Advanced | None = None,
    ) -> SeamSolution:
        """One step of length dt [s] by eqs. (1) to (3), in which there were exchanges `before`.

        coupled     makes the near side's request of a multiplier and an anchor
        n_contacts  of the far side at the start of the step: where they change, its line is doubted
        far         its answer to lambda_, where it was asked before: its line is known then, not foretold
        """
        tie, tolerance, shape = self._tie, self._tolerance, self._shape
        yielded, anchor = np.empty((2, *shape))
        learned, foretold = self._learned, self._predictor.predict(self._line)
        foretell(learned.h, _flat(foretold), _flat(lambda_), _flat(yielded), _flat(anchor))
        told, told_far = lambda_, tie.far_force(lambda_)
        if far is None:
            replies = ask({NEAR: coupled(lambda_, anchor), FAR: SideRequest(told_far, fields=False)})
        else:
            anchor = tie.image(far.seam_x)
            replies = ask({NEAR: coupled(lambda_, anchor)}) | {FAR: far}
        exchanges = 1
        doubts: list[float] = []
        while True:
            near, far = replies[NEAR], replies[FAR]
            self.hear(near)
            if not (near.settles and far.settles and self._yield.size):
                self._put_off()
                return SeamSolution(replies, told, np.inf, before + exchanges, "", agreed=False)
            image = tie.image(far.seam_x)
            line, push, moved, found, given = out = np.empty((5, *shape))
            learned.beside(self._yield, self._rooted)
            gap, move, miss = link_round(
                *(learned.h, learned.s, self._yield, self._rooted, _flat(near.seam_x), _flat(near.seam_force)),
                *(_flat(image), _flat(anchor), _flat(yielded), _flat(told)),
                *(learned.kept, learned.changes, learned.defects, learned.along),
                *(learned.pushes, learned.moves, learned.answers, *out.reshape(5, -1)),
            )
            if not math.isfinite(gap):
                raise SeamDiverged(Outcome.NOT_FINITE.value)
            steady = exchanges > 1 or far.n_contacts == n_contacts
            kappa_far = self._kappa_far if steady else max(self._kappa_far, _CHANGED)
            doubts.append(kappa_far * move + self._kappa_near * miss)
            slack = _SLACK if exchanges > _STRICT else 1.0
            if gap <= tolerance and doubts[-1] <= slack * tolerance:
                free = far.n_contacts == 0
                bent, far_moved, gap = self._settling.bend(given, found - told, image, near.seam_x, moved, free)
                if gap <= tolerance:
                    break
            if exchanges > (MOST_ROUNDS if _shrinking(doubts) else ROUNDS):
                self._put_off()
                self._rough += 1
                return SeamSolution(replies, told, gap, before + exchanges, "", agreed=False)
            anchor, told_far = image - given, tie.far_force(found)
            replies = ask({NEAR: coupled(found, anchor), FAR: SideRequest(told_far, fields=False)})
            exchanges += 1
            self._measure(replies, near.seam_x + moved, miss, anchor, move)
            self.learn(found - told, far, replies[FAR])
            told = found
            multiply_one(learned.h, _flat(told), _flat(yielded))
        if exchanges == 1:
            self._kappa_near, self._kappa_far = min(1.0, _DOUBT * self._kappa_near), min(1.0, _DOUBT * self._kappa_far)
        self._patience = 0
        self._rough = 0 if exchanges <= _SMOOTH else self._rough
        self._age += 1
        solved = {NEAR: near.seam_force, FAR: told_far}
        moves, final = {NEAR: moved, FAR: far_moved}, {NEAR: found, FAR: tie.far_force(found)}
        replies = self._settling.replies({NEAR: near, FAR: far}, solved, moves, final, dt)
        self._remember(line)
        settle = {NEAR: push, FAR: bent}
        return SeamSolution(replies, found, gap, before + exchanges, "", settle=settle)

    def learn(self, change: Floats, before: Advanced, after: Advanced) -> None:
        """In a step the far side was told a multiplier that is another by `change` (s, 3) [N], and answered so.

        Only answers of the kind that the probe speaks of teach: not those of a step that failed or was tried again.
        """
        if not (before.settles and after.settles and before.status == after.status):
            return
        moved = self._tie.image(after.seam_x) - self._tie.image(before.seam_x)
        if largest(moved) > _SEEN * self._tolerance:
            self._learned.learn(change.reshape(-1), moved.reshape(-1))

    def change(self, share: float) -> None:
        """Steps are so many times as long from now on [1]: what rounds taught of the far side is of no use to them."""
        self._learned.forget()
        self._settling.stretch(share)

    def _measure(
        self, replies: Mapping[str, Advanced], x_near: Floats, miss: float, image: Floats, move: float
    ) -> None:
        """Compare the answers of a round with the linear ones to the round before: x_near and image (s, 3) [m]."""
        least = _SEEN * self._tolerance
        if move > least:
            self._kappa_far = largest(self._tie.image(replies[FAR].seam_x) - image) / move
        if miss > least:
            self._kappa_near = largest(replies[NEAR].seam_x - x_near) / miss

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves but what the participants tell anew after a snapshot."""
        arrays = {f"line_{name}": array for name, array in self._line.to_arrays().items()}
        flags = [self._kappa_near, self._kappa_far, self._rough, self._age, self._least_age, self._skip, self._patience]
        arrays |= {
            "link_pairs": self._learned.to_array(),
            "link_flags": np.array([*flags, self._can], dtype=np.float64),
        }
        return arrays | self._settling.to_arrays()

    def take(self, arrays: Mapping[str, Floats], far_compliance: Floats, stiffness: Floats) -> None:
        """Continue from `to_arrays`, with the far side's compliance and its inverse as they were then."""
        self._line = SeamState.from_arrays(
            {name.removeprefix("line_"): array for name, array in arrays.items() if name.startswith("line_")}
        )
        self._settling.take(arrays)
        near, far, rough, age, least_age, skip, patience, can = arrays["link_flags"].tolist()
        self._kappa_near, self._kappa_far, self._rough, self._age = near, far, int(rough), int(age)
        self._least_age, self._skip, self._patience, self._can = int(least_age), int(skip), int(patience), bool(can)
        self._yield = np.zeros((0, 0))
        if stiffness.size:
            self._learned.take(
                self._settling.know(far_compliance, stiffness), stiffness, np.array(arrays["link_pairs"])
            )


def _shrinking(doubts: Sequence[float]) -> bool:
    """Whether the last two rounds left less than half of what those before them had."""
    return len(doubts) > 2 and min(doubts[-2:]) < 0.5 * min(doubts[:-2])


def _flat(vectors: Floats) -> Floats:
    return vectors.reshape(-1)
