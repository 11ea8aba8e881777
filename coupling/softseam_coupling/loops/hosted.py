"""How bodies of other models take a step with a pile that they touch: they first, the pile then, and they once more.

Each guest advances under the forces that it felt in the step before, and answers by R (`root`). The pile takes its
substeps with the guests' surfaces going along, linearly (services/softseam_services/pbd/kernels/guests.py), and says
what mean force acted on each. By the change of force each guest is moved on; where its linear answer is doubted
(`doubt`), all redo the step under the forces found. No compliance of the pile is asked for, whose stiffness and
substeps need no tuning.

Bodies of the pile that wake by what they felt have it take its step again, which is its own matter: what guests said of
theirs stands, and the change of force that moves them on is the last. A guest that sleeps says only where it is, and
does not give. One that wakes so advances, and the pile takes the step with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.doubt import (
    EXACT,
    FIRST_DOUBT,
    FORCE_EXCHANGES,
    STALE,
    UNCORRECTED,
    grown,
    is_force_known,
    is_linear_enough,
)
from softseam_coupling.loops.loop import (
    NOT_CONVERGED,
    Ask,
    Correction,
    Outcome,
    PartRequest,
    StepDiverged,
    largest,
    spread_over,
    wider,
)
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.messages.pile import Guest, Push

Floats = NDArray[np.float64]

__all__ = ["Hosted"]

AskPile = Callable[[list[Guest]], list[Push]]
"""has the pile take the step with its guests as they are said to be, in their order; what acted on each, or nothing
where one of them woke in it"""
CorrectGuests = Callable[[dict[str, Correction]], dict[str, Advanced]]
Awake = Callable[[], Sequence[str]]
"""guests that take the step, by part; more, as one of them wakes in it"""

LOOKS = 2
"""exchanges in which the pile looks anew for what touches, where guests then go: from there on it meets them where the
last of these had them. Faces and points that went along with each force that was found led to forces that came to no
end, two by turns"""

Expected = tuple[Floats, Floats, NDArray[np.bool_]]
"""of a guest whose step is redone: where its nodes go, by linear moves (n, 3) [m], of those of which these are known"""
_NO_MATRIX, _NO_ROWS = np.zeros((0, 0)), np.zeros((0, 3))


class Hosted:
    """The guests of a pile.

    x           their nodes as they begin, by part (n, 3) [m]
    mobility    1/mass of these (n,) [1/kg]
    tolerance   by which they may miss where linear answers have them [m]
    cell        edge of the smallest cell [m]
    exchanges   most that a step takes
    """

    def __init__(
        self,
        x: Mapping[str, Floats],
        mobility: Mapping[str, Floats],
        tolerance: float,
        cell: float,
        exchanges: int,
    ) -> None:
        self._mobility, self._tolerance, self._cell, self._most = mobility, tolerance, cell, exchanges
        self.x = {name: own.copy() for name, own in x.items()}
        """where their nodes are, by part (n, 3) [m]"""
        self.force = {name: np.zeros_like(own) for name, own in x.items()}
        """that they felt in the last step (n, 3) [N]"""
        self._kappa = dict.fromkeys(x, FIRST_DOUBT)
        self._asked = {name: np.arange(len(own)) == 0 for name, own in x.items()}
        """nodes whose answers to forces guests are asked for, by part (n,): one at least"""
        self._root: dict[str, Floats] = dict.fromkeys(x, _NO_MATRIX)
        self._sent: dict[str, bool] = dict.fromkeys(x, False)

    def forget_sent(self) -> None:
        """Parts took a snapshot or were restored: they report anew how they answer, and the pile is sent it again."""
        self._root = dict.fromkeys(self._root, _NO_MATRIX)
        self._sent = dict.fromkeys(self._sent, False)

    def solve(self, ask: Ask, ask_pile: AskPile, correct: CorrectGuests, awake: Awake, dt: float) -> Outcome:
        """Take a step of dt [s]; the replies of guests that are awake. Raises StepDiverged. A step that fails changes
        nothing but what was learned of how guests answer."""
        kappa, asked = dict(self._kappa), dict(self._asked)
        try:
            return self._solve(ask, ask_pile, correct, awake, dt)
        except BaseException:
            self._kappa, self._asked = kappa, asked
            self.forget_sent()
            raise

    def _solve(self, ask: Ask, ask_pile: AskPile, correct: CorrectGuests, awake: Awake, dt: float) -> Outcome:
        held, expected = self.force, dict[str, Expected]()
        ahead: dict[str, Floats] = {}
        stale, renewed = set[str](), set[str]()  # guests who do not go by their answers, and find these anew; that did
        for exchange in range(1, self._most + 1):
            found: list[Push] = []
            while not found:
                parts = {name: self._request(name, held[name], name in stale) for name in awake()}
                replies = ask(parts)
                self._receive(replies, dt)
                self._measure(replies, expected)
                renewed, stale = renewed | stale, set()
                looked = {name: reply.coupling.x for name, reply in replies.items()}
                ahead = ahead | looked if exchange <= LOOKS else looked | ahead
                found = ask_pile([self._guest(name, replies.get(name), held[name], ahead) for name in self.x])
                self._sent |= dict.fromkeys(replies, True)
                if found and self._lacks(found, replies):  # the same step, of which the pile is to know more
                    found = []
            felt = {name: push.force for name, push in zip(self.x, found, strict=True) if name in replies}
            pushes = {name: felt[name] - held[name] for name in felt}
            moves = {name: self._answer(name, push) for name, push in pushes.items()}
            if not all(np.isfinite(move).all() for move in moves.values()):
                raise StepDiverged("a guest's answer is not finite")
            corrects = all(reply.coupling.correctable for reply in replies.values())
            if exchange == self._most and max(map(largest, moves.values()), default=0.0) > self._cell:
                names = ", ".join(replies)
                raise StepDiverged(
                    f"{names} and the pile that they touch do not agree within {exchange} exchanges: shorten the step, "
                    "or give to pbd those that press on one another"
                )
            if corrects and (exchange == self._most or self._are_known(moves, pushes, felt, exchange)):
                replies = correct({name: Correction(pushes[name], felt[name]) for name in felt})
                return self._commit(replies, felt, moves, exchange, bool(expected))
            if not corrects and not any(largest(move) > UNCORRECTED * self._tolerance for move in moves.values()):
                return self._commit(replies, held, moves, exchange, bool(expected))
            expected = {name: (replies[name].coupling.x + moves[name], moves[name], self._asked[name]) for name in felt}
            held = held | felt
            stale = {name for name in felt if exchange > 1 and self._kappa[name] > STALE} - renewed
        return self._commit(replies, held, moves, self._most, True, NOT_CONVERGED)

    def _guest(self, name: str, reply: Advanced | None, force: Floats, ahead: Mapping[str, Floats]) -> Guest:
        if reply is None:  # it sleeps
            return Guest(self.x[name])
        root = _NO_MATRIX if self._sent[name] else self._root[name]
        return Guest(self.x[name], reply.coupling.x, force, root, ahead[name])

    def _request(self, name: str, force: Floats, renew: bool) -> PartRequest:
        asked = np.flatnonzero(self._asked[name]).astype(np.int32)
        return PartRequest(force, renew, not self._root[name].size, asked=asked)

    def _lacks(self, found: list[Push], replies: Mapping[str, Advanced]) -> bool:
        """Whether the pile met guests at nodes whose answers it does not know; they are asked for from now on."""
        lacks = False
        for (name, asked), push in zip(self._asked.items(), found, strict=True):
            needed = np.zeros_like(asked)
            needed[push.nodes] = True
            if name in replies and (needed & ~asked).any():
                self._asked[name], lacks = needed | asked, True
            elif needed.any():
                self._asked[name] = wider(asked, needed)
        return lacks

    def _receive(self, replies: Mapping[str, Advanced], dt: float) -> None:
        """Take how parts answer; those that cannot say, as their masses would."""
        for name, reply in replies.items():
            root = reply.coupling.root
            if root.size and np.isfinite(root).all():
                asked = np.flatnonzero(self._asked[name]).astype(np.int32)
                self._root[name], self._sent[name] = spread_over(root, asked, len(self.x[name])), False
            elif not self._root[name].size:
                self._root[name] = np.diag(np.sqrt(dt * dt * np.repeat(self._mobility[name], 3)))

    def _answer(self, name: str, push: Floats) -> Floats:
        root = self._root[name]
        return np.asarray((root @ (root.T @ push.reshape(-1))).reshape(-1, 3))

    def _measure(self, replies: Mapping[str, Advanced], expected: Mapping[str, Expected]) -> None:
        """A step was redone: compare where guests went with their linear answers, at the nodes that these are of."""
        for name, (place, move, known) in expected.items():
            went = largest(move)
            if went > EXACT * self._tolerance:
                self._kappa[name] = largest((replies[name].coupling.x - place)[known]) / went

    def _are_known(
        self, moves: Mapping[str, Floats], pushes: Mapping[str, Floats], felt: Mapping[str, Floats], exchange: int
    ) -> bool:
        """Whether no linear answer is doubted, nor, in the first exchanges, the force behind one."""
        of = self._cell, self._tolerance
        found = float(sum(np.abs(force).sum() for last in (felt, self.force) for force in last.values()))
        return all(
            is_linear_enough(self._kappa[name], move, *of)
            and (exchange > FORCE_EXCHANGES or is_force_known(self._kappa[name], move, pushes[name], found, *of))
            for name, move in moves.items()
        )

    def _commit(
        self,
        replies: dict[str, Advanced],
        force: dict[str, Floats],
        moves: Mapping[str, Floats],
        exchanges: int,
        measured: bool,
        note: str = "",
    ) -> Outcome:
        self.x = self.x | {name: reply.coupling.x for name, reply in replies.items()}
        self.force = self.force | force
        if not measured:
            self._kappa = {name: grown(kappa) for name, kappa in self._kappa.items()}
        gap = max((largest(move) for move in moves.values()), default=0.0) if note else 0.0
        return Outcome(replies, _NO_ROWS, gap, exchanges, note)

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, but what the parts report anew, for a snapshot."""
        arrays = {f"x.{name}": x for name, x in self.x.items()}
        arrays |= {f"force.{name}": force for name, force in self.force.items()}
        arrays |= {f"asked.{name}": asked.astype(np.float64) for name, asked in self._asked.items()}
        return arrays | {f"kappa.{name}": np.array([kappa]) for name, kappa in self._kappa.items()}

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError, and changes nothing, where these are of others."""
        for name, x in self.x.items():
            if arrays[f"x.{name}"].shape != x.shape or arrays[f"force.{name}"].shape != x.shape:
                raise ValueError(f"the saved guests have no {len(x)} nodes of {name!r}")
            if arrays[f"asked.{name}"].shape != (len(x),):
                raise ValueError(f"the saved guests do not say which of {len(x)} nodes of {name!r} are met")
        kappa = {name: float(arrays[f"kappa.{name}"][0]) for name in self.x}
        self.x = {name: np.array(arrays[f"x.{name}"]) for name in self.x}
        self.force = {name: np.array(arrays[f"force.{name}"]) for name in self.x}
        self._asked = {name: arrays[f"asked.{name}"] > 0.0 for name in self.x}
        self._kappa = kappa
        self.forget_sent()
