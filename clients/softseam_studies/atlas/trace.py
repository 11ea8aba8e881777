"""One short run through the product, and everything that it says about itself."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from softseam.errors import SceneRefused, SimulationFailed
from softseam.observation import Observation
from softseam.session import open_as_given
from softseam_protocol.messages.outcomes import Detail, EventKind
from softseam_protocol.messages.session import Event
from softseam_protocol.scene.file import SceneError, load_scene, parse_scene
from softseam_protocol.scene.scene import Scene

Measure = Callable[[Observation], float]

CONFIRMED = 1e-3
"""share of the largest energy above which an alarm of the ledger is more than the noise of the first steps [1]"""
TOIL = 40
"""parts that FEM may cut a run's steps into, one step into 32 at most"""
PARTS = "seam step in parts"
CRUSHED = "full quadrature of crushed cells"
CUT = "FEM cut the step"
RETRIED = "monitor of PBD: step repeated with more substeps"
MORE_SWEEPS = "monitor of PBD: more sweeps"
SHORTER = "monitor of PBD: shorter substeps"
RESTORED = "participant restored from its checkpoint"


@dataclass
class Trace:
    """What a run did."""

    value: float = float("nan")
    """mean of what was measured over the last quarter of the run"""
    finite: bool = True
    broke: float = 0.0
    """time from which on something was not a number [s]"""
    created: float = 0.0
    """highest rise of the energy beyond the work done on the body, relative to the largest energy in the run [1]"""
    seam_work: float = 0.0
    """largest sum of the seam's work, in the same measure [1]"""
    gap: float = 0.0
    """largest gap at the seam that a step was committed with, in cell edges [1]"""
    refused: str = ""
    failed: str = ""
    safeguards: dict[str, int] = field(default_factory=dict)
    """which acted, and in how many steps"""
    events: tuple[Event, ...] = ()
    doubts: tuple[str, ...] = ()
    """warnings before the first step"""
    warned: tuple[str, ...] = ()
    """indicators that warned"""
    values: tuple[float, ...] = ()
    """what was measured after each step"""
    times: tuple[float, ...] = ()
    """[s]"""


def follow(
    scene: Mapping[str, object] | Scene | Path, measure: Measure, *, fields: bool = False, toil: int = TOIL
) -> Trace:
    """Run a scene to its end; never raises for what becomes of the run.

    scene    a document, a scene, or the path of one beside the meshes that it names
    measure  what the run is judged by, of the observation after a step
    fields   also observe the fields after every step, which `measure` may need
    toil     parts of cut steps after which the run is given up: each tries hundreds of iterations
    """
    trace = Trace()
    try:
        parsed = _parsed(scene)
    except SceneError as error:
        return Trace(refused=f"{error.key}: {error.problem}")
    watch = _Watch(parsed, measure, toil)
    try:
        with open_as_given(scene if isinstance(scene, Path) else parsed) as session:
            session.reset()
            trace.doubts = tuple(session.doubts())
            session.run(watch.see, fields=fields)
    except SceneRefused as error:
        return Trace(refused=str(error))
    except (SimulationFailed, _Toil) as error:
        trace.failed = str(error)
    watch.write(trace)
    return trace


def _parsed(scene: Mapping[str, object] | Scene | Path) -> Scene:
    """Raises SceneError."""
    if isinstance(scene, Path):
        return load_scene(scene).scene
    return scene if isinstance(scene, Scene) else parse_scene(json.dumps(scene), "atlas")


class _Toil(Exception):
    """A run needs more work than it is worth."""


class _Watch:
    """Collects what a run shows, step by step."""

    def __init__(self, scene: Scene, measure: Measure, toil: int) -> None:
        self._measure, self._scene, self._left = measure, scene, toil
        self._values: list[float] = []
        self._times: list[float] = []
        self._events: list[Event] = []
        self._guards: dict[str, int] = {}
        self._scale = self._created = self._gap = self._tool_work = self._seam_work = 0.0
        self._rise = self._lowest = self._most_seam_work = 0.0
        self._broke: float | None = None

    def see(self, observation: Observation) -> None:
        self._events += observation.events
        self._values.append(self._measure(observation))
        self._times.append(observation.time)
        energy = observation.energies
        self._tool_work += energy["tool_work"]
        self._scale = max(self._scale, energy["kinetic"] + energy["strain"], abs(self._tool_work))
        self._rise -= energy["dissipation"]
        self._lowest = min(self._lowest, self._rise)
        self._created = max(self._created, self._rise - self._lowest)
        self._seam_work += energy["seam_work"]
        self._most_seam_work = max(self._most_seam_work, abs(self._seam_work))
        self._gap = max(self._gap, observation.seam.gap)
        numbers = [self._values[-1], energy["kinetic"], energy["strain"], energy["dissipation"]]
        for event in observation.events:
            if event.kind is EventKind.STEP:
                self._left -= event.count
        if self._left < 0:
            raise _Toil(f"given up at {observation.time:.3g} s, where FEM cuts steps again and again")
        if self._broke is None and not np.isfinite(numbers).all():
            self._broke = observation.time

    def write(self, trace: Trace) -> None:
        trace.values, trace.times = tuple(self._values), tuple(self._times)
        if self._values:
            trace.value = float(np.mean(self._values[-max(1, len(self._values) // 4) :]))
        trace.finite, trace.broke = self._broke is None, self._broke or 0.0
        if self._scale > 0.0:
            trace.created, trace.seam_work = self._created / self._scale, self._most_seam_work / self._scale
        body = self._scene.body
        if body.wanted_edges:
            trace.gap = self._gap / min(body.wanted_edges)
        for event in self._events:
            if (guard := guard_of(event)) is not None:
                self._guards[guard] = self._guards.get(guard, 0) + 1
        trace.safeguards = self._guards
        trace.events = tuple(self._events)
        trace.warned = tuple(dict.fromkeys(told_by(trace)))


def guard_of(event: Event) -> str | None:
    """The safeguard that an event stands for; None for any other event."""
    if event.kind in _GUARD_OF_KIND:
        return _GUARD_OF_KIND[event.kind]
    return next((guard for of, guard in _GUARD_OF_DETAIL.items() if of in event.details), None)


_GUARD_OF_KIND = {
    EventKind.CELLS: CRUSHED,
    EventKind.STEP: CUT,
    EventKind.PARTICIPANT_RESTORED: RESTORED,
}
_GUARD_OF_DETAIL = {
    Detail.PARTS: PARTS,
    Detail.REPEATED: RETRIED,
    Detail.SWEEPS: MORE_SWEEPS,
    Detail.SHORTER: SHORTER,
}
"""the first that an event has counts"""


def told_by(trace: Trace) -> list[str]:
    """The run's own indicators that warned of something wrong."""
    found = [f"before the run: {doubt.partition(':')[0]}" for doubt in trace.doubts]
    for event in trace.events:
        if event.kind in _TOLD_BY_KIND:
            found.append(_TOLD_BY_KIND[event.kind])
        if Detail.CREATED in event.details and trace.created > CONFIRMED:
            found.append("alarm: energy from nowhere")
        if Detail.SEAM_WORK in event.details and trace.seam_work > CONFIRMED:
            found.append("alarm: the seam does work")
        found += [text for of, text in _TOLD_BY_DETAIL.items() if of in event.details]
    return found


_TOLD_BY_KIND = {
    EventKind.GONE: "event: a body is gone",
    EventKind.CREEP: "event: a body creeps",
    EventKind.FORCE: "event: a phase ends off its force",
    EventKind.ACCURACY: "event: the estimated error is too large",
    EventKind.DAMPED: "event: steps damp a bounce or a swing",
    EventKind.ELEMENT: "event: the element is too stiff",
    EventKind.SOLVER: "a step was kept that had not converged",
}
_TOLD_BY_DETAIL = {
    Detail.CONTACT: "alarm: contact does work",
    Detail.MET: "event: the tools have met",
    Detail.PIERCED: "event: a tool is inside a body",
    Detail.TOO_FAR: "event: a tool moves too far in a step",
    Detail.UNCONVERGED: "monitor of PBD: not converged",
    Detail.INSIDE_OUT: "monitor of FEM: cells are inside out",
    Detail.GAP_KEPT: "a gap at the seam was kept",
}
