"""Bad requests are answered by a typed Failure that names the remedy, and change nothing."""

import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from softseam.conform.examined_part import EDGE, ExaminedPart, Service, expect, near, some_force
from softseam.conform.repeats import bits
from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.messages.participant import Restore
from softseam_protocol.wire.codec import encode

_MARK = 0.0012345678
"""a number that stands once in a request [N]"""


def _refused(make: Callable[[ExaminedPart], bytes], *kinds: str) -> Callable[[Service], None]:
    """A check: what `make` makes is refused with one of these kinds, and the tentative step stays what it was."""

    def check(service: Service) -> None:
        part = ExaminedPart(service)
        part.advance(0, 0, some_force())
        before = part.advance(1, 0, some_force())
        if service.refusal(make(part), kinds):  # a step that is `refused` takes the place of the one before
            again = part.advance(1, 0, some_force())
            expect(bits(again) == bits(before), "the same bytes for the request before the refusal", "others")
        after = part.advance(1, 5, some_force())
        near("the same step as before the refusal", after.coupling.x, before.coupling.x, 1e-7 * EDGE)

    return check


def _nan(part: ExaminedPart) -> bytes:
    force = np.zeros((len(part.coupling), 3))
    force[0, 0] = _MARK
    return encode(part.request(1, 1, force)).replace(struct.pack("<d", _MARK), struct.pack("<d", np.nan))


def _of(part: ExaminedPart, **header: Any) -> bytes:
    request = part.request(1, 1)
    return encode(replace(request, header=replace(request.header, **header)))


stale = _refused(lambda part: encode(part.request(0, 3)), "stale")
epoch = _refused(lambda part: _of(part, epoch=part.configure.header.epoch - 1), "stale")
ahead = _refused(lambda part: encode(part.request(7)), "stale")
unknown = _refused(lambda part: _of(part, session="nobody"), "not_configured")
shape = _refused(lambda part: encode(replace(part.request(1, 1), coupling_force=np.zeros((4, 3)))), "invalid")
nan = _refused(_nan, "invalid")
schema = _refused(lambda part: _of(part, schema=SCHEMA_VERSION + 1), "schema")
model = _refused(
    lambda part: encode(
        replace(part.configure, model="no_such_model", header=replace(part.configure.header, session="other"))
    ),
    "invalid",
)
state = _refused(lambda part: encode(Restore(part.header(1), b"these bytes are no state")), "invalid")
garbage = _refused(lambda part: b"these bytes are no message", "invalid")
