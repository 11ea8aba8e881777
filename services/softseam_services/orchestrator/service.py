"""Serves clients: opens sessions, steps them, publishes what happens.

Requests (key `Keys.orchestrator`), all with `header.session` naming the client's session (the client makes it up) and
`header.exchange` counting its requests: 1, 2, 3, ... A request with the number of the last one is the same request and
gets the same reply, so a client may repeat what it got no answer to; a lower number is refused as stale.

    Open    scene and files -> Observation at rest; `record` has the bus's recorder write the session to a file
    Reset   -> Observation at rest; ends the recording at hand and begins another
    Step    `count` steps -> Observation after the last one, with `fields` only then. With `program` the scene's own
            motion is followed and ends the request early where it is over; a StepReport is published for every step
            meanwhile (`Keys.session`), so one request may cover many steps and progress is still seen. With `each`
            -> Observations of the steps that fit into a tenth of a second, one at least; where a step fails after
            others were taken, these are the answer, and the next Step is told of the failure
    Save    -> Saved: state of the whole simulation
    Load    -> Observation: continues from Saved, bit for bit
    Estimate  -> Estimated: how far the answer may be off as the body stands
    Close   -> Closed; interrupts a Step under way; closing a session that is not there is no error
    End     -> Recorded: the recorder's answer, what became of the session's recording

A request's header names the session's secret; from here on the session is `shown` of it.

Failures: 'schema' (another version), 'invalid' (a scene or value that is refused; nothing changed), 'not_configured'
(no such session: not opened, closed, or not kept when its orchestrator was lost, see `kept_session`), 'stale', 'busy'
(too many sessions), 'internal' (a participant is lost for good, or a step failed; the text says what to do).
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace

from softseam_protocol.bus.client import Bus
from softseam_protocol.errors import BusError, ProtocolError, Refused
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Failure
from softseam_protocol.messages.recording import FINISH, End
from softseam_protocol.messages.session import (
    ClientReply,
    ClientRequest,
    Close,
    Closed,
    Estimate,
    Estimated,
    Open,
    Reset,
    Save,
    Saved,
    Step,
)
from softseam_protocol.scene.file import SceneError
from softseam_protocol.topics import Keys, shown
from softseam_protocol.wire.codec import decode, encode
from softseam_services.bus_options import BusOptions, new_instance
from softseam_services.lifeline import Lifeline
from softseam_services.orchestrator.client_liveness import ClientLiveness
from softseam_services.orchestrator.client_session import Answer, ClientSession, Stopped
from softseam_services.orchestrator.kept_session import Asked, Damaged, KeptSession, kept_sessions
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.recorder_feed import answer_of_recorder
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost
from softseam_services.progress import tell_progress
from softseam_services.warm_up import settle, warm_orchestrator

PATIENCE = 5.0
"""time in which the token of a predecessor that was killed, or is being stopped, has gone [s]"""
_NEWS = 0.25
"""between looks at who has gone [s]"""


class AlreadyServed(BusError):
    """Another orchestrator serves the deployment."""


def wait_to_be_only(bus: Bus, keys: Keys, stop: threading.Event) -> None:
    """Until no other orchestrator is there, or this one is to stop: of two, each would answer some of a client's
    requests, and upset the other's. Raises AlreadyServed."""
    every, end = keys.every_live("orchestrator"), time.monotonic() + PATIENCE
    while there := _there(bus, every):
        if time.monotonic() > end:
            found = ", ".join(sorted(live.instance for live in map(keys.read_live, there) if live is not None))
            raise AlreadyServed(
                f"an orchestrator serves the deployment {keys.deployment!r} at {', '.join(bus.endpoints)} already "
                f"(instance {found}): use that one, stop it, or give this one another --deployment"
            )
        if stop.wait(_NEWS):
            return


def _there(bus: Bus, every: str) -> set[str]:
    """Tokens that the router knows, or that this process was told of where the router is away just now."""
    try:
        return bus.live_at_router(every)
    except BusError:
        return bus.live(every)


ROLE = SERVICE = "orchestrator"
MOST_SESSIONS = 16
IDLE_LIMIT = 1800.0
"""a session that nobody used for so long may be closed for another one [s]"""
LEFT = 60.0
"""a session whose client has been gone for so long is closed [s]"""
LEFT_IN_NEED = 5.0
"""the same where another session needs its place [s]"""
_FAREWELL = 8.0
"""longest wait for all sessions to be closed when the service is stopped [s]"""
_THREADS = 8
_TURN = 110.0
"""longest wait of a request for the one before it in the same session [s]"""
_HEARD = 0.3
"""time in which it is heard that a client was killed just now [s]"""
_STOPPED = "the orchestrator was stopped"
"""for which alone a session is not over"""
_GONE, _SILENT = "its client has gone", "its client showed no sign of life, and its place was needed"
_log = logging.getLogger(__name__)


class ClientHandler:
    """Bytes in, bytes out; called from several threads, one request at a time for each session."""

    def __init__(self, bus: Bus, keys: Keys, life: Lifeline, routes: Mapping[str, str] | None = None) -> None:
        self._bus, self._keys, self._life, self._routes = bus, keys, life, routes
        self._clients: dict[str, ClientSession] = {}
        self._lock = threading.Lock()
        self._liveness = ClientLiveness(bus, keys)
        self._kept = kept_sessions(keys)
        self._introduced = time.monotonic() + PATIENCE
        """by when this process knows who else is there"""

    def __call__(self, payload: bytes) -> bytes:
        """The reply. Raises Refused, and what `decode` raises, which the bus answers with a Failure."""
        request: ClientRequest | End = decode(payload, ClientRequest | End)
        if not request.header.session:
            raise Refused(Failure(FailureKind.INVALID, "a request must name its session"))
        header = replace(request.header, session=shown(request.header.session))
        request = replace(request, header=header)
        if isinstance(request, End):
            return self._recorded(request)
        if isinstance(request, Close):
            return self._close(request)
        client = self._client(header, isinstance(request, Open))
        if not client.lock.acquire(timeout=_TURN):
            raise Refused(Failure(FailureKind.BUSY, "the request before is still at work: wait for its answer"))
        try:
            return self._answer(client, request)
        finally:
            client.used = time.monotonic()
            client.lock.release()
            if not client.opened:
                self._forget(header.session, client)

    def last(self) -> tuple[str, int]:
        """Session and step that were served last."""
        clients = list(self._clients.items())
        if not clients:
            return "", 0
        session, client = max(clients, key=lambda item: item[1].used)
        return session, client.steps

    def watch_clients(self) -> None:
        """Close sessions whose clients have been gone for long, until the service stops."""
        while not self._life.stop.is_set():
            self._liveness.look(self._clients.keys(), _NEWS)
            for session in self._liveness.gone(LEFT):
                self._liveness.forget(session)
                if (client := self._clients.get(session)) is not None:
                    self._end_aside(session, client, _GONE)

    def close(self) -> None:
        """End all sessions at once: recordings are finished, participants released, if they can be soon."""
        end = time.monotonic() + _FAREWELL
        clients = list(self._clients.items())
        for thread in [self._end_aside(session, client, _STOPPED) for session, client in clients]:
            thread.join(max(0.0, end - time.monotonic()))
        if self._clients:
            _log.warning("%d sessions are left as they are: their services do not answer", len(self._clients))

    def _client(self, header: Header, opening: bool) -> ClientSession:
        kept = KeptSession(self._kept, header.session)
        while True:
            with self._lock:
                client = self._clients.get(header.session)
                if client is not None:
                    return client
                if not opening and not kept.there:
                    raise Refused(
                        Failure(
                            FailureKind.NOT_CONFIGURED,
                            f"no session {header.session!r} is open here: it was closed, its client was not heard of "
                            f"for {LEFT:g} s, or nothing was kept of it when its orchestrator died; open it again and "
                            "load your last saved state",
                        )
                    )
                if len(self._clients) < MOST_SESSIONS:
                    stopping = self._life.stop.is_set
                    client = ClientSession(self._bus, self._keys, header.session, stopping, kept, self._routes)
                    self._clients[header.session] = client
                    return client
            if not self._make_room():
                raise Refused(Failure(FailureKind.BUSY, f"{MOST_SESSIONS} sessions are open: close one"))

    def _make_room(self) -> bool:
        """Close a session whose client shows no sign of life, or has gone, or the one that was idle longest, if it was
        for long enough."""
        clients = dict(self._clients)
        for session in self._liveness.silent(clients):
            if self._end_in_turn(session, clients[session], _SILENT, LEFT_IN_NEED):
                return True
        now = time.monotonic()
        heard, end = now + _HEARD, now + LEFT_IN_NEED + 2.0 * _NEWS
        while len(clients := dict(self._clients)) >= MOST_SESSIONS:
            for session in self._liveness.gone(LEFT_IN_NEED) & clients.keys():
                if self._end_in_turn(session, clients[session], _GONE, LEFT_IN_NEED):
                    return True
            session, client = min(clients.items(), key=lambda item: item[1].used)
            if time.monotonic() - client.used >= IDLE_LIMIT:
                return self._end_in_turn(session, client, "idle for too long", 0.0)
            if self._life.stop.wait(0.05):
                return False
            if time.monotonic() > (heard if self._liveness.gone().isdisjoint(clients) else end):
                return False
        return True

    def _answer(self, client: ClientSession, request: Asked) -> bytes:
        """Answer a request, or repeat the answer (client held)."""
        if not client.opened and client.kept.there:
            with _refusing(begins=False):
                client.take_up()
        kept, number = client.answer, request.header.exchange
        if kept is not None:
            if number == kept.number and type(request) is kept.kind:
                return kept.payload
            if number <= kept.number:
                raise Refused(Failure(FailureKind.STALE, f"request {number} after request {kept.number}"))
        if isinstance(request, Open) == client.opened:
            if client.opened:
                raise Refused(Failure(FailureKind.INVALID, f"the session {request.header.session!r} is open already"))
            raise Refused(
                Failure(FailureKind.NOT_CONFIGURED, f"the session {request.header.session!r} could not be opened")
            )
        client.used = time.monotonic()
        try:
            payload = encode(self._run(client, request))
        except Refused:
            if isinstance(request, Step):
                client.note(request, b"")
            raise
        client.note(request, payload)
        client.answer = Answer(type(request), number, payload)
        return payload

    def _run(self, client: ClientSession, request: Asked) -> ClientReply:
        """Do what is asked; every expected trouble becomes a Failure that says what to do."""
        with _refusing(isinstance(request, Open) or (isinstance(request, Reset) and request.bundle is not None)):
            if isinstance(request, Open):
                return client.open(request)
            if isinstance(request, Reset):
                return client.reset(request.seed, request.bundle)
            if isinstance(request, Step):
                return client.step(request)
            if isinstance(request, Save):
                return Saved(request.header, client.save())
            if isinstance(request, Estimate):
                return Estimated(request.header, client.estimate())
            return client.load(request.state)

    def _close(self, request: Close) -> bytes:
        session = request.header.session
        client = self._clients.get(session)
        if client is None and KeptSession(self._kept, session).there:
            client = self._client(request.header, opening=False)
            with client.lock, suppress(Refused), _refusing(begins=False):
                if not client.opened:
                    client.take_up()  # so that its recording has what was on its way, and an end
        if client is not None and not self._end_in_turn(session, client, "closed", _TURN):
            raise Refused(Failure(FailureKind.BUSY, "the request before is still at work: close again"))
        return encode(Closed(request.header))

    def _recorded(self, request: End) -> bytes:
        """What became of the session's recording, which the recorder ends if that was not done before."""
        try:
            return encode(answer_of_recorder(self._bus, self._keys, request, FINISH, self._introduced))
        except Refused as error:
            raise Refused(replace(error.failure, message=f"the recorder refused: {error.failure.message}")) from None
        except ProtocolError as error:
            raise Refused(Failure(FailureKind.INTERNAL, f"no recorder answered: {error}")) from None

    def _end_aside(self, session: str, client: ClientSession, reason: str) -> threading.Thread:
        """Close a session in a thread of its own: its services may be gone, too, and are waited for."""
        args = (session, client, reason, _TURN)
        thread = threading.Thread(target=self._end_in_turn, args=args, name="softseam end", daemon=True)
        thread.start()
        return thread

    def _end_in_turn(self, session: str, client: ClientSession, reason: str, turn: float) -> bool:
        """Close a session after the step at hand, waiting at most `turn` [s] for its end; False where that is over."""
        if turn > 0.0:
            client.cancelled = True
        if not client.lock.acquire(timeout=turn):
            return False
        try:
            self._end(session, client, reason)
        finally:
            client.lock.release()
        return True

    def _end(self, session: str, client: ClientSession, reason: str) -> None:
        """Close a session whatever its participants do (client held)."""
        try:
            client.close(reason)
        except (ParticipantLost, ParticipantFailed, ProtocolError) as error:
            _log.warning("closing session %s: %s", session, error)
        if reason == _STOPPED:
            client.kept.close()
        else:
            client.kept.discard()
        self._forget(session, client)

    def _forget(self, session: str, client: ClientSession) -> None:
        if self._clients.get(session) is client:
            del self._clients[session]
            self._liveness.forget(session)


@contextmanager
def _refusing(begins: bool) -> Iterator[None]:
    """Every expected trouble becomes a Failure that says what to do; begins: a scene is opened."""
    try:
        yield
    except Damaged as error:
        raise Refused(Failure(FailureKind.NOT_CONFIGURED, str(error))) from error
    except ParticipantFailed as error:
        invalid = error.failure.kind == FailureKind.INVALID and begins
        raise Refused(Failure(FailureKind.INVALID if invalid else FailureKind.INTERNAL, str(error))) from error
    except (ParticipantLost, StepFailed, Stopped) as error:
        raise Refused(Failure(FailureKind.INTERNAL, str(error))) from error
    except (SceneError, ValueError) as error:  # mesh, tool and archive errors are ValueErrors
        raise Refused(Failure(FailureKind.INVALID, str(error))) from error


def serve_orchestrator(options: BusOptions, life: Lifeline, routes: Mapping[str, str] | None = None) -> None:
    """Serve clients until the process is asked to stop. routes: see `BusTransport`, `services`."""
    life.state = "compiling"
    warm_orchestrator()
    settle()
    keys, instance = options.keys, new_instance()
    with options.open() as bus:
        wait_to_be_only(bus, keys, life.stop)
        handler = ClientHandler(bus, keys, life, routes)
        server = bus.serve({keys.orchestrator: handler}, name="softseam orchestrator")
        tell_progress(life, bus, keys, server, ROLE, SERVICE, instance, handler.last, supervise=False)
        bus.declare_live(keys.live(ROLE, SERVICE, instance))
        server.start(_THREADS)
        threading.Thread(target=handler.watch_clients, name="softseam clients", daemon=True).start()
        life.state = "ready"
        life.stop.wait()
        server.close()
        handler.close()
