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
class Slot:
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
        self.slots: dict[tuple[str, str], Slot] = {}

    def __call__(self, payload: bytes) -> bytes:
        """The reply. Raises Refused, and DecodeError or SchemaMismatch, which the bus answers with a Failure."""
        request, began = decode(payload, messages.Request), perf_counter()
        try:
            reply = self.answer(request)
        except ValueError as error:
            raise refused("invalid", str(error)) from None
        if isinstance(reply, messages.Worked) and not reply.seconds:
            reply = replace(reply, seconds=perf_counter() - began)
        slot = self.slots.get((request.header.session, request.header.part))
        if slot is not None:
            slot.kept[type(request)] = reply
        return encode(reply)

    def answer(self, request: messages.Request) -> messages.Reply:
        """Raises Refused and ValueError."""
        header = request.header
        key = (header.session, header.part)
        slot = self.slots.get(key)
        if isinstance(request, messages.Release):
            self.slots.pop(key, None)
            return messages.Released(header)
        if slot is not None:
            kept = slot.kept.get(type(request))
            begun = isinstance(request, messages.Configure) and (slot.committed, slot.exchange) != (header.step, -1)
            if kept is not None and not isinstance(kept, messages.Failure) and kept.header == header and not begun:
                return kept
        if isinstance(request, messages.Configure):
            if slot is not None and header.epoch < slot.epoch:
                raise stale(header, slot)
            return self.configure(key, request)
        if slot is None:
            raise refused("not_configured", f"session {header.session!r} has no part here: send Configure first")
        if header.epoch != slot.epoch:
            raise stale(header, slot)
        follows = header.step == slot.committed + 1 and slot.exchange >= 0
        if follows and isinstance(request, messages.Advance | messages.Commit | messages.Snapshot):
            commit(slot)
        if isinstance(request, messages.Advance):
            if header.step != slot.committed or header.exchange <= slot.exchange:
                raise stale(header, slot)
            return advance(slot, request)
        if isinstance(request, messages.Correct):
            if header.step != slot.committed or not 0 <= slot.exchange < header.exchange:
                raise stale(header, slot)
            return correct(slot, request)
        if isinstance(request, messages.Observe):
            return fields(slot, header)
        if isinstance(request, messages.Restore):
            slot.block.take(request.state)
            slot.committed, slot.exchange, slot.tentative, slot.kept = header.step, -1, None, {}
            return messages.Restored(header)
        if header.step != slot.committed:
            raise stale(header, slot)
        slot.exchange, slot.tentative = -1, None  # a step that failed elsewhere
        if isinstance(request, messages.Commit):
            return messages.Committed(header, fields(slot, header) if request.fields else None)
        return messages.SnapshotTaken(header, slot.block.to_bytes())

    def configure(self, key: tuple[str, str], request: messages.Configure) -> messages.Configured:
        """Build the part anew."""
        if request.model not in MODELS:
            raise refused("invalid", f"no model is called {request.model!r} here: ask for one of {', '.join(MODELS)}")
        block = LinearBlock(request)
        self.slots.pop(key, None)
        while len(self.slots) >= _MOST:
            self.slots.pop(next(iter(self.slots)))
        self.slots[key] = Slot(block, request.header.epoch, request.header.step)
        kinetic, strain, gravity = block.energies(block.x, block.v)
        can = messages.Capabilities(True, True, False, 1, True, False, 0.0)
        n_nodes, n_cells = len(block.rest), len(request.cells)
        return messages.Configured(request.header, n_nodes, n_cells, 1, strain, kinetic, gravity, capabilities=can)


def advance(slot: Slot, request: messages.Advance) -> messages.Advanced:
    """Take the step tentatively."""
    check(slot, request.seam_force)
    if not (np.isfinite(request.dt) and request.dt > 0.0):
        raise ValueError(f"the time step is {request.dt} s: send one that is positive")
    if len(request.seam_target) or len(request.seam_force_start):
        raise ValueError("this participant takes constant forces alone: send no anchor and no force at the start")
    slot.tentative = slot.block.step(request.dt, request.seam_force)
    slot.exchange, slot.asked = request.header.exchange, request
    return told(slot, request.header, request.seam_force, request.compliance, request.fields)


def correct(slot: Slot, request: messages.Correct) -> messages.Advanced:
    """Move the tentative step on by the compliance that was told."""
    assert slot.asked is not None and slot.tentative is not None
    check(slot, request.push)
    check(slot, request.force)
    if slot.block.told_dt != slot.asked.dt:
        raise ValueError("the compliance of steps of this length was not told: ask for it first")
    way = slot.block.answer(request.push)
    x, v = slot.tentative
    slot.tentative, slot.exchange = (x + way, v + way / slot.asked.dt), request.header.exchange
    return told(slot, request.header, request.force, False, request.fields)


def check(slot: Slot, force: Floats) -> None:
    """Raises ValueError for what is no force on the coupling nodes."""
    n = len(slot.block.coupling)
    if force.shape != (n, 3) or not np.isfinite(force).all():
        raise ValueError(f"a force of shape {force.shape}: this part's coupling nodes need ({n}, 3) finite numbers")


def told(slot: Slot, header: Header, force: Floats, compliance: bool, with_fields: bool) -> messages.Advanced:
    """What the tentative step says of itself."""
    assert slot.asked is not None and slot.tentative is not None
    block, (x, v) = slot.block, slot.tentative
    kinetic, strain, gravity = block.energies(x, v)
    momentum = block.mass[:, None] * v
    return messages.Advanced(
        header=header,
        status=Status.CONVERGED,
        seam_x=x[block.coupling],
        compliance=block.compliance(slot.asked.dt) if compliance else np.zeros((0, 0)),
        wrench=np.zeros((len(slot.asked.tools.position), 6)),  # it touches no tool
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
        correctable=block.told_dt == slot.asked.dt,
        fields=fields(slot, header) if with_fields else None,
    )


def fields(slot: Slot, header: Header) -> messages.Fields:
    """Of the tentative state, where there is one."""
    block, points = slot.block, slot.block.mesh.points
    x, v = slot.tentative or (block.x, block.v)
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


def commit(slot: Slot) -> None:
    """What is tentative stays."""
    assert slot.tentative is not None
    slot.block.x, slot.block.v = slot.tentative
    slot.committed, slot.exchange, slot.tentative = slot.committed + 1, -1, None


def stale(header: Header, slot: Slot) -> Refused:
    here = f"epoch {slot.epoch}, step {slot.committed}, exchanges above {slot.exchange}"
    return refused("stale", f"epoch {header.epoch}, step {header.step}, exchange {header.exchange}: send {here}")


def refused(kind: str, message: str) -> Refused:
    return Refused(messages.Failure(FailureKind(kind), message))
