"""A participant's process by `serve`, on a real bus: found, asked, killed, told to stop, hung."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import small_part
from asked import free_endpoint
from small_part import PUSH, TOO_MUCH, Springs, advance, configure, header, upset

from softseam.conform.command import PASSED, run_checks
from softseam.conform.examined_part import Service
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.inbox import Inbox, LiveChange
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.errors import BusTimeout, NoReply, NoRouter, ProtocolError, Refused
from softseam_protocol.messages.participant import (
    Advanced,
    Configure,
    Configured,
    Fields,
    Observe,
    Restore,
    Restored,
    Snapshot,
    SnapshotTaken,
)
from softseam_protocol.participant.part_solver import PartSolver
from softseam_protocol.participant.requests import Participant
from softseam_protocol.participant.serve import serving
from softseam_protocol.participant.state import State
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import encode

KEY = Keys().participant("springs")
LIVE = Keys().every_live("participant", "springs")
ORDER = (
    "repeat redo commit discard restore release stale_step old_epoch step_ahead unknown_session wrong_shape "
    "not_a_number other_schema unknown_model foreign_state garbage"
).split()
"""checks of the kit that are no matter of mechanics"""


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    where = free_endpoint()
    with Router(where):
        yield where


@pytest.fixture
def bus(endpoint: str) -> Iterator[Bus]:
    with Bus(endpoint, role=SERVICE) as opened:
        yield opened


@contextmanager
def process(endpoint: str, how: str = "not at all") -> Iterator[subprocess.Popen[str]]:
    """One that serves the small part, and has said so."""
    command = [sys.executable, small_part.__file__, endpoint, how]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=Path("/")) as one:
        try:
            assert one.stdout is not None
            assert one.stdout.readline() == f"springs answers at {endpoint}; Ctrl-C stops it\n"
            yield one
        finally:
            one.kill()


def wait(changes: Inbox[LiveChange], alive: bool) -> None:
    """Until a participant came, or went."""
    change = changes.get(10.0)
    assert change is not None and change.alive == alive, change


def ask(bus: Bus, request: object, kind: type, seconds: float = 10.0) -> object:
    return bus.call(KEY, request, kind, seconds)


def step_of(bus: Bus, step: int, exchange: int = 0) -> Advanced:
    reply = ask(bus, advance(header(step, exchange), (1 + step) * PUSH), Advanced)
    assert isinstance(reply, Advanced)
    return replace(reply, seconds=0.0)


def test_a_participant_of_two_methods_passes_what_the_kit_asks_of_any(endpoint: str, bus: Bus) -> None:
    with serving(Springs, "springs", connect=endpoint):
        rows = run_checks(Service(bus, KEY, "springs"), tuple(ORDER))
    assert {row.outcome for row in rows} == {PASSED}, [row for row in rows if row.outcome != PASSED]


def test_a_solver_of_messages_is_served_in_the_same_order(endpoint: str, bus: Bus) -> None:
    """Who offers the protocol `Solver` needs no `Part`."""

    def build(request: Configure) -> tuple[PartSolver, Configured]:
        solver = PartSolver(Springs(request), request)
        return solver, solver.configured(request.header)

    names = ("repeat", "redo", "commit", "discard", "restore", "release", "stale_step", "old_epoch", "step_ahead")
    with serving(Participant(build), "springs", connect=endpoint):
        assert bus.wait_answers(Keys().every_live("participant", "springs"), Keys().echo("springs"))
        rows = run_checks(Service(bus, KEY, "springs"), names)
    assert {row.outcome for row in rows} == {PASSED}, rows


def test_it_is_found_while_it_serves_and_not_before_or_after(endpoint: str, bus: Bus) -> None:
    changes = bus.watch_live(LIVE)
    with serving(Springs, "springs", connect=endpoint):
        wait(changes, True)
        assert bus.request(Keys().echo("springs"), b"here?", 5.0) == b"here?"
    wait(changes, False)
    with pytest.raises(NoReply):
        bus.request(KEY, encode(Observe(header())), 2.0)


@pytest.mark.kernels
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_stops_when_it_is_told_to(endpoint: str, bus: Bus, number: signal.Signals) -> None:
    changes = bus.watch_live(LIVE)
    with process(endpoint) as one:
        wait(changes, True)
        ask(bus, configure(), Configured)
        one.send_signal(number)
        assert one.wait(10.0) == 0
        assert one.stderr is not None and one.stderr.read() == ""
    wait(changes, False)


@pytest.mark.kernels
def test_the_answer_at_hand_is_given_before_it_stops(endpoint: str, bus: Bus) -> None:
    changes = bus.watch_live(LIVE)
    with process(endpoint, "dawdles") as one:
        wait(changes, True)
        ask(bus, configure(), Configured)
        pending = bus.start(KEY, encode(advance(header(), TOO_MUCH)), 10.0)
        assert one.stdout is not None and one.stdout.readline() == "at work\n"
        one.send_signal(signal.SIGTERM)
        assert pending.collect()
        assert one.wait(10.0) == 0


@pytest.mark.kernels
@pytest.mark.slow
def test_a_solver_that_hangs_does_not_keep_it_from_stopping(endpoint: str, bus: Bus) -> None:
    changes = bus.watch_live(LIVE)
    with process(endpoint, "hangs") as one:
        wait(changes, True)
        ask(bus, configure(), Configured)
        pending = bus.start(KEY, encode(advance(header(), TOO_MUCH)), 30.0)
        assert one.stdout is not None and one.stdout.readline() == "at work\n"
        one.send_signal(signal.SIGTERM)
        assert one.wait(20.0) == 0
        with pytest.raises((NoReply, BusTimeout)):
            pending.collect()


@pytest.mark.kernels
def test_a_solver_that_leaves_takes_its_process_along(endpoint: str, bus: Bus) -> None:
    """It does not stay there deaf."""
    changes = bus.watch_live(LIVE)
    with process(endpoint, "leaves") as one:
        wait(changes, True)
        ask(bus, configure(), Configured)
        with pytest.raises((NoReply, BusTimeout)):
            ask(bus, advance(header(), TOO_MUCH), Advanced)
        assert one.wait(10.0) == 1
        assert one.stderr is not None and "the licence has expired" in one.stderr.read()
    wait(changes, False)


@pytest.mark.kernels
def test_one_that_is_killed_while_it_answers_is_replaced_and_goes_on_to_the_bit(endpoint: str, bus: Bus) -> None:
    changes = bus.watch_live(LIVE)
    with process(endpoint) as whole:
        wait(changes, True)
        ask(bus, configure(), Configured)
        wanted = [step_of(bus, step) for step in range(4)]
        whole.kill()
    wait(changes, False)
    with process(endpoint, "dies") as one:
        wait(changes, True)
        ask(bus, configure(), Configured)
        came = [step_of(bus, step) for step in range(2)]
        saved = ask(bus, Snapshot(header(2)), SnapshotTaken)
        assert isinstance(saved, SnapshotTaken)
        began = time.monotonic()
        with pytest.raises((NoReply, BusTimeout)):
            ask(bus, advance(header(2), TOO_MUCH), Advanced)
        assert time.monotonic() - began < 9.0, "its death is noticed before the wait is over"
        assert one.wait(10.0) == -signal.SIGKILL
    wait(changes, False)
    with process(endpoint):
        wait(changes, True)
        with pytest.raises(Refused, match="not_configured"):
            ask(bus, advance(header(2)), Advanced)
        ask(bus, configure(), Configured)
        ask(bus, Restore(header(2), saved.state), Restored)
        came += [step_of(bus, step) for step in range(2, 4)]
    assert [encode(reply) for reply in came] == [encode(reply) for reply in wanted]


def test_a_flood_of_garbage_and_forged_requests_changes_nothing(endpoint: str, bus: Bus) -> None:
    rng = np.random.default_rng(1)
    with serving(Springs, "springs", connect=endpoint):
        ask(bus, configure(), Configured)
        step_of(bus, 0)
        before = ask(bus, Observe(header()), Fields)
        old = encode(advance(header(0, 5, epoch=0)))  # so that what of it can be read is refused, too
        for n in range(200):
            bad = bytearray(old) if n % 2 else bytearray(rng.bytes(int(rng.integers(0, 400))))
            if n % 2:
                bad = bad[: int(rng.integers(1, len(bad)))]  # truncated
            try:
                bus.request(KEY, bytes(bad), 5.0)
            except ProtocolError:
                continue
            raise AssertionError(f"answered: {bytes(bad)!r}")
        after = ask(bus, Observe(header()), Fields)
    assert encode(replace(before, seconds=0.0)) == encode(replace(after, seconds=0.0))  # type: ignore[type-var]


def test_a_request_whose_asker_is_gone_counts_and_its_repeat_gets_the_answer(endpoint: str, bus: Bus) -> None:
    """The reply is lost: whoever asks again, from elsewhere, gets what the first would have had."""
    came, go = threading.Event(), threading.Event()
    calls = []

    def happens(state: State) -> State:
        calls.append(1)
        came.set()
        assert go.wait(10.0)
        return state

    with serving(upset(happens), "springs", connect=endpoint):
        ask(bus, configure(), Configured)
        with Bus(endpoint, role=SERVICE) as first:
            first.start(KEY, encode(advance(header(), TOO_MUCH)), 10.0)
            assert came.wait(10.0)
        go.set()
        again = ask(bus, advance(header(), TOO_MUCH), Advanced)
        twice = ask(bus, advance(header(), TOO_MUCH), Advanced)
    assert encode(again) == encode(twice) and len(calls) == 1


@pytest.mark.kernels
def test_without_a_router_it_says_what_to_start() -> None:
    where = free_endpoint()
    with pytest.raises(NoRouter, match="start one with"), serving(Springs, "springs", connect=where, wait=0.2):
        pass
    with pytest.raises(ValueError, match="is not a name"), serving(Springs, "a name", connect=where):
        pass
    command = [sys.executable, "-m", "softseam.examples.participant", "--connect", "nowhere"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False, env=os.environ)
    assert done.returncode == 1 and "is no endpoint" in done.stderr and "Traceback" not in done.stderr
