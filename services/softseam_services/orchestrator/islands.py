"""One step of all islands: each is parts that interfaces tie to one another, and to no others."""

from __future__ import annotations

from collections.abc import Mapping

from softseam_coupling.loops.loop import Outcome
from softseam_protocol.messages.participant import Reply, Request, ToolMotion
from softseam_services.orchestrator.participants import Participants
from softseam_services.orchestrator.transport import Transport


def advance_all(
    islands: Mapping[str, Participants],
    transport: Transport,
    motion: ToolMotion,
    fields: bool,
    then: ToolMotion | None = None,
) -> dict[str, Outcome]:
    """Advance all by a step; where one fails, none has taken it. then: of a lone island, see `Participants.advance`.

    Those of one part, or of parts that nothing ties, are asked in one exchange; then the others, one after the other.
    Raises StepFailed, ParticipantLost and ParticipantFailed.
    """
    solutions: dict[str, Outcome] = {}
    free = {name: island for name, island in islands.items() if not island.tied}
    try:
        requests: dict[str, Request] = {}
        for island in free.values():
            requests.update(island.requests(motion, fields))
        replies: dict[str, Reply] = transport.exchange(requests) if requests else {}
        for name, island in free.items():
            solutions[name] = island.taken(replies)
        for name, island in islands.items():
            if island.tied:
                solutions[name] = island.advance(motion, fields, len(islands) == 1, then)
    except BaseException:
        for name in solutions:
            islands[name].withdraw()
        raise
    return {name: solutions[name] for name in islands}
