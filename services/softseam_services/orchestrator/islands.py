"""One step of all islands: each is parts that interfaces tie to one another, and to no others."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from softseam_coupling.loops.loop import Outcome
from softseam_protocol.messages.participant import Reply, Request, ToolMotion
from softseam_services.orchestrator.hosting import Hosting
from softseam_services.orchestrator.joined_bodies import JoinedBodies
from softseam_services.orchestrator.participants import Participants
from softseam_services.orchestrator.pile import Pile
from softseam_services.orchestrator.transport import Transport


def advance_all(
    islands: Mapping[str, Participants | Pile],
    joined: Sequence[JoinedBodies | Hosting],
    transport: Transport,
    motion: ToolMotion,
    fields: bool,
    then: ToolMotion | None = None,
    again: Callable[[Mapping[str, Outcome]], Collection[str]] | None = None,
) -> dict[str, Outcome]:
    """Advance all bodies by a step; where one fails, none has taken it. What each did, by body.

    islands  of one body, by its name, and piles by their parts'
    joined   of several, the pile among them by its part's name
    then     of a lone island, see `Participants.advance`
    again    of what islands came to that nothing ties, those that are to take the step anew; asked until there is none

    Those of one part, or of parts that nothing ties, are asked in one exchange; then the others, one after the other.
    Raises StepFailed, ParticipantLost and ParticipantFailed.
    """
    solutions: dict[str, Outcome] = {}
    taken: list[Participants | Pile | JoinedBodies | Hosting] = []
    free = {name: island for name, island in islands.items() if not island.tied}
    alone = len(islands) + len(joined) == 1
    try:
        now = free
        while now:
            requests: dict[str, Request] = {}
            for island in now.values():
                requests |= island.requests(motion, fields)
            replies: dict[str, Reply] = transport.exchange(requests)
            for name, island in now.items():
                solutions[name] = island.taken(replies)
                taken.append(island)
            now = {} if again is None else {name: free[name] for name in again(solutions)}
            for island in now.values():
                island.withdraw()
                taken.remove(island)
        for name, island in islands.items():
            if isinstance(island, Participants) and island.tied:
                solutions[name] = island.advance(motion, fields, alone, then)
                taken.append(island)
        for bodies in joined:
            solutions |= bodies.advance(motion, fields, alone)
            taken.append(bodies)
    except BaseException:
        for each in taken:
            each.withdraw()
        raise
    return solutions
