"""A recorder that shows that it lives is asked until it is reached; where none lives nothing is waited for."""

from __future__ import annotations

import threading
import time

import pytest
from asked import free_endpoint

from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.errors import NoReply
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import RecordingState
from softseam_protocol.messages.recording import End, Recorded
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import encode
from softseam_services.bus_options import BusOptions
from softseam_services.orchestrator.recorder_feed import PATIENCE, answer_of_recorder

KEYS = Keys("answers")
END = End(Header(SCHEMA_VERSION, "session", "", 0, 0, 1, 0.0), "closed")
DONE = Recorded(END.header, "run.mcap", 3, 0, 100, next(iter(RecordingState)))


def test_a_recorder_that_lives_is_asked_until_it_is_reached() -> None:
    endpoint = free_endpoint()
    with Router(endpoint), BusOptions(connect=endpoint).open() as recorder, BusOptions(connect=endpoint).open() as bus:
        changes = bus.watch_live(KEYS.every_live("recorder"))  # as a session's feed does
        recorder.declare_live(KEYS.live("recorder", "recorder", "i1"))
        change = changes.get(5.0)
        assert change is not None and change.alive
        late = threading.Timer(
            0.3, lambda: recorder.serve({KEYS.recorder: lambda payload: encode(DONE)}, "late").start()
        )
        late.start()
        assert answer_of_recorder(bus, KEYS, END, 5.0) == DONE
        late.join()


def test_who_has_just_joined_asks_a_recorder_that_it_has_not_heard_of() -> None:
    endpoint = free_endpoint()
    opened: list[Bus] = []

    def join() -> None:
        opened.append(BusOptions(connect=endpoint).open())
        opened[0].serve({KEYS.recorder: lambda payload: encode(DONE)}, "late").start()

    with Router(endpoint), BusOptions(connect=endpoint).open() as bus:
        late = threading.Timer(0.5, join)
        late.start()
        assert answer_of_recorder(bus, KEYS, END, 5.0, time.monotonic() + 20.0) == DONE
        late.join()
        opened[0].close()


def test_where_none_lives_nothing_is_waited_for() -> None:
    endpoint = free_endpoint()
    with Router(endpoint), BusOptions(connect=endpoint).open() as bus:
        began = time.monotonic()
        with pytest.raises(NoReply):
            answer_of_recorder(bus, KEYS, END, 5.0)
        assert time.monotonic() - began < PATIENCE
