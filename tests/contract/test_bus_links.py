"""Links between processes that reach each other directly: one that breaks while both live is made again."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh

from softseam_protocol.bus import client as buses
from softseam_protocol.bus.asking import Asker
from softseam_protocol.bus.client import INTRODUCTION, Bus, Router
from softseam_protocol.bus.inbox import Inbox, LiveChange, Received
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.bus.peer_links import PeerLinks
from softseam_protocol.bus.session import LEASE
from softseam_protocol.errors import NoReply
from softseam_protocol.topics import EVERY_NODE, Keys
from softseam_services.bus_options import BusOptions

KEYS = Keys("links")
PATIENCE = 10 * LEASE
ECHO, SAID = KEYS.echo("fem"), "softseam/links/said"


@pytest.fixture
def options() -> Iterator[BusOptions]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with Router(endpoint):
        yield BusOptions(connect=endpoint)


def until(true: Callable[[], object], within: float = PATIENCE) -> None:
    deadline = time.monotonic() + within
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)  # the pace of asking: what is waited for tells nobody that it came


def names(bus: Bus) -> set[str]:
    return {key.rsplit("/")[-1] for key in bus.live(EVERY_NODE)}


def answers(asker: Asker, said: bytes) -> bool:
    """Whether a server that its token shows is reached already."""
    try:
        return asker.start(said).collect() == said
    except NoReply:
        return False


def break_link(router: str) -> int:
    """Cut the connections inside this process but those with the router; how many ends there were."""
    cut = 0
    for fd in Path("/proc/self/fd").iterdir():
        try:
            found = socket.socket(fileno=os.dup(int(fd.name)))
        except OSError:
            continue  # not a socket
        with found:
            try:
                ports = {found.getsockname()[1], found.getpeername()[1]}
                if found.family == socket.AF_INET and int(router.rsplit(":")[-1]) not in ports:
                    found.shutdown(socket.SHUT_RDWR)
                    cut += 1
            except (OSError, IndexError):
                continue  # it listens, is no connection, or its other end was cut before and it is closed
    return cut


def change(inbox: Inbox[LiveChange]) -> tuple[str, bool]:
    found = inbox.get(PATIENCE)
    assert found is not None
    return found.key, found.alive


def test_a_link_that_breaks_while_both_live_is_made_again(options: BusOptions) -> None:
    """With everything that was declared on either side: servers, subscribers, publishers, askers, tokens, watches."""
    token = KEYS.live("participant", "fem", "i1")
    with options.open() as fem, options.open() as orchestrator:
        fem.serve({ECHO: lambda payload: payload}, "echo").start()
        fem.declare_live(token)
        heard: Inbox[Received] = fem.subscribe(SAID)
        watch = orchestrator.watch_live(KEYS.every_live("participant"))
        asker = orchestrator.asker(ECHO, 2.0)
        assert change(watch) == (token, True)
        until(lambda: answers(asker, b"before"))
        orchestrator.publish(SAID, b"before")
        got = heard.get(PATIENCE)
        assert got is not None and got.payload == b"before"

        assert break_link(options.connect) >= 1
        assert change(watch) == (token, False)
        assert change(watch) == (token, True)
        until(lambda: orchestrator.live(KEYS.every_live("participant")) == {token})
        until(lambda: answers(asker, b"after"))
        assert orchestrator.request(ECHO, b"plain", 2.0) == b"plain"
        orchestrator.publish(SAID, b"after")
        got = heard.get(PATIENCE)
        assert got is not None and got.payload == b"after"
        heard.close()
        orchestrator.publish(SAID, b"nobody listens")
        assert len(heard) == 0


def meet(buses: list[Bus]) -> None:
    """Wait until each of them hears of all."""
    everyone = {bus.name for bus in buses}
    until(lambda: all(everyone <= names(bus) for bus in buses))


def test_no_link_breaks_where_many_join_at_once(options: BusOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of two that the router introduces would connect to the other, and one of the two links is refused."""
    broken = list[str]()
    monkeypatch.setattr(PeerLinks, "broke", lambda links, peer: broken.append(peer))
    for _ in range(6):
        with ExitStack() as stack:
            meet([stack.enter_context(options.open()) for _ in range(5)])
            assert not broken
        broken.clear()  # they left


def test_a_peer_that_looks_who_lives_while_others_come_and_go_finds_them(options: BusOptions) -> None:
    """zenoh's own answer is then empty now and then."""
    token = KEYS.live("participant", "fem", "i1")
    with options.open() as fem, options.open() as orchestrator:
        fem.declare_live(token)
        until(lambda: orchestrator.live(token))
        for _ in range(100):
            with Bus(options.connect, role=SERVICE):
                assert [orchestrator.live(token) for _ in range(10)] == 10 * [{token}]


def test_who_leaves_for_good_is_let_go(options: BusOptions) -> None:
    """Nobody joins anew for it."""
    with options.open() as bus:
        with options.open() as other:
            until(lambda: len(names(bus) & names(other)) == 2)
        until(lambda: names(bus) == {bus.name})
        time.sleep(3 * LEASE)  # time in which it would
        assert names(bus) == {bus.name}


class Looks(PeerLinks):
    """Looks at links when the test says so, and not by itself."""

    last: Looks

    def __init__(self, mend: Callable[[frozenset[str]], bool], patience: float) -> None:
        super().__init__(mend, patience)
        self.mend = mend
        Looks.last = self

    def broke(self, peer: str) -> None:
        """Nothing is due."""


@pytest.fixture
def by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bus that is opened last looks at its links when `Looks.last.mend` is called."""
    monkeypatch.setattr(buses, "PeerLinks", Looks)


class Session:
    """One of zenoh's that cannot do some things."""

    def __init__(self, opened: Any, stuck: bool, refusals: list[bool]) -> None:
        self.opened, self.stuck, self.refusals = opened, stuck, refusals

    def __getattr__(self, name: str) -> Any:
        return getattr(self.opened, name)

    def declare_subscriber(self, *how: Any) -> Any:
        if self.refusals and self.refusals.pop(0):
            raise zenoh.ZError("the router is gone")
        return self.opened.declare_subscriber(*how)

    def close(self) -> None:
        self.opened.close()
        if self.stuck:
            raise zenoh.ZError("close operation timed out!")


def opening(monkeypatch: pytest.MonkeyPatch, stuck: bool = False, refusals: Sequence[bool] = ()) -> None:
    """Sessions are closed with an error, or refuse a subscriber, in turns, from here on."""
    opened, left = zenoh.open, list(refusals)
    monkeypatch.setattr(zenoh, "open", lambda config: Session(opened(config), stuck, left))


@pytest.mark.usefixtures("by_hand")
def test_who_could_not_join_anew_tries_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The router was gone, or went while all was being declared: as soon as it is there again nothing is missing."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        options = BusOptions(connect=f"tcp/127.0.0.1:{probe.getsockname()[1]}")
    gone = frozenset(("a_peer_that_has_gone_meanwhile",))
    router = Router(options.connect)
    opening(monkeypatch, refusals=[False, True])
    with options.open() as bus:
        looks, subscriber = Looks.last, bus.subscribe(ECHO)
        bus.publish(SAID, b"before", droppable=True)
        router.close()
        assert not bus.rejoin()
        assert not looks.mend(gone)
        with Router(options.connect), Bus(options.connect, role=SERVICE) as client:
            assert not bus.rejoin(), "it was refused"
            assert looks.mend(gone)
            heard = client.subscribe(SAID)
            time.sleep(INTRODUCTION)  # in which it is not sure who listens
            assert bus.listened(SAID)
            bus.publish(SAID, b"after", droppable=True)
            got = heard.get(PATIENCE)
            assert got is not None and got.payload == b"after"
            heard.close()
            until(lambda: not bus.listened(SAID))
        subscriber.close()


def test_clients_of_the_router_show_no_name(options: BusOptions) -> None:
    with Bus(options.connect, role=SERVICE) as client, options.open():
        until(lambda: len(names(client)) == 1)


@pytest.mark.usefixtures("by_hand")
def test_whom_the_router_has_forgotten_joins_anew_at_the_second_look(options: BusOptions) -> None:
    """As after a freeze, when zenoh's new link with the router is taken for the old one that the router let go."""
    live = KEYS.live("participant", "fem", "i1")
    with options.open() as bus:
        looks = Looks.last
        with Bus(options.connect, role=SERVICE) as client:
            bus.declare_live(live)
            until(lambda: live in client.live(live))
            for _ in range(2):
                until(lambda: bus.name in names(client))
                before = bus.name
                assert looks.mend(frozenset()) and bus.name == before, "it is known"
                bus._tokens[0].current.undeclare()  # its name
                until(lambda: not names(client))
                assert not looks.mend(frozenset()) and bus.name == before, "its link may be on its way"
                assert looks.mend(frozenset()) and bus.name != before
                until(lambda: live in client.live(live))


@pytest.mark.usefixtures("by_hand")
def test_who_cannot_leave_joins_anew_all_the_same(options: BusOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    """zenoh gives closing up where links are full."""
    opening(monkeypatch, stuck=True)
    with options.open() as bus, Bus(options.connect, role=SERVICE) as client:
        heard = bus.subscribe(SAID)
        before = bus.name
        assert bus.rejoin() and bus.name != before

        def is_heard() -> bool:
            client.publish(SAID, b"after")
            return len(heard) > 0

        until(is_heard)


def test_a_link_is_looked_at_a_while_after_it_broke_and_after_another_was_made() -> None:
    """Its peer may have been frozen when it was looked at first."""
    looked: Inbox[frozenset[str]] = Inbox()

    def mend(lost: frozenset[str]) -> bool:
        looked.put(lost, 0)
        return True

    links = PeerLinks(mend, 0.05)
    links.made("new")
    links.broke("old")
    assert looked.get(PATIENCE) == frozenset({"old"})
    links.made("new")
    links.made("old")
    assert looked.get(PATIENCE) == frozenset({"old"})
    assert looked.get(0.5) is None
    links.close()


def test_what_is_made_during_a_look_is_looked_at_and_so_is_what_could_not_be() -> None:
    looked: Inbox[frozenset[str]] = Inbox()
    times = iter(range(9))

    def mend(lost: frozenset[str]) -> bool:
        looked.put(lost, 0)
        match next(times):
            case 0:
                links.made("old")
            case 1:
                return False
            case 2:
                raise RuntimeError("not foreseen")
        return True

    links = PeerLinks(mend, 0.05)
    links.broke("old")
    assert [looked.get(PATIENCE) for _ in range(4)] == 4 * [frozenset({"old"})]
    assert looked.get(0.5) is None
    links.close()
