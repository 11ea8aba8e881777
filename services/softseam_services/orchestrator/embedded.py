"""All participants in this process: direct calls, no encoding, no bus."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor, wait

from softseam_protocol.facts import cores
from softseam_protocol.messages.participant import Advanced, Bundle, Failure, Reply, Request
from softseam_protocol.participant.solver import Solver
from softseam_services.orchestrator.transport import ParticipantFailed, worked
from softseam_services.server import ParticipantServer, Setup

_BUNDLES = 4
"""of which participants that are built later share the bodies: the last ones"""
WORTH_A_THREAD = 6e-4
"""[s]; a hand-over to another thread costs about a tenth of that, and kernels leave the interpreter to the other"""


class EmbeddedTransport:
    """Serves every participant by one `ParticipantServer` a participant, in threads where they work long enough."""

    def __init__(self) -> None:
        self._servers: dict[str, ParticipantServer] = {}
        self._setups: list[tuple[Bundle, Mapping[str, Setup]]] = []
        self._pool: ThreadPoolExecutor | None = None
        self._seconds: dict[tuple[str, type[Request]], float] = {}  # what the last request of a kind took [s]

    def adopt(self, bundle: Bundle, setups: Mapping[str, Setup]) -> None:
        """Let the participants share the orchestrator's bodies instead of building their own."""
        self._setups = [*self._setups[1 - _BUNDLES :], (bundle, setups)]
        for server in self._servers.values():
            server.adopt(bundle, setups)

    def solver(self, session: str, part: str) -> Solver:
        """What computes a part. Raises KeyError where no such part is configured."""
        return self._server(part).solver(session, part)

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        names = list(requests)
        replies: dict[str, Reply] = {}
        long = [name for name in names if self._seconds.get((name, type(requests[name])), 0.0) > WORTH_A_THREAD]
        if len(long) > 1:
            if self._pool is None:
                self._pool = ThreadPoolExecutor(max(1, cores() - 1), thread_name_prefix="participant")
            others = {name: self._pool.submit(self._server(name).handle, requests[name]) for name in long[1:]}
            try:
                for name in names:
                    if name not in others:
                        replies[name] = self._server(name).handle(requests[name])
                replies.update({name: other.result() for name, other in others.items()})
            finally:  # an interrupt leaves nobody at work: what follows would meet it
                wait(others.values())
        else:
            for name in names:
                replies[name] = self._server(name).handle(requests[name])
        for name, reply in replies.items():
            if isinstance(reply, Failure):
                raise ParticipantFailed(name, reply)
            if isinstance(reply, Advanced):
                self._seconds[name, type(requests[name])] = worked(reply)
        return replies

    def wait_alive(self, participant: str, timeout: float) -> bool:
        return True

    def close(self) -> None:
        self._servers.clear()
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _server(self, name: str) -> ParticipantServer:
        server = self._servers.get(name)
        if server is None:
            server = self._servers[name] = ParticipantServer()
            for bundle, setups in self._setups:
                server.adopt(bundle, setups)
        return server
