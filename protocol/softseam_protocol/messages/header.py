"""What every message begins with."""

from __future__ import annotations

from dataclasses import dataclass

from softseam_protocol.messages.arrays import Count, NameText

SCHEMA_VERSION = 2


@dataclass(frozen=True, slots=True)
class Header:
    """Names a message: a request with the same header and kind is the same request."""

    schema: Count
    session: NameText
    participant: NameText
    epoch: Count
    step: Count
    exchange: Count
    time: float
    """simulation time at the start of the step [s]"""
