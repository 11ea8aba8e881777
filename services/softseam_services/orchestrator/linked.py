"""One exchange a step: both sides advance at once, and are settled by their linear answers with the next request.

The near side needs the far side's answer, the far side the near side's force. Each is told what the other is expected
to say, and what they miss, which is little, is made up linearly. With H = P H_far P^T and S = H^-1 the far side is a
line, x = c - H lambda: c, where its image would be without the seam's force, is foretold as the multiplier is.

    near solves with S (c^ - x), the line foretold    -> x_near, lambda'
    far advances with lambda^, foretold               -> c, what was missed: m = c - c^                         (1)
    near moves on by dx = Y S m                       Y = L A^-1 L^T, its yield beside the other side
    lambda = lambda' + S (m - dx)                                                                               (2)
    far moves on by -H (lambda - lambda^)                                                                       (3)

After (2) and (3) both sides feel the same force and x_near = c - H lambda: the gap is closed in the states themselves,
so that no miss comes back (docs/decisions/0099). What is not exact is that a state so moved answers that force. By how
much was measured when a step last took another round, as shares kappa of the moves (2) and (3); where these times the
moves exceed the tolerance, both sides are asked again, each with what the other has answered.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from softseam_coupling.kernels.learned_line import multiply_rows
from softseam_coupling.kernels.link import foretell, link_round, settled
from softseam_coupling.kernels.quasi_newton import multiply
from softseam_coupling.learned_line import LearnedLine
from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import Outcome, SeamSolver, SeamState
from softseam_protocol.messages import Advanced
from softseam_services.orchestrator.seam_answers import Ask, SeamDiverged, SideRequest, largest
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]

ROUNDS, MOST_ROUNDS = 5, 10
"""more rounds of both sides at once, before the near side is asked with what the far side answered; and as long as two
rounds halve what is in doubt"""
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


@dataclass(frozen=True, slots=True)
class Linked:
    """A step on which both sides agree once they are settled, or the last round of one on which they do not."""

    agreed: bool
    replies: dict[str, Advanced]
    """as if settled, where agreed"""
    settle: dict[str, Floats]
    """forces on each side's seam nodes that it is to be settled by, (s, 3) [N]"""
    lambda_: Floats
    """(s, 3) [N]; where they do not agree, the one that the far side was told"""
    gap: float
    """between the settled sides [m]"""
    exchanges: int


class Link:
    """What it takes to settle both sides, for one epoch; everything in it evolves."""

    def __init__(self, tie: SeamTie, tolerance: float, n_nodes: int):
        self._tie, self._tolerance, self._shape = tie, tolerance, (n_nodes, 3)
        self._predictor = SeamSolver(tolerance=tolerance)
        self._line: SeamState = self._predictor.init(n_nodes)  # history of c
        n = 3 * n_nodes
        self._learned = LearnedLine(n)
        self._bends: list[NDArray[np.generic]] = []  # factor and pivots of the far side's compliance
        self._far, self._yield = np.zeros((n, n)), np.zeros((0, 0))
        self._x = np.zeros((2, 2, n_nodes, 3))  # seam nodes of near and far where the last step began and ended
        self._n_left = 0  # of these two places, those that are known
        self._rooted = False  # whether the yield is known by its root
        self._kappa_near = self._kappa_far = 1.0
        self._rough = 0  # rounds in a row
        self._age, self._least_age = 0, _LEAST_AGE
        self._skip = self._patience = 0  # steps to come that are not linked
        self._can = True  # as far as is known, both sides can be settled

    def renew(self, far: Advanced, stiffness: Floats, lambda_: Floats) -> None:
        """The far side gave a new compliance, whose inverse is `stiffness`, with its answer to lambda_."""
        before = self._learned.h
        h = self._know(far.compliance)
        self._learned.renew(h, stiffness)
        if self._line.n_history:
            # the same answers on the new line
            self._line.history[:4] += (h - before) @ lambda_.reshape(-1)
        else:
            self._can = far.settles
        if self.worn:
            self._least_age *= 2
        self._kappa_far, self._rough, self._age = 1.0, 0, 0

    def _know(self, compliance: Floats) -> Floats:
        """Keep the far side's compliance; its symmetric part as the near side sees it."""
        h = self._tie.far_compliance(compliance)
        self._far = compliance
        *self._bends, singular = lapack.dgetrf(h)
        self._bends = [] if singular else self._bends
        return 0.5 * (h + h.T)

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
        self._leave(replies)
        self._age += 1
        self._can = self._can or replies[FAR].settles
        if self._far.any():
            line = (self._learned.h @ _flat(lambda_)).reshape(self._shape) + self._tie.image(replies[FAR].seam_x)
            self._predictor.commit(self._line, line)

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
        far: Advanced | None = None,
    ) -> Linked:
        """One step of length dt [s] by eqs. (1) to (3).

        coupled     makes the near side's request of a multiplier and an anchor
        n_contacts  of the far side at the start of the step: where they change, its line is doubted
        far         its answer to lambda_, where it was asked before: its line is known then, not foretold
        """
        tie, tolerance, shape = self._tie, self._tolerance, self._shape
        yielded, anchor = np.empty(shape), np.empty(shape)
        learned = self._learned
        foretell(learned.h, _flat(self._predictor.predict(self._line)), _flat(lambda_), _flat(yielded), _flat(anchor))
        told_far, yielded_near = lambda_, yielded
        if far is None:
            replies = ask({NEAR: coupled(lambda_, anchor), FAR: SideRequest(tie.far_force(lambda_), fields=False)})
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
                return Linked(False, replies, {}, told_far, np.inf, exchanges)
            image = tie.image(far.seam_x)
            line, push, moved, found, given = np.empty((5, *shape))
            learned.beside(self._yield, self._rooted)
            gap, move, miss = link_round(
                *(learned.h, learned.s, self._yield, self._rooted, _flat(near.seam_x), _flat(near.seam_force)),
                *(_flat(image), _flat(anchor), _flat(yielded_near), _flat(yielded), _flat(told_far)),
                *(learned.kept, learned.changes, learned.defects, learned.along),
                *(learned.pushes, learned.moves, learned.answers),
                *(_flat(line), _flat(push), _flat(moved), _flat(found), _flat(given)),
            )
            if not math.isfinite(gap):
                raise SeamDiverged(Outcome.NOT_FINITE.value)
            steady = exchanges > 1 or far.n_contacts == n_contacts
            kappa_far = self._kappa_far if steady else max(self._kappa_far, _CHANGED)
            doubts.append(kappa_far * move + self._kappa_near * miss)
            if max(doubts[-1], gap) <= tolerance:
                bent, far_moved = self._bend(given, found - told_far, image, far.n_contacts == 0)
                gap = largest(tie.gap(near.seam_x + moved, far.seam_x + far_moved))
                if gap <= tolerance:
                    break
            if exchanges > (MOST_ROUNDS if exchanges > 2 and doubts[-1] < 0.5 * doubts[-3] else ROUNDS):
                self._put_off()
                self._rough += 1
                return Linked(False, replies, {}, told_far, gap, exchanges)
            anchor = image - given
            replies = ask({NEAR: coupled(found, anchor), FAR: SideRequest(tie.far_force(found), fields=False)})
            exchanges += 1
            self._measure(replies, near.seam_x + moved, miss, anchor, move)
            self.learn(found - told_far, tie.image(replies[FAR].seam_x) - image)
            told_far, yielded_near = found, np.empty(shape)
            multiply(learned.h, _flat(found), _flat(yielded_near))
            yielded = yielded_near
        if exchanges == 1:
            self._kappa_near, self._kappa_far = min(1.0, _DOUBT * self._kappa_near), min(1.0, _DOUBT * self._kappa_far)
        self._patience = 0
        self._rough = 0 if exchanges <= _SMOOTH else self._rough
        self._age += 1
        self._predictor.commit(self._line, line)
        forces = tie.far_force(found)
        settle = {NEAR: push, FAR: bent}
        replies = {
            NEAR: _settled(near, self._way(near, 0), moved, near.seam_force, found, dt),
            FAR: _settled(far, self._way(far, 1), far_moved, tie.far_force(told_far), forces, dt),
        }
        self._leave(replies)
        return Linked(True, replies, settle, found, gap, exchanges)

    def _bend(self, given: Floats, change: Floats, image: Floats, free: bool) -> tuple[Floats, Floats]:
        """Force on the far side's seam nodes that moves its image by -given (s, 3) [m], and their moves.

        A far side that touches nothing, `free`, gets exactly the impulse of the multiplier's `change` (s, 3) [N]:
        nothing is there to take a part of the force.
        """
        bent = lapack.dgetrs(*self._bends, _flat(given))[0] if self._bends else self._learned.s @ _flat(given)
        bent = bent.reshape(self._shape)
        if free:
            _balance(bent, change, image, self._learned.s)
        force, moved = self._tie.far_force(bent), np.empty(self._shape)
        multiply(self._far, _flat(force), _flat(moved))
        return force, moved

    def learn(self, change: Floats, moved: Floats) -> None:
        """In a step the far side was told a multiplier that is another by `change` (s, 3) [N], and moved so [m]."""
        if largest(moved) <= _SEEN * self._tolerance:
            return
        self._learned.learn(change.reshape(-1), moved.reshape(-1))

    def _way(self, reply: Advanced, side: int) -> Floats:
        """Where a side's last step and this one began (2, s, 3) [m].

        A cut's first step is told as from rest, the second as going on at its own pace: what came before is not known.
        """
        if not self._n_left:
            return np.stack([reply.seam_x, reply.seam_x])
        start = self._x[side, 1]
        return self._x[side] if self._n_left > 1 else np.stack([2.0 * start - reply.seam_x, start])

    def _leave(self, replies: Mapping[str, Advanced]) -> None:
        """The step ended so."""
        self._n_left = min(self._n_left + 1, 2)
        self._x[:, 0] = self._x[:, 1]
        self._x[0, 1], self._x[1, 1] = replies[NEAR].seam_x, replies[FAR].seam_x

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
        arrays["link_pairs"], arrays["link_x"] = self._learned.to_array(), self._x.copy()
        return arrays | {"link_flags": np.array([*flags, self._can, self._n_left], dtype=np.float64)}

    def take(self, arrays: Mapping[str, Floats], far_compliance: Floats, stiffness: Floats | None) -> None:
        """Continue from `to_arrays`, with the far side's compliance and its inverse as they were then."""
        self._line = SeamState.from_arrays(
            {name.removeprefix("line_"): array for name, array in arrays.items() if name.startswith("line_")}
        )
        self._x = np.array(arrays["link_x"])
        near, far, rough, age, least_age, skip, patience, can, n_left = arrays["link_flags"].tolist()
        self._kappa_near, self._kappa_far, self._rough, self._age = near, far, int(rough), int(age)
        self._least_age, self._skip, self._patience, self._can = int(least_age), int(skip), int(patience), bool(can)
        self._n_left, self._yield = int(n_left), np.zeros((0, 0))
        if stiffness is not None:
            self._learned.take(self._know(far_compliance), stiffness, np.array(arrays["link_pairs"]))


def _balance(force: Floats, wanted: Floats, x: Floats, stiffness: Floats) -> None:
    """Give `force` (s, 3) [N], in place, the resultant and the moment of `wanted`, at least energy.

    Rigid motions T of the seam at x (s, 3) [m] cost S T, with S = stiffness (3s, 3s) [N/m]:

        force += S T (T^T S T)^-1 T^T (wanted - force)
    """
    arm = x - x.mean(axis=0)
    rigid = np.zeros((6, *x.shape))
    for c in range(3):
        rigid[c, :, c] = 1.0
        rigid[3 + c] = np.cross(np.eye(3)[c], arm)
    rigid = rigid.reshape(6, -1)
    costs = np.empty_like(rigid)
    multiply_rows(stiffness, rigid, costs)
    for _ in range(2):  # the second takes what the first rounds off
        missing = rigid @ (wanted - force).reshape(-1)
        force += (np.linalg.lstsq(rigid @ costs.T, missing, rcond=None)[0] @ costs).reshape(x.shape)


def _settled(reply: Advanced, x: Floats, moved: Floats, force: Floats, final: Floats, dt: float) -> Advanced:
    """A reply as it would be of the settled step; contact figures stay those of the step as it was solved.

    x       where the last step and this one began (2, s, 3) [m]
    moved   how the seam's nodes are moved on (s, 3) [m]
    force   on them as the step was solved, and `final` as it is settled (s, 3) [N]
    """
    seam_x, momentum, angular = reply.seam_x.copy(), reply.momentum.copy(), reply.angular_momentum.copy()
    work, kinetic, strain = settled(seam_x, moved, x[0], x[1], force, final, dt, momentum, angular)
    return replace(
        reply,
        seam_x=seam_x,
        seam_force=final,
        seam_work=work,
        kinetic=reply.kinetic + kinetic,
        strain=reply.strain + strain,
        momentum=momentum,
        angular_momentum=angular,
        fields=None,
    )


def _flat(vectors: Floats) -> Floats:
    return np.ascontiguousarray(vectors).reshape(-1)
