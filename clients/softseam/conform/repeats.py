"""Requests that come again, are taken back, committed, saved and forgotten."""

from dataclasses import replace

import numpy as np

from softseam.conform.examined_part import ExaminedPart, Service, expect, near, some_force
from softseam_protocol.messages.participant import Advanced, Configured, Restore, Restored, Snapshot, SnapshotTaken
from softseam_protocol.wire.codec import encode


def bits(reply: Advanced) -> bytes:
    """What must be the same: all but the clock and the name of the session."""
    header = replace(reply.header, session="", exchange=0)
    return encode(replace(reply, header=header, seconds=0.0))


def repeat(service: Service) -> None:
    """The same request again gets the same bytes, but for `seconds`, and does nothing."""
    part, force = ExaminedPart(service), some_force()
    again = service.ask(part.configure, Configured)
    expect(replace(again, seconds=0.0) == replace(part.configured, seconds=0.0), "Configured as before", again)
    first = part.advance(0, 0, force)
    expect(bits(part.advance(0, 0, force)) == bits(first), "the same bytes for the same Advance", "others")
    second = part.advance(1, 0, force)
    expect(bits(part.advance(1, 0, force)) == bits(second), "the same bytes for the same Advance", "others")


def redo(service: Service) -> None:
    """A higher exchange starts again from the committed state: another force, then the first, give the first answer."""
    part, force = ExaminedPart(service), some_force()
    first, other = part.advance(0, 0, force), part.advance(0, 1, -2.0 * force)
    moved = float(np.abs(other.coupling.x - first.coupling.x).max())
    expect(moved > 0.0, "another answer to another force", "the same")
    near("the first answer to the first force", part.advance(0, 2, force).coupling.x, first.coupling.x, 1e-6 * moved)


def commit(service: Service) -> None:
    """An Advance for the next step commits the one before, as Commit does."""
    ends = []
    for said in (False, True):
        part = ExaminedPart(service)
        first = part.advance(0, 0, some_force())
        if said:
            part.commit(1)
        second = part.advance(1)
        ends.append(bits(second))
        size = float(np.abs(first.momentum).max())
        near("a second step with the momentum of the first", second.momentum, first.momentum, 1e-3 * size)
    expect(ends[0] == ends[1], "the same step after a Commit and without one", "another")


def discard(service: Service) -> None:
    """A Commit that names the tentative step itself discards it."""
    part = ExaminedPart(service)
    first = part.advance(0, 1, some_force())
    part.commit(0)
    near("positions as at the start", part.observe(0).x, part.configure.mesh.x_rest, 1e-12)  # type: ignore[union-attr]
    near("the same step again", part.advance(0, 2, some_force()).coupling.x, first.coupling.x, 1e-9)


def restore(service: Service) -> None:
    """A snapshot, put into a new session, goes on as the session that it was taken of: the same bits."""
    part = ExaminedPart(service)
    able = part.configured.capabilities
    for step in range(3):
        part.advance(step, 0, some_force(seed=step), compliance=step == 0 and able is not None and able.compliance)
    state = service.ask(Snapshot(part.header(3)), SnapshotTaken).state
    other = ExaminedPart(service)
    service.ask(Restore(other.header(3), state), Restored)
    for step in range(3, 6):
        ours, theirs = (each.advance(step, 0, some_force(seed=step)) for each in (part, other))
        expect(bits(ours) == bits(theirs), "the same bits from the restored session", f"others in step {step}")


def release(service: Service) -> None:
    """After Release the session has no part; releasing it again is no error."""
    part = ExaminedPart(service)
    part.advance(0)
    part.release()
    service.refusal(encode(part.request(1)), ("not_configured",))
    part.release()
