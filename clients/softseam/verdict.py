"""What became of the body, in a word and a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam.columns import Columns
from softseam_protocol.messages.names import prefix
from softseam_protocol.scene.motion import ClosePhase, MovePhase, OpenPhase, ReleasePhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Vector
from softseam_protocol.scene.tools import PlaneTool

Floats = NDArray[np.float64]

_RISE = 0.002
"""tools that rise less than this lift nothing [m]"""
_LOST = 0.05
"""part of the largest force below which tools have lost the body"""
_FAILED = 0.5
"""part of the steps without a solution from which on a run shows nothing of the body"""
_FALLEN = 0.1
"""part of its highest rise by which a body that was set down may sink once it is let go"""
_SEEN = 0.12
"""time after which a body that was let go in the air has fallen [s]"""


@dataclass(frozen=True)
class Verdict:
    """outcome: 'lifted', 'set down', 'dropped', 'missed', 'finished', 'unfinished' or 'failed'."""

    outcome: str
    text: str


def judge(scene: Scene, columns: Columns, done: bool) -> Verdict:
    """Lifted, set down or dropped, where a body was gripped or carried as tools went up; else whether the run came to
    its end.

    Dropped: in the end the tools that lift, of a grip two of them, press on it with less than 5 % of their largest
    force, or the body's lowest point rose by less than half of the tools' rise and slip explains at least half of the
    difference. A long body that hangs from the tools with one end on the ground is not dropped. Set down: it rose with
    the tools, was lowered by them, and did not fall when they lost it.
    """
    end = "" if done else f", but the run ends early at {columns.last('time'):.3g} s"
    if not len(columns):
        return Verdict("unfinished", "no step was taken")
    ended = Verdict("finished" if done else "unfinished", f"the run came to its end{end}" if done else end[6:])
    names = lifters(scene)
    held = _held(scene, columns)
    if (
        not names
        or scene.bodies[held].said("fixed", ())
        or any(isinstance(phase, ReleasePhase) for phase in scene.motion)
    ):
        return ended  # what is clamped, or let go, is not lifted
    risen = tool_rise(names, columns)
    forces = [np.stack([columns[f"tool.{name}.f{axis}"] for axis in "xyz"]) for name in names]
    sizes = np.array([np.linalg.norm(each, axis=0) for each in forces])
    # a grip has lost what leans on one of its tools
    force = np.sort(sizes, axis=0)[-2] if len(names) > 1 and _grips_that_rise(scene) else sizes.sum(axis=0)
    of = prefix(held, scene.bodies)
    height = columns[f"quantity.{of}lift_height"]
    if sizes.any() and not (_grips_that_rise(scene) or _carried(risen, sum(each[2] for each in forces), names, height)):
        return ended  # pressed, and left
    set_down = _set_down(columns["time"], risen, np.where(np.isfinite(height), height, risen), force)
    if set_down:
        return Verdict("set down", f"set down: {set_down}{end}")
    rise = float(risen[-1])
    if rise < _RISE:
        return ended
    touched, touches = bool(sizes.max() > 0.0), bool(force[-1] > _LOST * force.max())
    lift = float(height[-1]) if np.isfinite(height[-1]) else (rise if touches else 0.0)
    slip = columns[f"quantity.{of}slip"]
    slip = slip[np.isfinite(slip)]
    # the largest so far: a point that has slid out of the tools' reach no longer counts in the last step
    slid = not len(slip) or slip.max() >= 0.5 * (rise - lift)
    figures = f"the tools rose by {1e3 * rise:.1f} mm, the body by {1e3 * lift:.1f} mm"
    if not touched:
        return Verdict("missed", f"the tools never touched the body: {figures}{end}")
    if not touches or (lift < 0.5 * rise and slid):
        return Verdict("dropped", f"dropped: {figures}{end}")
    return Verdict("lifted", f"lifted: {figures}{end}")


def _held(scene: Scene, columns: Columns) -> str:
    """The body that the tools had: of several, the one that rose most."""

    def rose(name: str) -> float:
        return float(np.nanmax(columns[f"quantity.{prefix(name, scene.bodies)}lift_height"], initial=0.0))

    return max(scene.bodies, key=rose)


def with_failures(verdict: Verdict, failed: int, steps: int) -> Verdict:
    """The same of a run in which so many steps found no solution: failed where these are half of all or more."""
    if not failed:
        return verdict
    lost_steps = f"{failed} of {steps} steps found no solution, and the body stood still in them"
    if failed < _FAILED * steps:
        return Verdict(verdict.outcome, f"{verdict.text}; {lost_steps}")
    return Verdict("failed", f"failed: {lost_steps}")


def lifters(scene: Scene) -> tuple[str, ...]:
    """Tools whose mean rise is the body's where they hold it: grips that move up as one; where none does, other tools
    that move up, which may carry it."""
    gripping = _grips_that_rise(scene)
    closing = {name for phase in scene.motion if isinstance(phase, ClosePhase) for name in phase.tools}
    return tuple(sorted(gripping or _rising(scene) - closing))


def _rising(scene: Scene) -> set[str]:
    """Tools that some phase moves up."""
    moves = (phase.ways for phase in scene.motion if isinstance(phase, MovePhase))
    return {name for ways in moves for name, way in ways.items() if way[2] > 0.0}


def _grips_that_rise(scene: Scene) -> set[str]:
    """Tools that some phase moves up together after they closed, before they opened or one of them was moved off."""
    closed: set[tuple[str, ...]] = set()
    found: set[str] = set()
    for phase in scene.motion:
        if isinstance(phase, ClosePhase):
            closed = {grip for grip in closed if not {*grip} & {*phase.tools}} | {phase.tools}
        elif isinstance(phase, OpenPhase):
            closed = {grip for grip in closed if {*grip} != {*phase.tools}}
        elif isinstance(phase, MovePhase):
            closed = {grip for grip in closed if not _opens(scene, grip, phase.ways)}
            found |= {
                name for grip in closed if all(phase.ways.get(n, (0, 0, 0))[2] > 0.0 for n in grip) for name in grip
            }
    return found


def _opens(scene: Scene, grip: tuple[str, ...], ways: Mapping[str, Vector]) -> bool:
    """Whether a move takes tools of a grip apart, as the scene places them."""
    where = [
        tool.point if isinstance(tool, PlaneTool) else tool.position for tool in map(scene.tools.__getitem__, grip)
    ]
    moved = np.array([ways.get(name, (0.0, 0.0, 0.0)) for name in grip])
    aside = np.array(where) - np.mean(where, axis=0)
    return float(((moved - moved.mean(axis=0)) * aside).sum()) > 0.0


def _carried(risen: Floats, upward: Floats, names: tuple[str, ...], height: Floats) -> bool:
    """Whether a body hung on tools that no phase closed while they rose, by the vertical force on them [N], or rose
    with the one that there is."""
    rising = np.diff(risen, prepend=risen[:1]) > 0.0
    return bool(upward[rising].sum() < 0.0) and (len(names) > 1 or float(np.nanmax(height, initial=0.0)) >= _RISE)


def tool_rise(names: tuple[str, ...], columns: Columns) -> Floats:
    """How far the middle of these tools, which a turn about it does not move, is above its lowest place (n,) [m]."""
    middle = np.mean([columns[f"tool.{name}.z"] for name in names], axis=0)
    return np.asarray(middle - middle.min())


def _set_down(time: Floats, tools: Floats, body: Floats, force: Floats) -> str:
    """How a body was set down; '' of one that was not.

    tools, body  how high both are in each step [m]
    force        that the tools press with in all [N]
    """
    held = np.flatnonzero(force > _LOST * force.max())
    if not len(held) or held[-1] == len(force) - 1:
        return ""
    last = int(held[-1]) + 1
    top = int(np.argmax(tools[:last]))
    risen, left = float(body[:last].max()), float(body[last - 1])
    way = float(tools[top] - tools[: top + 1].min())
    allowed = max(_RISE, _FALLEN * risen)
    lifted = way >= _RISE and risen >= max(_RISE, 0.5 * way)
    lowered = float(tools[top] - tools[last - 1]) >= _RISE
    seen = left <= allowed or time[-1] - time[last - 1] >= _SEEN
    if not (lifted and lowered and seen and left - float(body[last:].min()) <= allowed):
        return ""
    where = "and was down again" if left <= allowed else f"and was lowered to {1e3 * left:.1f} mm"
    return f"the body rose by {1e3 * risen:.1f} mm with the tools, {where} before they let go of it"
