"""Bad requests are answered by a typed Failure that names the remedy, and change nothing."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from softseam.conform.repeats import bits
from softseam.conform.seat import EDGE, Seat, Service, expect, near, some_force
from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.messages.participant import Restore
from softseam_protocol.wire.codec import encode

_MARK = 0.0012345678
"""a number that stands once in a request [N]"""


def _refused(make: Callable[[Seat], bytes], *kinds: str) -> Callable[[Service], None]:
    """A check: what `make` makes is refused with one of these kinds, and the tentative step stays what it was."""

    def check(service: Service) -> None:
        seat = Seat(service)
        seat.advance(0, 0, some_force())
        before = seat.advance(1, 0, some_force())
        if service.refusal(make(seat), kinds):  # a step that is `refused` takes the place of the one before
            again = seat.advance(1, 0, some_force())
            expect(bits(again) == bits(before), "the same bytes for the request before the refusal", "others")
        after = seat.advance(1, 5, some_force())
        near("the same step as before the refusal", after.seam_x, before.seam_x, 1e-7 * EDGE)

    return check


def _nan(seat: Seat) -> bytes:
    force = np.zeros((len(seat.coupling), 3))
    force[0, 0] = _MARK
    return encode(seat.request(1, 1, force)).replace(struct.pack("<d", _MARK), struct.pack("<d", np.nan))


def _of(seat: Seat, **header: Any) -> bytes:
    request = seat.request(1, 1)
    return encode(replace(request, header=replace(request.header, **header)))


stale = _refused(lambda seat: encode(seat.request(0, 3)), "stale")
epoch = _refused(lambda seat: _of(seat, epoch=seat.configure.header.epoch - 1), "stale")
ahead = _refused(lambda seat: encode(seat.request(7)), "stale")
unknown = _refused(lambda seat: _of(seat, session="nobody"), "not_configured")
shape = _refused(lambda seat: encode(replace(seat.request(1, 1), seam_force=np.zeros((4, 3)))), "invalid")
nan = _refused(_nan, "invalid")
schema = _refused(lambda seat: _of(seat, schema=SCHEMA_VERSION + 1), "schema")
model = _refused(
    lambda seat: encode(
        replace(seat.configure, model="no_such_model", header=replace(seat.configure.header, session="other"))
    ),
    "invalid",
)
state = _refused(lambda seat: encode(Restore(seat.header(1), b"these bytes are no state")), "invalid")
garbage = _refused(lambda seat: b"these bytes are no message", "invalid")
