"""What a scene asks for and its run did not do: what the services told of that, and tools that took hold of nothing."""

from collections.abc import Iterable, Iterator

import numpy as np

from softseam.columns import Columns
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.session import Event
from softseam_protocol.models import some_read
from softseam_protocol.scene.kinds import INTEGRATORS
from softseam_protocol.scene.motion import ClosePhase, GripPhase, MovePhase, TurnPhase
from softseam_protocol.scene.scene import Scene

_TOLD = (EventKind.NOT_DONE, EventKind.FORCE)


def not_done(scene: Scene, columns: Columns, events: Iterable[Event], done: bool) -> list[str]:
    """Sentences, each with its remedy.

    done  whether the run came to its end: before, tools may still get where they are to
    """
    told = [event.message for event in events if event.kind in _TOLD]
    return told + list(_moving(scene, columns)) + (list(_idle(scene, columns)) if done else [])


def touched(columns: Columns, tool: str) -> bool:
    """Whether a tool ever pressed on a body."""
    return any(bool(columns[f"tool.{tool}.f{axis}"].any()) for axis in "xyz")


def _moving(scene: Scene, columns: Columns) -> Iterator[str]:
    """Bodies that were to be found at rest, and have parts by XPBD, which knows no rest but what motion ends in."""
    others = [model for model in columns.models.values() if not some_read([model], "fem.integrator")]
    if INTEGRATORS[scene.models.fem.integrator].moves or not others:
        return
    yield (
        f"models.fem.integrator: {scene.models.fem.integrator}: the run is by {others[0]}, which moves the body, so "
        "its values swing until something damps them: say body.damping, or take fem"
    )


def _idle(scene: Scene, columns: Columns) -> Iterator[str]:
    """Phases whose tools never touched a body, or took hold of none of its particles; a tool is told of once."""
    reached = columns["phase"].max(initial=-1.0)
    told: set[str] = set()
    held = [columns[f"quantity.{name}"] for name in columns.names("quantity.") if name.rpartition(".")[2] == "held"]
    for number, phase in enumerate(scene.motion):
        if number > reached:
            break
        tools = " and ".join(phase.tools) if isinstance(phase, ClosePhase | GripPhase) else ""
        if isinstance(phase, ClosePhase):
            if not any(touched(columns, tool) for tool in phase.tools):
                told.update(phase.tools)
                yield f"motion[{number}]: {tools} never touched a body: close longer, or begin nearer to it"
        elif isinstance(phase, MovePhase | TurnPhase):
            for tool in phase.tools:
                if tool not in told and not touched(columns, tool):
                    told.add(tool)
                    yield f"motion[{number}]: {tool} never touched a body: move it farther, or begin nearer to it"
        elif isinstance(phase, GripPhase) and held and not any(np.nan_to_num(each).any() for each in held):
            yield (
                f"motion[{number}]: {tools} took hold of nothing: a tool takes the particles within one spacing of it, "
                "so move it there first"
            )
