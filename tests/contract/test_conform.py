"""Every check of the kit fails where a participant has the fault that it is about, and none where it has none.

The example participant, with its fault, answers on a real bus, in a thread.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import StringIO
from typing import Any

import pytest
from faulty_participants import FAULTS, Example, Faulty, altered, changed
from rich.console import Console

from softseam.conform.command import FAILED, NOT_CLAIMED, NOT_RUN, PASSED, Row, conform, run_checks, wait_answers
from softseam.conform.examined_part import Service
from softseam.conform.table import CHECKS
from softseam.errors import BadInput
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.messages.participant import Advance, Advanced, Configured
from softseam_protocol.topics import Keys

KEY = Keys().participant("block")


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(where):
        yield where


@pytest.fixture
def bus(endpoint: str) -> Iterator[Bus]:
    with Bus(endpoint, role=SERVICE) as opened:
        yield opened


def rows(bus: Bus, endpoint: str, participant: Example, *names: str) -> list[Row]:
    """What becomes of these checks, or of all, where this participant answers."""
    with Bus(endpoint, role=SERVICE) as other:
        server = other.serve({KEY: participant, Keys().echo("block"): bytes}).start()
        try:
            wait_answers(bus, Keys(), "block")
            return run_checks(Service(bus, KEY, "block"), names)
        finally:
            server.close()


def test_every_check_has_its_fault() -> None:
    assert list(dict.fromkeys(name for name, _, _ in FAULTS)) == list(CHECKS)


def test_the_example_conforms(bus: Bus, endpoint: str) -> None:
    assert {row.outcome for row in rows(bus, endpoint, Example())} == {PASSED}


@pytest.mark.parametrize(("name", "expected", "faulty"), FAULTS)
def test_a_check_fails_where_its_fault_is(
    bus: Bus, endpoint: str, name: str, expected: str, faulty: Callable[[], Example]
) -> None:
    """By what the fault is about, not by another sentence of the check."""
    (row,) = rows(bus, endpoint, faulty(), name)
    assert row.outcome == FAILED and expected in row.expected, row


def test_a_participant_that_answers_nothing_right_is_told_so(bus: Bus, endpoint: str) -> None:
    """One row, not an error of the kit, where it is not even configured."""

    class Mute(Example):
        def __call__(self, payload: bytes) -> bytes:
            return b"no message"

    (row,) = rows(bus, endpoint, Mute())
    assert (row.name, row.outcome) == ("configure", FAILED) and row.came


def test_a_participant_that_hangs_is_not_waited_for_again(bus: Bus, endpoint: str) -> None:
    awake = threading.Event()

    def asked(_: Faulty, request: Any) -> Any:
        if isinstance(request, Advance):
            awake.wait(30.0)
        return request

    with Bus(endpoint, role=SERVICE) as other:
        server = other.serve({KEY: Faulty(asked), Keys().echo("block"): bytes}).start()
        try:
            wait_answers(bus, Keys(), "block")
            found = run_checks(Service(bus, KEY, "block", wait=0.5), ("repeat", "redo"))
        finally:
            awake.set()
            server.close()
    assert [row.outcome for row in found] == [FAILED, NOT_RUN] and "in answer to Advance" in found[0].expected


def test_no_session_is_left_behind(bus: Bus, endpoint: str) -> None:
    """Whether a check passes or fails."""
    faulty = changed(Advanced, momentum=lambda p: 0.99 * p)()
    assert {row.outcome for row in rows(bus, endpoint, faulty, "momentum", "energy")} == {PASSED, FAILED}
    assert not faulty.slots


def test_what_is_not_claimed_is_not_checked(bus: Bus, endpoint: str) -> None:
    def less(reply: Configured) -> Configured:
        assert reply.capabilities is not None
        return replace(reply, capabilities=replace(reply.capabilities, corrects=False))

    found = rows(bus, endpoint, Faulty(said=altered(Configured, less)))
    assert [row.name for row in found if row.outcome == NOT_CLAIMED] == ["correct", "correct_then"]
    assert FAILED not in {row.outcome for row in found}


def test_a_service_that_is_not_there_is_named(endpoint: str) -> None:
    with pytest.raises(BadInput, match="no participant is called 'nobody'; none lives in deployment 'local'"):
        conform(endpoint, "nobody", None, None, (), Console(file=StringIO()))
    with pytest.raises(BadInput, match="table of conformance checks: no row 'momentun'; did you mean 'momentum'"):
        conform(endpoint, "nobody", None, None, ("momentun",), Console(file=StringIO()))
