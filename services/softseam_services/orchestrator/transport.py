"""How the orchestrator reaches its participants: the one seam between `embedded` and `zenoh`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from softseam_protocol.messages.participant import Advanced, Failure, Reply, Request, Worked


class ParticipantLost(RuntimeError):
    """A participant did not answer: dead, frozen or unreachable. Its last request may or may not have run."""

    def __init__(self, participant: str, why: str) -> None:
        super().__init__(f"participant {participant!r} is lost: {why}")
        self.participant = participant
        self.why = why


class ParticipantFailed(RuntimeError):
    """A participant answered that it cannot serve the request; it changed nothing."""

    def __init__(self, participant: str, failure: Failure) -> None:
        super().__init__(f"participant {participant!r} refuses ({failure.kind}): {failure.message}")
        self.participant = participant
        self.failure = failure


def worked(reply: Worked) -> float:
    """Wall time that a participant spent on an answer [s], the step that it began with it among that."""
    then = reply.then if isinstance(reply, Advanced) else None
    return reply.seconds + (0.0 if then is None else then.seconds)


class Transport(Protocol):
    """Carries requests to participants and brings the replies."""

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        """Send all requests at once, wait (bounded) for all replies.

        Requests and replies are kept for repeats on both ends: nobody writes to their arrays any more.
        Raises ParticipantLost for the first participant that does not answer and ParticipantFailed for the first that
        answers with a Failure.
        """
        ...

    def wait_alive(self, participant: str, timeout: float) -> bool:
        """Whether the participant answers again within `timeout` [s]."""
        ...

    def close(self) -> None: ...
