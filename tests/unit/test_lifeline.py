"""A service's heartbeat at its end."""

from __future__ import annotations

import os

from softseam_services.lifeline import Lifeline


def test_what_is_said_after_the_end_reaches_nobody() -> None:
    """The lifeline's pipe is closed then, and its number may be another file's."""
    with Lifeline(signals=False) as life:
        life.state = "ready"
    ends = [os.pipe() for _ in range(4)]  # they take the numbers that are free
    life.state = "late"
    life.request_stop()
    for read, write in ends:
        os.set_blocking(read, False)
        os.close(write)
        assert os.read(read, 16) == b""
        os.close(read)
    assert life.stop.is_set()
