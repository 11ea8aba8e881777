"""All participants in this process: direct calls, no encoding, no bus."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor, wait

from softseam_protocol.messages.participant import Advanced, Bundle, Failure, Reply, Request
from softseam_services.orchestrator.transport import ParticipantFailed
from softseam_services.server import ParticipantServer, Setup

_WORTH_A_THREAD = 3e-4
"""[s]; a hand-over to another thread costs about a fifth of that, and kernels leave the interpreter to the other"""


class EmbeddedTransport:
    """Serves every participant by one `ParticipantServer` a participant, in threads where they work long enough."""

    def __init__(self) -> None:
        self._servers: dict[str, ParticipantServer] = {}
        self._setup: tuple[Bundle, Setup] | None = None
        self._pool: ThreadPoolExecutor | None = None
        self._seconds: dict[str, float] = {}

    def adopt(self, bundle: Bundle, setup: Setup) -> None:
        """Let the participants share the orchestrator's body instead of building their own."""
        self._setup = (bundle, setup)
        for server in self._servers.values():
            server.adopt(bundle, setup)

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        names = list(requests)
        replies: dict[str, Reply] = {}
        if len(names) == 2 and min(self._seconds.get(name, 0.0) for name in names) > _WORTH_A_THREAD:
            if self._pool is None:
                self._pool = ThreadPoolExecutor(1, thread_name_prefix="participant")
            other = self._pool.submit(self._server(names[1]).handle, requests[names[1]])
            try:
                replies[names[0]] = self._server(names[0]).handle(requests[names[0]])
                replies[names[1]] = other.result()
            finally:  # an interrupt leaves nobody at work: what follows would meet it
                wait([other])
        else:
            for name in names:
                replies[name] = self._server(name).handle(requests[name])
        for name, reply in replies.items():
            if isinstance(reply, Failure):
                raise ParticipantFailed(name, reply)
            if isinstance(reply, Advanced):
                self._seconds[name] = reply.seconds
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
            if self._setup is not None:
                server.adopt(*self._setup)
        return server
