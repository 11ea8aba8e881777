"""One short run through the product, and everything that it says about itself."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from softseam.columns import Columns
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
"""parts that FEM may cut a run's steps into, one step into 32 at most: each tries hundreds of iterations"""
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


def follow(scene: Mapping[str, object] | Scene | Path, measure: Measure, *, fields: bool = False) -> Trace:
    """Run a scene to its end; never raises for what becomes of the run.

    scene    a document, a scene, or the path of one beside the meshes that it names
    measure  what the run is judged by, of the observation after a step
    fields   also observe the fields after every step, which `measure` may need
    """
    trace = Trace()
    try:
        parsed = _parsed(scene)
    except SceneError as error:
        return Trace(refused=f"{error.key}: {error.problem}")
    columns, values, events = Columns(parsed.step, tuple(parsed.tools)), list[float](), list[Event]()

    def see(observation: Observation) -> None:
        columns.add(observation.report)
        values.append(measure(observation))
        events.extend(observation.events)
        if sum(event.count for event in events if event.kind is EventKind.STEP) > TOIL:
            raise _Toil(f"given up at {observation.time:.3g} s, where FEM cuts steps again and again")

    try:
        with open_as_given(scene if isinstance(scene, Path) else parsed) as session:
            session.reset()
            trace.doubts = tuple(session.doubts())
            session.run(see, fields=fields)
    except SceneRefused as error:
        return Trace(refused=str(error))
    except (SimulationFailed, _Toil) as error:
        trace.failed = str(error)
    trace.values, trace.events = tuple(values), tuple(events)
    if len(columns):
        _summed(trace, columns, min(parsed.body.wanted_edges, default=math.inf))
    guards = [guard for event in events if (guard := guard_of(event)) is not None]
    trace.safeguards = {guard: guards.count(guard) for guard in dict.fromkeys(guards)}
    trace.warned = tuple(dict.fromkeys(told_by(trace)))
    return trace


def _summed(trace: Trace, columns: Columns, edge: float) -> None:
    """What follows from all steps together, put into the trace; edge: of the shortest cells [m]."""
    names = ("kinetic", "strain", "dissipation", "tool_work", "seam_work")
    kinetic, strain, loss, tools, seam = (columns[f"energy.{name}"] for name in names)
    values, time = np.array(trace.values), columns["time"]
    trace.value, trace.times = float(np.mean(values[-max(1, len(values) // 4) :])), tuple(time.tolist())
    broken = np.flatnonzero(~np.isfinite(values + kinetic + strain + loss))
    trace.finite, trace.broke = not len(broken), float(time[broken[0]]) if len(broken) else 0.0
    trace.gap = float(np.fmax.reduce(columns["gap"])) / edge
    largest = np.fmax.reduce([*(kinetic + strain), *np.abs(np.cumsum(tools)), 0.0])
    if largest > 0.0:
        rise = -np.cumsum(loss)
        above = rise - np.minimum.accumulate(np.minimum(rise, 0.0))
        trace.created = float(np.fmax.reduce([*above, 0.0]) / largest)
        trace.seam_work = float(np.fmax.reduce(np.abs(np.cumsum(seam))) / largest)


def _parsed(scene: Mapping[str, object] | Scene | Path) -> Scene:
    """Raises SceneError."""
    if isinstance(scene, Path):
        return load_scene(scene).scene
    return scene if isinstance(scene, Scene) else parse_scene(json.dumps(scene), "atlas")


class _Toil(Exception):
    """A run needs more work than it is worth."""


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
