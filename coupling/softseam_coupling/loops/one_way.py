"""One way to take a step: predict, advance all parts at once, solve for the multipliers, correct, or redo.

All parts advance at once, each under the forces that the predicted multipliers put on its coupling nodes. What is then
left of the gaps is closed at once over all rows of all interfaces, by the compliance that every part reports
(`closure`), and the parts are moved on by their linear answers, which are part of the state that is committed.

A part's linear answer is not quite what it would do. By how much was seen when a step was redone last, as a share kappa
of the move; where kappa times the move exceeds the tolerance, or the move is not small beside a cell, all parts redo
the step under the multipliers found. In the first four exchanges they redo it, too, where kappa times the force behind
the move, as a share of the multipliers, exceeds ten times the tolerance, as a share of a cell: in a stiff body a gap
far below the tolerance stands for much force. Parts that cannot be moved on redo it until the gap is within half the
tolerance.

A part that can takes the parts beyond its interfaces into its own solve, as a linear impedance S that draws its nodes
to where these are expected: f = lambda + S (target - x). It then finds where its contacts stick and slip with the rest
of the body behind it, and its answer errs little where it would move freely alone. (In domain decomposition: a Robin
condition.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.loops.closure import Closure
from softseam_coupling.loops.coupled_part import laws_of, parts_of
from softseam_coupling.loops.doubt import (
    EXACT,
    FORCE_EXCHANGES,
    STALE,
    UNCORRECTED,
    Linearity,
    grown,
    is_force_known,
    is_linear_enough,
)
from softseam_coupling.loops.loop import (
    NOT_CONVERGED,
    Ask,
    Correct,
    Correction,
    LoopSetup,
    Outcome,
    PartRequest,
    StepDiverged,
    StepRefused,
    ask_compliance_of,
    largest,
    spread_over,
)
from softseam_coupling.multipliers import Multipliers
from softseam_coupling.prediction import Prediction
from softseam_protocol.messages.outcomes import Figure, Status
from softseam_protocol.messages.participant import Advanced, Capabilities

Floats = NDArray[np.float64]
Ids = NDArray[np.int32]

_NONE = np.zeros((0, 0))


class OneWay:
    """A `Loop`: the default. Any number of parts may meet at any interfaces, if all report their compliance.

    Beside rows that press compliances are not updated where a step was redone: exchanges are as many.
    """

    def __init__(self, setup: LoopSetup) -> None:
        self._setup = setup
        self._parts, offset = parts_of(setup.interfaces, {name: len(m) for name, m in setup.mobility.items()})
        self._closure = Closure(self._parts, offset, *laws_of(setup.interfaces))
        self._capabilities: Mapping[str, Capabilities] = {}
        self._linearity = {name: Linearity() for name in self._parts}
        self._multipliers = Multipliers(setup.interfaces, setup.first)
        self._impedance_part: str | None = None  # that is solved with the others behind it
        self._target = Prediction(0)  # where these are expected, on its nodes
        self._impedance = _NONE  # of the others, as it is to have it
        self._sent = False  # and whether it does
        self._dt = 0.0  # of the last step, 0 before the first [s]

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """The parts are configured. Raises Unsuited where one reports no compliance, ValueError where what was taken is
        of parts that can do other things."""
        ask_compliance_of(self._parts, capabilities)
        self._capabilities = capabilities
        able = (name for name, part in self._parts.items() if part.sign and capabilities[name].impedance)
        self._impedance_part = None if self._closure.presses else next(able, None)
        n_nodes = 0 if self._impedance_part is None else len(self._setup.mobility[self._impedance_part])
        if not self._dt:
            self._target = Prediction(n_nodes)
            return
        if self._target.last.shape != (n_nodes, 3):
            raise ValueError(f"the saved target has {len(self._target.last)} nodes in place of {n_nodes}")
        self.forget_sent()

    def multipliers(self) -> Floats:
        """The last committed ones (c, 3) [N]."""
        return self._multipliers.last

    def renew(self, interfaces: tuple[Interface, ...]) -> None:
        """These rows hold in the step to come, of the same parts and nodes."""
        parts, offset = parts_of(interfaces, {name: part.rows.shape[1] for name, part in self._parts.items()})
        for name, part in parts.items():
            self._parts[name].rows, self._parts[name].sign = part.rows, part.sign
            self._parts[name].look_at_rows()
        self._multipliers.renew(interfaces)
        self._closure.renew(offset, *laws_of(interfaces))

    def solve(self, ask: Ask, correct: Correct, dt: float, may_refuse: bool = False) -> Outcome:
        """A step that fails leaves everything as it was. What a part reported in it may not have arrived: it
        is asked again."""
        saved = {name: (part.save(), self._linearity[name].save()) for name, part in self._parts.items()}
        rest = self._closure.save(), self._impedance, self._dt
        predictions = self._multipliers.save(), self._target.save()
        try:
            return self._solve(ask, correct, dt, may_refuse)
        except BaseException:
            for name, (part, linearity) in saved.items():
                self._parts[name].restore(part)
                self._linearity[name] = Linearity(*linearity)
            inverse, self._impedance, self._dt = rest
            self._closure.restore(inverse)
            self._multipliers.restore(predictions[0])
            self._target.restore(predictions[1])
            self._resend()
            raise

    def _resend(self) -> None:
        """The part that is solved with the others behind it may lack their impedance: it reports anew."""
        self._sent = False
        if self._impedance_part is not None:
            self._linearity[self._impedance_part].repeat = True

    def _solve(self, ask: Ask, correct: Correct, dt: float, may_refuse: bool) -> Outcome:
        most = self._setup.exchanges
        if dt != self._dt:
            self._change(dt)
        multipliers, target = self._predict()
        x: dict[str, Floats] = {}
        moves: dict[str, Floats] = {}
        requests: dict[str, PartRequest] = {}
        for exchange in range(1, most + 1):
            before, asked = x, requests
            requests = {name: self._request(name, multipliers, target) for name in self._parts}
            replies = ask(requests)
            x = {name: reply.coupling.x for name, reply in replies.items()}
            self._measure(replies, x, before, moves, requests, asked)
            self._receive(replies, requests)
            gap = self._closure.gap(x)
            size = largest(self._closure.left(gap, multipliers))
            if not math.isfinite(size):
                raise StepDiverged("a part's answer is not finite")
            if may_refuse and any(reply.status != Status.CONVERGED for reply in replies.values()):
                raise StepRefused(exchange)  # a part that stands where it began says nothing of the others
            acted = {name: _acted(replies[name], request) for name, request in requests.items()}
            found, pushes, moves = self._closure.solve(gap, acted, multipliers, EXACT * self._setup.tolerance)
            if all(reply.coupling.correctable for reply in replies.values()):
                trusted = self._is_linear_enough(moves)
                if exchange <= FORCE_EXCHANGES:
                    trusted = trusted and self._is_force_known(moves, pushes, found)
                corrected = self._corrections(replies, found, pushes, moves) if trusted else None
                if corrected is not None:
                    corrections, misses = corrected
                    places = {name: x[name] + moves[name] - misses.get(name, 0.0) for name in x}
                    self._commit(replies, found, places, exchange, bool(before))
                    return self._outcome(correct(corrections, self._first), found, exchange)
            elif size <= UNCORRECTED * self._setup.tolerance:
                self._commit(replies, multipliers, x, exchange, bool(before))
                return self._outcome(replies, multipliers, exchange)
            if exchange < most:
                multipliers = found
                if self._impedance_part is not None:
                    target = self._closure.target(self._impedance_part, {name: x[name] + moves[name] for name in x})
        if may_refuse:
            raise StepRefused(most)
        self._commit(replies, multipliers, x, most, True)
        return self._outcome(replies, multipliers, most, NOT_CONVERGED)

    def _predict(self) -> tuple[Floats, Floats | None]:
        """Multipliers of the coming step (c, 3) [N], and where the parts beyond the impedance's are expected."""
        target = self._target.predict(self._dt) if self._target.known else None
        return self._closure.allowed(self._multipliers.predict(self._dt)), target

    def _first(self) -> dict[str, PartRequest]:
        """See `First`."""
        multipliers, target = self._predict()
        return {name: self._request(name, multipliers, target) for name in self._parts}

    def forget_sent(self) -> None:
        """What parts keep of one another is sent again; one that was solved with an impedance reports its
        compliance anew."""
        self._resend()
        if self._impedance_part is not None:
            part = self._parts[self._impedance_part]
            part.root = part.impedance = _NONE
            part.compliance = np.diag(self._dt**2 * np.repeat(self._setup.mobility[self._impedance_part], 3))
        self._closure.compliance_changed()

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, but what the parts report anew, for a snapshot."""
        arrays = {f"multipliers_{key}": array for key, array in self._multipliers.to_arrays().items()}
        arrays |= {f"target_{key}": array for key, array in self._target.to_arrays().items()}
        arrays |= {"impedance": self._impedance, "dt": np.array([self._dt])}
        for name, linearity in self._linearity.items():
            arrays[f"linearity_{name}"] = linearity.to_array()
            arrays[f"asked_{name}"] = self._parts[name].asked.astype(np.float64)
            arrays[f"compliance_{name}"] = self._parts[name].compliance
            arrays[f"reported_{name}"] = self._parts[name].reported
            arrays[f"root_{name}"] = _NONE if name == self._impedance_part else self._parts[name].root
        return arrays

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError where these are of others."""
        self._target = Prediction(arrays["target_kept"].shape[1])
        for prefix, prediction in (("multipliers_", self._multipliers), ("target_", self._target)):
            prediction.take({key.removeprefix(prefix): each for key, each in arrays.items() if key.startswith(prefix)})
        self._impedance, self._dt = np.array(arrays["impedance"]), float(arrays["dt"][0])
        for name in self._parts:
            self._linearity[name] = Linearity.of(arrays[f"linearity_{name}"])
            compliance, reported = (np.array(arrays[f"{kind}_{name}"]) for kind in ("compliance", "reported"))
            self._parts[name].root = np.array(arrays[f"root_{name}"])
            self._parts[name].asked = arrays[f"asked_{name}"] > 0.0
            self._parts[name].reported = reported  # the same as long as it was not updated
            self._parts[name].compliance = reported if np.array_equal(reported, compliance) else compliance
        if self._capabilities:
            self.forget_sent()

    def _change(self, dt: float) -> None:
        """Steps are of another length from now on, and so is every part's compliance."""
        for name, linearity in self._linearity.items():
            linearity.renew = not self._capabilities[name].impedance
            self._parts[name].root = _NONE
            self._parts[name].compliance = np.diag(dt * dt * np.repeat(self._setup.mobility[name], 3))
            self._parts[name].reported = _NONE
        self._closure.compliance_changed()
        self._use_impedance(False)
        self._dt = dt

    def _use_impedance(self, on: bool) -> None:
        """Let the part that can be solved with the others behind it; or without, until they report their compliance."""
        if self._impedance_part is not None:
            self._impedance = self._closure.impedance(self._impedance_part) if on else _NONE
            self._sent = False

    def _request(self, name: str, multipliers: Floats, target: Floats | None) -> PartRequest:
        force, linearity = self._parts[name].force(multipliers), self._linearity[name]
        if name != self._impedance_part or target is None or not self._impedance.size:
            return PartRequest(force, linearity.renew, linearity.repeat, asked=self._asked_of(name), last=False)
        impedance = None if self._sent else self._impedance
        self._sent = True
        return PartRequest(force, linearity.renew, linearity.repeat, target, impedance, last=False)

    def _asked_of(self, name: str) -> Ids | None:
        """Places of the nodes whose answers a part is asked for; None: of all."""
        rows, asked = self._parts[name].rows, self._parts[name].asked
        if self._impedance_part is not None or (len(rows) and not self._closure.presses):
            return None
        return np.flatnonzero(asked).astype(np.int32)

    def _measure(
        self,
        replies: Mapping[str, Advanced],
        x: Mapping[str, Floats],
        before: Mapping[str, Floats],
        moves: Mapping[str, Floats],
        requests: Mapping[str, PartRequest],
        asked: Mapping[str, PartRequest],
    ) -> None:
        """A step was redone: compare where parts went with their linear answers, and update their compliances."""
        if not before:
            return
        for name, part in self._parts.items():
            went = largest(moves[name])
            if went > EXACT * self._setup.tolerance:
                miss = x[name] - before[name] - moves[name]
                linearity = self._linearity[name]
                known = slice(None) if requests[name].asked is None else requests[name].asked
                linearity.kappa = largest(miss[known]) / went
                # the factor that it reported is not that of the end of the step
                linearity.renew = linearity.renew or (self._reports_every_factor(name) and linearity.kappa > STALE)
                change = requests[name].force - asked[name].force
                if (
                    part.compliance.size
                    and not self._closure.presses
                    and replies[name].coupling.correctable
                    and np.any(change)
                ):
                    self._closure.update(name, miss, change)

    def _receive(self, replies: Mapping[str, Advanced], requests: Mapping[str, PartRequest]) -> None:
        """Take the compliances that parts report."""
        news = False
        for name, part in self._parts.items():
            reply, linearity = replies[name], self._linearity[name]
            root = spread_over(reply.coupling.root, requests[name].asked, part.rows.shape[1])
            compliance = reply.coupling.compliance
            if not (root.size or compliance.size) or not np.isfinite(root).all() or not np.isfinite(compliance).all():
                continue
            if name == self._impedance_part:
                part.impedance = _NONE if requests[name].target is None else self._impedance
                part.root, part.compliance = (root, _NONE) if root.size else (_NONE, compliance)
            elif root.size and self._closure.presses:
                part.root = root
                part.compliance = part.reported = part.reported_inverse = _NONE
            else:
                part.root, part.compliance = _NONE, root @ root.T if root.size else compliance
                part.reported, part.reported_inverse = part.compliance, _NONE
                news = news or linearity.renew or not self._impedance.size
            linearity.renew = linearity.repeat = False
            linearity.age = linearity.age if name == self._impedance_part else 0
            if name != self._impedance_part or not part.pushed:
                self._closure.compliance_changed()
        if news:
            self._use_impedance(True)

    def _reports_every_factor(self, name: str) -> bool:
        """Whether a part reports the compliance of every new factor, without others behind it."""
        return name != self._impedance_part and self._capabilities[name].impedance

    def _is_linear_enough(self, moves: Mapping[str, Floats]) -> bool:
        """Whether linear answers of this size are what the parts would do, to the tolerance."""
        of = self._setup.cell, self._setup.tolerance
        return all(is_linear_enough(self._linearity[name].kappa, move, *of) for name, move in moves.items())

    def _is_force_known(self, moves: Mapping[str, Floats], pushes: Mapping[str, Floats], found: Floats) -> bool:
        """Whether the forces behind linear answers are doubted by little beside the multipliers found (c, 3) [N]."""
        of = float(np.abs(found).sum()), self._setup.cell, self._setup.tolerance
        return all(is_force_known(self._linearity[name].kappa, moves[name], push, *of) for name, push in pushes.items())

    def _corrections(
        self, replies: Mapping[str, Advanced], found: Floats, pushes: Mapping[str, Floats], moves: Mapping[str, Floats]
    ) -> tuple[dict[str, Correction], dict[str, Floats]] | None:
        """What moves the parts to where they agree under the multipliers found (c, 3) [N], and by how much parts miss
        that (n, 3) [m]; None where it cannot."""
        corrections, misses = {}, {}
        for name, part in self._parts.items():
            push, short = part.push_for(pushes[name], moves[name], replies[name].figure(Figure.CONTACTS) == 0)
            if short is not None:
                if largest(short) > 0.3 * self._setup.tolerance:
                    return None
                misses[name] = short
            corrections[name] = Correction(push, part.force(found))
        return corrections, misses

    def _commit(
        self,
        replies: Mapping[str, Advanced],
        multipliers: Floats,
        x: dict[str, Floats],
        exchanges: int,
        measured: bool,
    ) -> None:
        """The step ends with these multipliers (c, 3) [N] and nodes (n, 3) [m], which parts will have been moved to."""
        for name, linearity in self._linearity.items():
            n_contacts = int(replies[name].figure(Figure.CONTACTS))
            touches = (n_contacts > 0) != (linearity.n_contacts > 0)
            old = exchanges > 1 and linearity.age >= linearity.least_age and linearity.kappa > STALE
            if name != self._impedance_part and not self._reports_every_factor(name):
                linearity.renew = linearity.renew or touches or old
                linearity.least_age *= 2 if old else 1
            if not measured:
                linearity.kappa = grown(linearity.kappa)
            linearity.n_contacts, linearity.age = n_contacts, linearity.age + 1
        self._multipliers.commit(multipliers, self._dt)
        if self._impedance_part is not None:
            self._target.commit(self._closure.target(self._impedance_part, x), self._dt)

    def _outcome(self, replies: dict[str, Advanced], multipliers: Floats, exchanges: int, note: str = "") -> Outcome:
        gap = self._closure.gap({name: reply.coupling.x for name, reply in replies.items()})
        return Outcome(replies, multipliers, largest(self._closure.left(gap, multipliers)), exchanges, note)


def _acted(reply: Advanced, request: PartRequest) -> Floats:
    """Force that acted on a part's nodes (n, 3) [N]."""
    return reply.coupling.force if len(reply.coupling.force) else request.force
