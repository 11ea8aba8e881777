"""Liveliness tokens: what a watch tells and what `live` answers agree, however closely they follow each other."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.bus.liveness import LiveTokens
from softseam_protocol.topics import Keys

KEYS = Keys("tokens")
TOKEN = KEYS.live("participant", "fem", "i1")


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(where):
        yield where


def test_live_knows_what_a_watch_is_being_told(endpoint: str) -> None:
    """zenoh's own answer lacks the token in most of these rounds, for it is on its way to the watch."""
    with Bus(endpoint, role=SERVICE) as holder:
        holder.declare_live(TOKEN)
        for _ in range(50):
            with Bus(endpoint, role=SERVICE) as bus:
                watch = bus.watch_live(KEYS.every_live())
                assert bus.live(KEYS.every_live("participant")) == {TOKEN}
                came = watch.get(5.0)
                assert came is not None and came.alive and came.key == TOKEN
                assert bus.live(KEYS.every_live()) == bus.live(KEYS.every_live("participant", "fem")) == {TOKEN}
                assert bus.live(KEYS.every_live("recorder")) == set()


def test_a_second_watch_begins_with_what_exists_and_hears_of_the_end(endpoint: str) -> None:
    """Also once another watch of the same key was closed; nothing is told twice."""
    with Bus(endpoint, role=SERVICE) as bus:
        first = bus.watch_live(KEYS.every_live())
        with Bus(endpoint, role=SERVICE) as holder:
            holder.declare_live(TOKEN)
            came = first.get(5.0)
            assert came is not None and came.alive
            first.close()
            second, other = bus.watch_live(KEYS.every_live()), bus.watch_live(KEYS.every_live("participant"))
            for watch in (second, other):
                came = watch.get(5.0)
                assert came is not None and came.alive and came.key == TOKEN
        for watch in (second, other):
            went = watch.get(5.0)
            assert went is not None and not went.alive and went.key == TOKEN
            assert len(watch) == 0
        assert len(first) == 0
        assert bus.live(KEYS.every_live()) == set()


def test_only_changes_are_passed_on() -> None:
    tokens = LiveTokens()
    inbox = tokens.inbox()
    for alive in (False, True, True, False, False, True):
        tokens.heard("a", alive)
    heard = [inbox.get(0.0) for _ in range(3)]
    assert [change is not None and change.alive for change in heard] == [True, False, True]
    assert len(inbox) == 0
    assert tokens.known() == {"a"}
    tokens.close()
    assert inbox.closed
