"""The bus: a thin layer over zenoh, and the only place that imports it.

Every wait is bounded and every failure has a type. Requests are answered by one thread a server, whatever the number
of keys; zenoh's own threads only put things into queues. Nothing here knows a scene or a solver.

An empty reply is a hard error, because it does not show whether the request ran: whoever asks repeats the same request,
and servers answer a repeated request with the same bytes.
"""

import logging
import os
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import zenoh

from softseam_protocol.bus.asking import Asker, Pending, understood
from softseam_protocol.bus.declared import Declared
from softseam_protocol.bus.doors import check_endpoints, settings_of, unanswered
from softseam_protocol.bus.inbox import Inbox, LiveChange, Received
from softseam_protocol.bus.keys import CLIENT, SERVICE, Key, make_keys, read_key
from softseam_protocol.bus.liveness import LiveTokens
from softseam_protocol.bus.peer_links import PeerLinks
from softseam_protocol.bus.server import Handler, Server
from softseam_protocol.bus.session import LEASE, BusSession, as_endpoints, direct, first_sentence
from softseam_protocol.errors import BusError, NoKey, PortBusy, ProtocolError
from softseam_protocol.topics import DEFAULT_ENDPOINT, EVERY_NODE, node
from softseam_protocol.wire.codec import encode

INTRODUCTION = 1.0
"""time in which a publisher learns of those who have subscribed before [s]"""

TIMEOUT = 60.0
"""longest wait for a participant's answer [s]; a process that dies or freezes is noticed long before"""
FIRST = 10.0
"""longest wait for a service before its first request [s]"""
_RETRY = 0.25

_AGAIN = LEASE / 10
"""for how long a peer looks who lives while zenoh says nobody [s], as it may while others come or go"""

_PROTOBUF = zenoh.Encoding.APPLICATION_PROTOBUF

_log = logging.getLogger(__name__)

_OF_PEERS = frozenset(("mode", "listen/endpoints", "connect/exit_on_failure"))
"""settings that clients do not have"""


class Router(BusSession):
    """The router that every other process connects to."""

    def __init__(
        self,
        listen: str | Iterable[str] = DEFAULT_ENDPOINT,
        connect: str | Iterable[str] = (),
        extra: Mapping[str, Any] | None = None,
    ) -> None:
        """Listen at endpoints; `connect` names other hosts' routers, `extra` zenoh settings.

        Makes keys where there are none. Raises BadKey, PortBusy and BusError.
        """
        self.endpoints, others = as_endpoints(listen), as_endpoints(connect)
        check_endpoints(others, self.endpoints)
        make_keys()
        doors = settings_of(read_key(SERVICE), others, self.endpoints, router=True)
        try:
            super().__init__("router", self.endpoints, others, {**doors, **(extra or {})})
        except zenoh.ZError as error:
            where = ", ".join(self.endpoints)
            if "in use" in str(error):
                raise PortBusy(
                    f"cannot listen at {where}: the port is in use. Is a router running there already? "
                    "Connect to it, stop it, or listen at another port"
                ) from None
            raise BusError(f"cannot listen at {where}: {first_sentence(error)}") from None


class Bus(BusSession):
    """A client's session on the bus."""

    def __init__(
        self,
        endpoints: str | Iterable[str] = DEFAULT_ENDPOINT,
        connect_timeout: float = 5.0,
        extra: Mapping[str, Any] | None = None,
        role: str = CLIENT,
    ) -> None:
        """Connect to a router, trying for `connect_timeout` [s]. Raises NoRouter, NoKey, BadKey and KeyRefused.

        extra  further zenoh settings; in its mode "peer" others reach this one without the router
        role   whose key is shown: who answers, publishes, or asks a participant is a service
        """
        self.endpoints, self.role = as_endpoints(endpoints), role
        listen = (extra or {}).get("listen/endpoints", ())
        check_endpoints(self.endpoints, listen)
        self._publishers: dict[tuple[str, bool], Declared] = {}
        self._publishing = threading.Lock()
        self._open: list[Server | Inbox[Any]] = []
        self._askers: weakref.WeakSet[Asker] = weakref.WeakSet()
        self._tokens: list[Declared] = []
        self._watched: dict[str, LiveTokens] = {}
        self._watching = threading.Lock()
        retry = {
            "connect/timeout_ms": max(1, int(connect_timeout * 1000)),
            "connect/retry": {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5},
        }
        self.key = _awaited_key(role, self.endpoints, connect_timeout)
        doors = settings_of(self.key, self.endpoints, listen)
        try:
            super().__init__("client", (), self.endpoints, {**retry, **doors, **(extra or {})})
        except zenoh.ZError as error:
            why = unanswered(self.endpoints, connect_timeout, self.key) if "Unable to connect" in str(error) else None
            if why is not None:
                raise why from None
            raise BusError(f"cannot connect to {', '.join(self.endpoints)}: {first_sentence(error)}") from None
        self._aside = {key: value for key, value in (extra or {}).items() if key not in _OF_PEERS}
        self._links = PeerLinks(self._mend, LEASE)
        self._doubted = False
        """whether the router did not know this session when it was last asked"""
        self._peer = (extra or {}).get("mode") == "peer"
        if self._peer:
            self._show_to_peers()

    # ---- requests ------------------------------------------------------------------------------------------

    def start(self, key: str, payload: bytes, timeout: float, handler: Any = None) -> Pending:
        """Send a request without waiting; `collect` gets the reply, unless zenoh gives it to a `handler`."""

        def get(session: Any) -> Any:
            return session.get(
                key,
                handler,
                payload=payload,
                encoding=_PROTOBUF,
                timeout=timeout,
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )

        return Pending(key, timeout, self._on_session(get))

    def request(self, key: str, payload: bytes, timeout: float) -> bytes:
        """Send a request and wait at most `timeout` [s] for its reply; errors as `Pending.collect`."""
        return self.start(key, payload, timeout).collect()

    def asker(self, key: str, timeout: float) -> Asker:
        """For requests to a key that is asked often; they wait at most `timeout` [s]."""
        querier = self._declare(
            lambda session: session.declare_querier(
                key,
                timeout=timeout,
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
        )

        def ask(payload: bytes, handler: Any) -> Pending:
            if os.getpid() == self._pid:
                announced = querier.current
                try:
                    return Pending(key, timeout, announced.get(handler, payload=payload), announced)
                except zenoh.ZError:
                    pass  # the bus is closed, or is being joined anew
            return self.start(key, payload, timeout, handler)

        asker = Asker(key, querier, ask)
        self._askers.add(asker)
        return asker

    def call(self, key: str, message: Any, allowed: Any, timeout: float) -> Any:
        """Send a message and decode its reply, which must be of the class(es) `allowed`.

        A Failure is raised as Refused unless `allowed` names it.
        """
        return understood(key, self.request(key, encode(message), timeout), allowed)

    def wait_answers(self, tokens: str, echo: str, timeout: float = FIRST) -> bool:
        """Whether a service sends back within `timeout` [s] what its `echo` is sent; `tokens`: keys that show it."""
        end = time.monotonic() + timeout
        changes = self.watch_live(tokens)
        try:
            while (left := end - time.monotonic()) > 0.0:
                try:
                    if self.request(echo, b"alive?", min(left, 1.0)) == b"alive?":
                        return True
                except ProtocolError:
                    pass
                changes.get(min(left, _RETRY))  # until it comes or goes, or a while has passed
        finally:
            changes.close()
        return False

    def serve(self, handlers: Mapping[str, Handler], name: str = "server") -> Server:
        """Answer requests to keys; call `start` or `run` on the result. Handlers run one at a time."""
        server = Server(name)
        for key, handler in handlers.items():
            server.own(self._declare_queryable(key, server.entrance(handler)))
        self._open.append(server)
        return server

    def _declare_queryable(self, key: str, entrance: Callable[[Any], None]) -> Declared:
        return self._declare(lambda session: session.declare_queryable(key, direct(entrance)))

    # ---- publishing ----------------------------------------------------------------------------------------

    def publish(self, key: str, payload: bytes, droppable: bool = False) -> None:
        """Publish; `droppable` gives way under congestion instead of waiting."""
        publisher = self._publisher(key, droppable)
        self._on_session(lambda _: publisher.current.put(payload))

    def listened(self, key: str) -> bool:
        """Whether anybody subscribes to what is published, droppable, under `key`; not sure at first, so it is True."""
        publisher = self._publisher(key, True)
        matching = self._on_session(lambda _: publisher.current.matching_status.matching)
        return bool(matching) or time.monotonic() - publisher.since < INTRODUCTION

    def _publisher(self, key: str, droppable: bool) -> Declared:
        control = zenoh.CongestionControl.DROP if droppable else zenoh.CongestionControl.BLOCK
        with self._publishing:
            known = self._publishers.get((key, droppable))
            if known is None:
                known = self._publishers[key, droppable] = self._declare(
                    lambda session: session.declare_publisher(key, encoding=_PROTOBUF, congestion_control=control)
                )
        return known

    def forget(self, prefix: str) -> None:
        """Undeclare the publishers of keys that begin with `prefix`: a session has ended."""
        with self._publishing:
            for known in [known for known in self._publishers if known[0].startswith(prefix)]:
                self._publishers.pop(known).undeclare()

    def subscribe(self, key: str, latest: bool = False, limit_bytes: int = 256 * 2**20) -> Inbox[Received]:
        """Collect what is published; `latest` keeps only the newest. What does not fit is dropped and counted."""
        inbox: Inbox[Received] = Inbox(latest, limit_bytes)

        def receive(sample: zenoh.Sample) -> None:
            payload = sample.payload.to_bytes()
            inbox.put(Received(str(sample.key_expr), payload), len(payload))

        inbox.own(self._declare(lambda session: session.declare_subscriber(key, direct(receive))))
        self._open.append(inbox)
        return inbox

    # ---- liveliness ----------------------------------------------------------------------------------------

    def declare_live(self, key: str) -> None:
        """Show that this process lives, until the bus is closed."""
        self._tokens.append(self._declare(lambda session: session.liveliness().declare_token(key)))

    def live(self, key: str, timeout: float = 2.0) -> set[str]:
        """Keys of the tokens that exist now."""
        found, end = self._live(key, timeout), time.monotonic() + _AGAIN
        while self._peer and not found and time.monotonic() < end:
            time.sleep(_AGAIN / 20)
            found = self._live(key, timeout)
        return found

    def _live(self, key: str, timeout: float) -> set[str]:
        replies = self._on_session(lambda session: session.liveliness().get(key, timeout=timeout))
        found = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        # zenoh's answer may lack tokens that a watch of the same session is receiving at the time
        asked = zenoh.KeyExpr(key)
        with self._watching:
            watched = list(self._watched.values())
        return found.union(*([k for k in tokens.known() if asked.intersects(zenoh.KeyExpr(k))] for tokens in watched))

    def live_at_router(self, key: str) -> set[str]:
        """Keys of the tokens that the router knows, asked on a link made for it. Raises BusError without a router."""
        with Bus(self.endpoints, LEASE, self._aside, self.role) as client:
            return client.live(key)

    def watch_live(self, key: str) -> Inbox[LiveChange]:
        """Collect comings and goings of tokens, starting with those that exist."""
        return self._tokens_of(key).inbox()

    def _tokens_of(self, key: str) -> LiveTokens:
        with self._watching:
            return self._watched.get(key) or self._watch(key)

    def _watch(self, key: str) -> LiveTokens:
        """Watch for as long as the bus is open (lock held)."""
        tokens = LiveTokens()

        def receive(sample: zenoh.Sample) -> None:
            tokens.heard(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        def watch(session: Any) -> Any:
            tokens.forget()
            return session.liveliness().declare_subscriber(key, direct(receive), history=True)

        self._tokens.append(self._declare(watch))
        self._watched[key] = tokens
        return tokens

    # ---- links with peers ----------------------------------------------------------------------------------

    def _show_to_peers(self) -> None:
        """Show this session's name to all, and look after its links, that with the router too."""

        def heard(event: Any) -> None:
            changed = self._links.broke if event.kind == zenoh.SampleKind.DELETE else self._links.made
            changed(str(event.transport.zid))

        def token(session: Any) -> Any:
            return session.liveliness().declare_token(node(str(session.info.zid())))

        self._tokens.append(self._declare(token))
        self._tokens.append(
            self._declare(lambda session: session.info.declare_transport_events_listener(direct(heard)))
        )

    def _mend(self, lost: frozenset[str]) -> bool:
        """Join anew if peers whose links broke live but are not heard, or if the router twice does not know this one;
        False if that cannot be known yet.
        """
        silent, session = {node(peer) for peer in lost}, self._zenoh
        doubted, self._doubted = self._doubted, False
        try:
            own = set() if session is None else {node(str(session.info.zid()))}
            with Bus(self.endpoints, LEASE, self._aside, self.role) as client:
                everyone = client.live(EVERY_NODE)
                silent &= everyone
                if silent and self._zenoh is not None:
                    silent -= self.live(EVERY_NODE)
                    silent &= client.live(EVERY_NODE)  # without who left meanwhile
        except (BusError, zenoh.ZError):
            return False  # the router is gone, or this bus is being closed
        unknown = not own <= everyone
        if unknown and not doubted and not silent:
            self._doubted = True  # its link with the router may be on its way
            return False
        if silent or unknown:
            _log.warning(
                "the link to %s is lost: joining the bus anew", "a process that lives" if silent else "the router"
            )
        return self.rejoin() if silent or unknown or session is None else True

    def close(self) -> None:
        """Stop the servers and leave the bus; a second call does nothing."""
        self._links.close()
        opened, self._open = self._open, []
        if os.getpid() == self._pid:
            for one in [*opened, *self._askers, *self._watched.values()]:
                one.close()
        super().close()


def _awaited_key(role: str, endpoints: Sequence[str], timeout: float) -> Key:
    """A role's key, which a router that is about to start may be about to make. Raises NoRouter, NoKey and BadKey."""
    end = time.monotonic() + timeout
    while True:
        try:
            return read_key(role)
        except NoKey:
            why = unanswered(endpoints, timeout, None)
            if why is None:  # a router makes keys before it listens
                raise
            if time.monotonic() > end:
                raise why from None
            time.sleep(_RETRY)
