"""The least that takes part: nodes on springs, each to the place where it rests; and requests for it.

`python tests/small_part.py ENDPOINT HOW` serves it; HOW says what becomes of a step under a force beyond 1 N.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softseam.conform.examined_part import DENSITY, EDGE, FAR_END, POISSON, STEP, YOUNG, mesh
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.names import ONLY_BODY, within
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Committed,
    Configure,
    Configured,
    Correct,
    Failure,
    Fields,
    Observe,
    Reply,
    Request,
    Restored,
    SnapshotTaken,
    ToolMotion,
)
from softseam_protocol.participant.handler import ParticipantHandler
from softseam_protocol.participant.part import Part
from softseam_protocol.participant.part_solver import participant_of
from softseam_protocol.participant.serve import serve
from softseam_protocol.participant.state import State
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_protocol.wire.codec import encode

Floats = NDArray[np.float64]

STIFFNESS = 1e-3
"""of each node's spring [N/m]: so soft that momentum is kept to what the kit allows"""
PUSH = np.full((len(FAR_END), 3), 1e-3)
"""a force on the coupling nodes (9, 3) [N]"""
TOO_MUCH = np.full((len(FAR_END), 3), 2.0)
"""one beyond what `upset` waits for (9, 3) [N]"""
_BLOCK = {
    "shape": {"kind": "block", "size": (2 * EDGE, EDGE, EDGE)},
    "cell": EDGE,
    "material": {"young": YOUNG, "poisson": POISSON, "density": DENSITY},
}
_SCENE = Scene.model_validate({"softseam": 1, "name": "springs", "step": STEP, "duration": 1.0, "body": _BLOCK})


class Springs(Part):
    """m (v1 - v0) = dt (f + m g - k (x1 - X)), x1 = x0 + dt v1, node by node."""

    def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
        mass = self.mesh.mass[:, None]
        load = mass * self.gravity - STIFFNESS * (state.x - self.mesh.x_rest)
        load[self.coupling] += force
        v = (mass * state.v + dt * load) / (mass + dt * dt * STIFFNESS)
        return State(state.x + dt * v, v)

    def strain_energy(self, state: State) -> Floats:
        whole = 0.5 * STIFFNESS * ((state.x - self.mesh.x_rest) ** 2).sum()
        return np.full(2, 0.5 * whole)


class Answering(Springs):
    """That tells how it yields, too."""

    def response(self, state: State, dt: float) -> Floats:
        yields = dt * dt / (self.mesh.mass + dt * dt * STIFFNESS)
        found = np.zeros((len(yields), 3, len(self.coupling), 3))
        for place, node in enumerate(self.coupling):
            found[node, :, place] = yields[node] * np.eye(3)
        return found.reshape(3 * len(yields), -1)


def upset(happens: Callable[[State], State]) -> type[Springs]:
    """A part to which that happens at the end of a step under a force beyond 1 N."""

    class Upset(Answering):
        def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
            end = super().step(state, dt, force, tools)
            return happens(end) if np.abs(force).max(initial=0.0) > 1.0 else end

    return Upset


def header(step: int = 0, exchange: int = 0, *, session: str = "s", epoch: int = 1, part: str = "near") -> Header:
    return Header(SCHEMA_VERSION, session, within(ONLY_BODY, part), epoch, step, exchange, step * STEP)


def configure(head: Header | None = None, coupling: NDArray[np.int32] = FAR_END, model: str = "springs") -> Configure:
    """The block of the kit, at rest."""
    cells = np.arange(2, dtype=np.int32)
    return Configure(head or header(), bundle_scene(_SCENE), model, cells, coupling, None, True, ONLY_BODY, mesh())


def advance(head: Header, force: Floats = PUSH, *, dt: float = STEP, compliance: bool = False) -> Advance:
    none = np.zeros((0, 3))
    return Advance(head, dt, force, ToolMotion(none, np.zeros((0, 4)), none, np.zeros((0, 4))), compliance)


def correct(head: Header, push: Floats = PUSH, then: Advance | None = None) -> Correct:
    return Correct(head, push, push, then=then)


def handler(part: type[Part] = Springs) -> ParticipantHandler:
    return ParticipantHandler(participant_of(part), ("springs",))


def ask(to: ParticipantHandler, request: Request) -> Reply:
    """The reply, or the Failure; as it would be after the bus."""
    return to.participant.handle(request)


def refused(to: ParticipantHandler, request: Request) -> tuple[str, str]:
    """Kind and text of the Failure that answers a request."""
    reply = ask(to, request)
    assert isinstance(reply, Failure), reply
    return str(reply.kind), reply.message


def begun(part: type[Part] = Springs, steps: int = 2) -> ParticipantHandler:
    """A participant with a part that has taken some steps, the last of them tentative."""
    one = handler(part)
    assert isinstance(ask(one, configure()), Configured)
    for step in range(steps):
        taken(one, step)
    return one


def taken(one: ParticipantHandler, step: int, exchange: int = 0, force: Floats = PUSH) -> Advanced:
    """The answer to a step that converged."""
    reply = ask(one, advance(header(step, exchange), force))
    assert isinstance(reply, Advanced) and reply.status is Status.CONVERGED, reply
    return reply


def seen(one: ParticipantHandler, session: str = "s") -> Fields:
    """What a part shows of its state."""
    reply = ask(one, Observe(header(session=session)))
    assert isinstance(reply, Fields)
    return reply


def same(one: Reply, other: Reply) -> bool:
    """Whether two replies are the same but for the clock."""
    clocks = (Configured, Advanced, Committed, Fields, SnapshotTaken, Restored)
    first, second = (replace(each, seconds=0.0) if isinstance(each, clocks) else each for each in (one, other))
    return encode(first) == encode(second)


def _dies(state: State) -> State:
    os.kill(os.getpid(), signal.SIGKILL)
    return state


def _leaves(state: State) -> State:
    raise SystemExit("the licence has expired")


def _hangs(state: State) -> State:
    print("at work", flush=True)
    threading.Event().wait()
    return state


def _dawdles(state: State) -> State:
    print("at work", flush=True)
    threading.Event().wait(1.0)
    return state


HOW = {"dies": _dies, "leaves": _leaves, "hangs": _hangs, "dawdles": _dawdles, "not at all": lambda state: state}

if __name__ == "__main__":
    serve(upset(HOW[sys.argv[2]]), "springs", connect=sys.argv[1])
