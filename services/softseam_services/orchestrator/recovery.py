"""Brings a lost participant back to where it was, bit for bit.

Every request since the participant's last checkpoint is kept. When the participant is lost and has come back (a
supervisor restarts it), it is configured and restored, the kept requests are sent again in their order, and the pending
one is repeated. Participants drop their caches at a checkpoint, so what follows does not depend on whether one
was restored.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from softseam_protocol.messages import participant as messages
from softseam_protocol.messages.outcomes import FailureKind
from softseam_services.orchestrator.transport import ParticipantFailed, ParticipantLost, Transport

_STEPS = (messages.Advance, messages.Correct, messages.Commit)


@dataclass
class _Log:
    configure: messages.Configure
    checkpoint: messages.SnapshotTaken | None = None
    since: list[messages.Request] = field(default_factory=list)


class RecoveringTransport:
    """A transport that survives the death of participants.

    patience      longest wait for a participant to come back [s]
    attempts      recoveries of one request before giving up
    on_event      called with (kind, message)
    """

    def __init__(
        self,
        inner: Transport,
        *,
        patience: float = 60.0,
        attempts: int = 3,
        on_event: Callable[[str, str], None] = lambda kind, message: None,
    ) -> None:
        self._inner = inner
        self._patience = patience
        self._attempts = attempts
        self.on_event = on_event
        self._logs: dict[str, _Log] = {}
        self._astray: set[str] = set()  # who may have begun a step that is not to follow

    def exchange(self, requests: Mapping[str, messages.Request]) -> dict[str, messages.Reply]:
        """See `Transport`."""
        try:
            return self._exchange(requests)
        except BaseException:
            self._astray |= {name for name, request in requests.items() if _goes_on(request)}
            raise

    def _exchange(self, requests: Mapping[str, messages.Request]) -> dict[str, messages.Reply]:
        for attempt in range(self._attempts + 1):
            try:
                self._bring_back(requests)
                replies = self._inner.exchange(requests)
            except (ParticipantLost, ParticipantFailed) as error:
                if not _recoverable(error) or attempt == self._attempts:
                    raise
                self._recover(error)
            else:
                for name, request in requests.items():
                    self._remember(name, request, replies[name])
                return replies
        raise AssertionError("unreachable")

    def wait_alive(self, participant: str, timeout: float) -> bool:
        return self._inner.wait_alive(participant, timeout)

    def close(self) -> None:
        self._inner.close()

    def _bring_back(self, requests: Mapping[str, messages.Request]) -> None:
        """Build those anew that have gone astray, unless what they are asked for does so."""
        for name in sorted(self._astray & requests.keys()):
            if not isinstance(requests[name], messages.Configure | messages.Release):
                self._catch_up(name)
            self._astray.discard(name)

    def _remember(self, name: str, request: messages.Request, reply: messages.Reply) -> None:
        if isinstance(request, _STEPS):
            self._logs[name].since.append(request)  # its arrays are never written again: see `Transport`
        elif isinstance(request, messages.Configure):
            self._logs[name] = _Log(request)
        elif isinstance(request, messages.Release):
            self._logs.pop(name, None)
        elif isinstance(request, messages.Snapshot):
            assert isinstance(reply, messages.SnapshotTaken)
            log = self._logs[name]
            log.checkpoint = reply
            log.since.clear()
        elif isinstance(request, messages.Restore):
            log = self._logs[name]
            log.checkpoint = messages.SnapshotTaken(request.header, request.state)
            log.since.clear()

    def _recover(self, error: ParticipantLost | ParticipantFailed) -> None:
        """Wait for the participant and catch it up; it may be lost again meanwhile."""
        name = error.participant
        self.on_event("participant_lost", f"{error}; waiting for it to come back")
        for attempt in range(self._attempts + 1):
            if not self._inner.wait_alive(name, self._patience):
                raise ParticipantLost(
                    name, f"it did not come back within {self._patience:g} s: is its service running and supervised?"
                ) from error
            try:
                repeated = self._catch_up(name)
            except (ParticipantLost, ParticipantFailed) as again:
                if not _recoverable(again) or attempt == self._attempts:
                    raise
            else:
                self.on_event(
                    "participant_restored", f"participant {name!r} is back; {repeated} requests were repeated"
                )
                return

    def _catch_up(self, name: str) -> int:
        """Send everything again since the last checkpoint; the number of requests after it."""
        log = self._logs.get(name)
        if log is None:
            return 0
        self._inner.exchange({name: log.configure})
        if log.checkpoint is not None:
            header = log.checkpoint.header
            self._inner.exchange({name: messages.Restore(header, log.checkpoint.state)})
        for request in log.since:
            self._inner.exchange({name: request})
        return len(log.since)


def _goes_on(request: messages.Request) -> bool:
    """Whether who serves it commits the step at hand, so that a Commit does not take that back any more."""
    return isinstance(request, messages.Correct) and request.then is not None


def _recoverable(error: ParticipantLost | ParticipantFailed) -> bool:
    return isinstance(error, ParticipantLost) or error.failure.kind == FailureKind.NOT_CONFIGURED
