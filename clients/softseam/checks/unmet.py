"""What the services reported as not done."""

from collections.abc import Iterator

from softseam.to_check import Ended
from softseam_protocol.messages.outcomes import EventKind


def look(run: Ended) -> Iterator[str]:
    kinds = EventKind.NOT_DONE, EventKind.FORCE, EventKind.OVERLAP
    return (event.message for event in run.events if event.kind in kinds)
