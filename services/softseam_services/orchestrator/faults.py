"""Messages between orchestrator and participants that are repeated, lost, late, or sent to someone who has died."""

from collections.abc import Mapping

from softseam_protocol.messages.participant import Advance, Configure, Reply, Request
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.transport import ParticipantLost


class FaultyTransport(EmbeddedTransport):
    """Counts the requests for a step to every participant, and does harm to each `every`-th, at most once.

    fault  "repeated", "request lost", "reply lost", "an old one comes late", "killed", or "killed in recovery"
    after  so many of them that are left in peace
    """

    def __init__(self, fault: str, every: int, after: int = 10) -> None:
        super().__init__()
        self.harmed = 0
        """requests that fared badly"""
        self._fault, self._every, self._after = fault, every, after
        self._count, self._dying = 0, False
        self._last: dict[str, Request] = {}
        self._seen: set[tuple[int, int, int, str]] = set()

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        names = list(requests)
        name = names[self.harmed % len(names)]
        request = requests[name]
        if self._dying and isinstance(request, Configure):
            self._dying = False
            self._servers.pop(name, None)
            raise ParticipantLost(name, "it died while it was brought back")
        header = request.header
        if not isinstance(request, Advance) or (header.epoch, header.step, header.exchange, name) in self._seen:
            return super().exchange(requests)
        self._seen.update((header.epoch, header.step, header.exchange, one) for one in names)
        self._count += 1
        old = self._last.get(name)
        self._last.update(requests)
        if self._count < self._after or self._count % self._every:
            return super().exchange(requests)
        self.harmed += 1
        return self._harm(name, requests, old)

    def _harm(self, name: str, requests: Mapping[str, Request], old: Request | None) -> dict[str, Reply]:
        if self._fault == "request lost":
            raise ParticipantLost(name, "no answer in time")
        if self._fault.startswith("killed"):
            self._dying = self._fault == "killed in recovery"
            self._servers.pop(name, None)
            return super().exchange(requests)
        replies = super().exchange(requests)
        if self._fault == "reply lost":
            raise ParticipantLost(name, "no answer in time")
        if self._fault == "repeated":
            return super().exchange(requests)
        if old is not None:
            self._server(name).handle(old)
        return replies
