"""The order of requests: one `handle` for every transport, any number of sessions a process.

A request is answered once; the same request again gets the same reply; a request from the past is refused and changes
nothing. See `solver` for the states.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

from softseam_protocol.messages.header import SCHEMA_VERSION, Header, changed
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Commit,
    Committed,
    Configure,
    Correct,
    Failure,
    Fields,
    Observe,
    Release,
    Released,
    Reply,
    Request,
    Restore,
    Restored,
    Snapshot,
    SnapshotTaken,
)
from softseam_protocol.participant.solver import Solver, SolverFactory

SLOTS_KEPT = 64
"""of sessions whose orchestrators may have died without a Release"""
_TIMED_HERE = (Committed, Fields, SnapshotTaken, Restored)
"""replies whose seconds are those of the whole answer; a solver reports its own of a step"""
_NOT_KEPT = (Failure, Fields)
"""replies that a repeated request is given anew"""

_log = logging.getLogger(__name__)

Check = Callable[[Any, Advance | Correct], None]


@dataclass
class Slot:
    """One part of one session."""

    solver: Any
    """a Solver, of the kind that the factory builds"""
    epoch: int
    committed: int
    """steps committed"""
    exchange: int = -1
    """exchange of the tentative step `committed`, -1 where there is none"""
    replies: dict[type, tuple[Request, Reply]] = field(default_factory=dict)
    """last request and reply of each kind, for repeats"""


class Participant:
    """Answers requests for any number of sessions; not thread-safe: one thread owns it."""

    def __init__(self, build: SolverFactory, check: Check | None = None) -> None:
        """`build` makes the solver of a Configure. `check` raises ValueError for an Advance or Correct that a solver
        cannot serve, before the step before it is committed; without it solvers refuse by themselves."""
        self._build, self._check = build, check
        self.slots: dict[tuple[str, str], Slot] = {}
        """by session and part, in the order of their last use"""

    def solver(self, session: str, part: str) -> Solver:
        """What computes a part that is configured here. Raises KeyError where none is."""
        solver: Solver = self.slots[session, part].solver
        return solver

    def handle(self, request: Request) -> Reply:
        """Serve one request; every failure is a `Failure`, never an exception."""
        header = request.header
        if header.schema != SCHEMA_VERSION:
            return Failure(
                FailureKind.SCHEMA,
                f"the request has schema version {header.schema}, this participant speaks {SCHEMA_VERSION}: "
                "install the same version of softseam on both sides",
            )
        try:
            return self._serve(request)
        except MemoryError:
            return Failure(FailureKind.INTERNAL, "out of memory: use larger cells or give the participant more")
        except Exception as error:  # a service must answer; the text names the cause
            if not isinstance(error, ValueError):
                _log.exception("%s of %s failed", type(request).__name__, header)
            return Failure(FailureKind.INVALID, f"{type(error).__name__}: {error}")

    def _serve(self, request: Request) -> Reply:
        key = (request.header.session, request.header.part)
        slot = self._used(key)
        if isinstance(request, Configure):
            if slot is not None:
                kept = slot.replies.get(Configure)
                untouched = slot.committed == request.header.step and slot.exchange < 0
                if kept is not None and kept[0].header == request.header and untouched:
                    return kept[1]
                if request.header.epoch < slot.epoch:
                    return _stale(request, slot)
            return self._configure(key, request)
        if isinstance(request, Release):
            if slot is not None and slot.epoch <= request.header.epoch:  # a late one is of a part that is gone
                del self.slots[key]
            return Released(request.header)
        if slot is None:
            return Failure(
                FailureKind.NOT_CONFIGURED,
                f"no part {key[1]!r} of session {key[0]!r} is configured here: send Configure first",
            )
        kept = slot.replies.get(type(request))
        if kept is not None and kept[0].header == request.header:
            return kept[1]
        began = perf_counter()
        reply = self._answer(slot, request)
        if isinstance(reply, _TIMED_HERE):
            reply = replace(reply, seconds=perf_counter() - began)
        if not isinstance(reply, _NOT_KEPT):
            slot.replies[type(request)] = (request, reply)
        return reply

    def _used(self, key: tuple[str, str]) -> Slot | None:
        """A slot, which is then the last of all to be given up."""
        slot = self.slots.pop(key, None)
        if slot is not None:
            self.slots[key] = slot
        return slot

    def _configure(self, key: tuple[str, str], request: Configure) -> Reply:
        began = perf_counter()
        solver, reply = self._build(request)
        reply = replace(reply, seconds=perf_counter() - began)
        self.slots.pop(key, None)
        while len(self.slots) >= SLOTS_KEPT:
            self.slots.pop(next(iter(self.slots)))  # an orchestrator that still wants it configures it again
        self.slots[key] = Slot(solver, request.header.epoch, request.header.step, -1, {Configure: (request, reply)})
        return reply

    def _answer(self, slot: Slot, request: Request) -> Reply:
        header = request.header
        if header.epoch != slot.epoch:
            return _stale(request, slot)
        if isinstance(request, Advance):
            began = perf_counter()
            follows = header.step == slot.committed + 1 and slot.exchange >= 0
            if not follows and (header.step != slot.committed or header.exchange <= slot.exchange):
                return _stale(request, slot)
            if self._check is not None:
                self._check(slot.solver, request)
            if follows:
                _commit(slot)
            return _with_fields(slot, request, slot.solver.advance(request), began)
        if isinstance(request, Correct):
            began = perf_counter()
            if header.step != slot.committed or not 0 <= slot.exchange < header.exchange:
                return _stale(request, slot)
            if request.then is not None and not _follows(request.then.header, header):
                return Failure(FailureKind.INVALID, "Correct.then is not the first Advance of the step that follows")
            if self._check is not None:
                self._check(slot.solver, request)
            corrected = _with_fields(slot, request, slot.solver.correct(request), began)
            after = None if request.then is None else self.handle(request.then)
            return replace(corrected, then=after) if isinstance(after, Advanced) else corrected
        if isinstance(request, Observe):
            observed: Fields = slot.solver.fields(header, request.indicators, request.own)
            return observed
        if isinstance(request, Commit | Snapshot):
            if header.step == slot.committed + 1 and slot.exchange >= 0:
                _commit(slot)
            if header.step != slot.committed:
                return _stale(request, slot)
            if slot.exchange >= 0:  # a step that failed on the other side
                slot.solver.discard()
                slot.exchange = -1
            if isinstance(request, Commit):
                return Committed(header, slot.solver.fields(header) if request.fields else None)
            return SnapshotTaken(header, slot.solver.snapshot())
        if isinstance(request, Restore):
            slot.solver.restore(request.state)
            slot.committed, slot.exchange = header.step, -1
            slot.replies = {Configure: slot.replies[Configure]}
            return Restored(header)
        return Failure(FailureKind.INVALID, f"a participant does not answer {type(request).__name__}")


def _with_fields(slot: Slot, request: Advance | Correct, reply: Advanced, began: float) -> Advanced:
    """The reply to a tentative step, with the fields where they are asked for; a step whose fields fail is none."""
    if request.fields:  # the solver's clock runs while it advances only
        try:
            reply = changed(reply, fields=slot.solver.fields(request.header), seconds=perf_counter() - began)
        except Exception:
            slot.solver.discard()
            slot.exchange = -1
            raise
    slot.exchange = request.header.exchange
    return reply


def _follows(header: Header, before: Header) -> bool:
    """Whether a request is the first for the step that follows that of another, of the same part."""
    return header == replace(before, step=before.step + 1, exchange=0, time=header.time)


def _commit(slot: Slot) -> None:
    """Commit the tentative step."""
    slot.solver.commit()
    slot.committed += 1
    slot.exchange = -1


def _stale(request: Request, slot: Slot) -> Failure:
    header = request.header
    return Failure(
        FailureKind.STALE,
        f"{type(request).__name__} of epoch {header.epoch}, step {header.step}, exchange {header.exchange} does not "
        f"follow epoch {slot.epoch}, {slot.committed} committed steps, exchange {slot.exchange}",
    )
