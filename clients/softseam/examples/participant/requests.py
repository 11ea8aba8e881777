"""Requests in order, their repeats and their refusals: what any participant must do, whatever moves its part."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from softseam.examples.participant.block import LinearBlock
from softseam_protocol.errors import Refused
from softseam_protocol.messages import participant as messages
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import FailureKind, Status
from softseam_protocol.wire.codec import decode, encode

Floats = NDArray[np.float64]

MODELS = ("block", "fem", "pbd")
"""a scene calls it by the model in whose place it moves the part"""
_MOST = 64
"""sessions that are kept: orchestrators may die without a Release"""


@dataclass
class Seat:
    """A part of a session: its block stands at the committed state, the tentative one is beside it."""

    block: LinearBlock
    epoch: int
    committed: int
    exchange: int = -1
    """of the tentative step, -1 where there is none"""
    tentative: tuple[Floats, Floats] | None = None
    asked: messages.Advance | None = None
    kept: dict[type, messages.Reply] = field(default_factory=dict)
    """the last reply to each kind of request"""


class Participant:
    """Bytes in, bytes out, for any number of sessions; one thread calls it."""

    def __init__(self) -> None:
        self.seats: dict[tuple[str, str], Seat] = {}

    def __call__(self, payload: bytes) -> bytes:
        """The reply. Raises Refused, and DecodeError or SchemaMismatch, which the bus answers with a Failure."""
        request, began = decode(payload, messages.Request), perf_counter()
        try:
            reply = self.answer(request)
        except ValueError as error:
            raise refused("invalid", str(error)) from None
        if isinstance(reply, messages.Worked) and not reply.seconds:
            reply = replace(reply, seconds=perf_counter() - began)
        seat = self.seats.get((request.header.session, request.header.part))
        if seat is not None:
            seat.kept[type(request)] = reply
        return encode(reply)

    def answer(self, request: messages.Request) -> messages.Reply:
        """Raises Refused and ValueError."""
        header = request.header
        key = (header.session, header.part)
        seat = self.seats.get(key)
        if isinstance(request, messages.Release):
            self.seats.pop(key, None)
            return messages.Released(header)
        if seat is not None:
            kept = seat.kept.get(type(request))
            begun = isinstance(request, messages.Configure) and (seat.committed, seat.exchange) != (header.step, -1)
            if kept is not None and not isinstance(kept, messages.Failure) and kept.header == header and not begun:
                return kept
        if isinstance(request, messages.Configure):
            if seat is not None and header.epoch < seat.epoch:
                raise stale(header, seat)
            return self.configure(key, request)
        if seat is None:
            raise refused("not_configured", f"session {header.session!r} has no part here: send Configure first")
        if header.epoch != seat.epoch:
            raise stale(header, seat)
        follows = header.step == seat.committed + 1 and seat.exchange >= 0
        if follows and isinstance(request, messages.Advance | messages.Commit | messages.Snapshot):
            commit(seat)
        if isinstance(request, messages.Advance):
            if header.step != seat.committed or header.exchange <= seat.exchange:
                raise stale(header, seat)
            return advance(seat, request)
        if isinstance(request, messages.Correct):
            if header.step != seat.committed or not 0 <= seat.exchange < header.exchange:
                raise stale(header, seat)
            return correct(seat, request)
        if isinstance(request, messages.Observe):
            return fields(seat, header)
        if isinstance(request, messages.Restore):
            seat.block.take(request.state)
            seat.committed, seat.exchange, seat.tentative, seat.kept = header.step, -1, None, {}
            return messages.Restored(header)
        if header.step != seat.committed:
            raise stale(header, seat)
        seat.exchange, seat.tentative = -1, None  # a step that failed elsewhere
        if isinstance(request, messages.Commit):
            return messages.Committed(header, fields(seat, header) if request.fields else None)
        return messages.SnapshotTaken(header, seat.block.to_bytes())

    def configure(self, key: tuple[str, str], request: messages.Configure) -> messages.Configured:
        """Build the part anew."""
        if request.model not in MODELS:
            raise refused("invalid", f"no model is called {request.model!r} here: ask for one of {', '.join(MODELS)}")
        block = LinearBlock(request)
        self.seats.pop(key, None)
        while len(self.seats) >= _MOST:
            self.seats.pop(next(iter(self.seats)))
        self.seats[key] = Seat(block, request.header.epoch, request.header.step)
        kinetic, strain, gravity = block.energies(block.x, block.v)
        can = messages.Capabilities(True, True, False, 1, True, False, 0.0)
        n_nodes, n_cells = len(block.rest), len(request.cells)
        return messages.Configured(request.header, n_nodes, n_cells, 1, strain, kinetic, gravity, capabilities=can)


def advance(seat: Seat, request: messages.Advance) -> messages.Advanced:
    """Take the step tentatively."""
    check(seat, request.seam_force)
    if not (np.isfinite(request.dt) and request.dt > 0.0):
        raise ValueError(f"the time step is {request.dt} s: send one that is positive")
    if len(request.seam_anchor) or len(request.seam_force_start):
        raise ValueError("this participant takes constant forces alone: send no anchor and no force at the start")
    seat.tentative = seat.block.step(request.dt, request.seam_force)
    seat.exchange, seat.asked = request.header.exchange, request
    return told(seat, request.header, request.seam_force, request.compliance, request.fields)


def correct(seat: Seat, request: messages.Correct) -> messages.Advanced:
    """Move the tentative step on by the compliance that was told."""
    assert seat.asked is not None and seat.tentative is not None
    check(seat, request.push)
    check(seat, request.force)
    if seat.block.told_dt != seat.asked.dt:
        raise ValueError("the compliance of steps of this length was not told: ask for it first")
    way = seat.block.answer(request.push)
    x, v = seat.tentative
    seat.tentative, seat.exchange = (x + way, v + way / seat.asked.dt), request.header.exchange
    return told(seat, request.header, request.force, False, request.fields)


def check(seat: Seat, force: Floats) -> None:
    """Raises ValueError for what is no force on the coupling nodes."""
    n = len(seat.block.coupling)
    if force.shape != (n, 3) or not np.isfinite(force).all():
        raise ValueError(f"a force of shape {force.shape}: this part's coupling nodes need ({n}, 3) finite numbers")


def told(seat: Seat, header: Header, force: Floats, compliance: bool, with_fields: bool) -> messages.Advanced:
    """What the tentative step says of itself."""
    assert seat.asked is not None and seat.tentative is not None
    block, (x, v) = seat.block, seat.tentative
    kinetic, strain, gravity = block.energies(x, v)
    momentum = block.mass[:, None] * v
    return messages.Advanced(
        header=header,
        status=Status.CONVERGED,
        seam_x=x[block.coupling],
        compliance=block.compliance(seat.asked.dt) if compliance else np.zeros((0, 0)),
        wrench=np.zeros((len(seat.asked.tools.position), 6)),  # it touches no tool
        kinetic=kinetic,
        strain=strain,
        gravity=gravity,
        tool_work=0.0,
        seam_work=float((force * (x - block.x)[block.coupling]).sum()),
        momentum=momentum.sum(axis=0),
        angular_momentum=np.cross(x, momentum).sum(axis=0),
        penetration=0.0,
        slip=0.0,
        n_contacts=0,
        iterations=1,
        seconds=0.0,
        cell_distance=np.full(len(block.mesh.cell_nodes), np.inf),
        bounds=np.stack([x.min(axis=0), x.max(axis=0)]),
        settles=block.told_dt == seat.asked.dt,
        fields=fields(seat, header) if with_fields else None,
    )


def fields(seat: Seat, header: Header) -> messages.Fields:
    """Of the tentative state, where there is one."""
    block, points = seat.block, seat.block.mesh.points
    x, v = seat.tentative or (block.x, block.v)
    return messages.Fields(
        header=header,
        nodes=block.mesh.nodes,
        x=x,
        v=v,
        cauchy=block.stress(x),
        points=points,
        point_x=block.surface(x),
        contact_force=np.zeros((len(points), 3)),
        contact_tool=np.full(len(points), -1, dtype=np.int32),
        cell_energy=block.cell_energy(x),
    )


def commit(seat: Seat) -> None:
    """What is tentative stays."""
    assert seat.tentative is not None
    seat.block.x, seat.block.v = seat.tentative
    seat.committed, seat.exchange, seat.tentative = seat.committed + 1, -1, None


def stale(header: Header, seat: Seat) -> Refused:
    here = f"epoch {seat.epoch}, step {seat.committed}, exchanges above {seat.exchange}"
    return refused("stale", f"epoch {header.epoch}, step {header.step}, exchange {header.exchange}: send {here}")


def refused(kind: str, message: str) -> Refused:
    return Refused(messages.Failure(FailureKind(kind), message))
