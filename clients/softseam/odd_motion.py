"""What in a scene's motion is likely a mistake: another unit than meant, or an end that may not come."""

import math

from softseam.duration import expected_duration
from softseam_protocol.scene.motion import ClosePhase, MovePhase, TurnPhase
from softseam_protocol.scene.scene import Scene

_TURNS = 2.0
"""more full turns are unlike a hand's"""
_FAR = 30.0
"""moves so many times as long as the body are unlike a hand's"""
_MANY_STEPS = 100_000
"""more steps take hours, of whatever body"""
_IDLE, _LONG = 30.0, 60.0
"""durations longer than both so many times the motion and this [s] are unlike a run that is watched"""
_CRUSHING = 3.0
"""forces beyond so many times Young's modulus on the square of the body's largest extent squeeze it flat"""
_TURNED = 0.3
"""turn of a linear body beyond which it swells by a twentieth [rad]"""
_OF_GRIP = ("grip_force", "compression")


def odd_motion(scene: Scene, size: float) -> list[str]:
    """Sentences, each beginning with its key.

    size  largest extent of the body [m]
    """
    found = [*_never_gripped(scene), *_odd_length(scene), *_turned_linear(scene)]
    for number, phase in enumerate(scene.motion):
        key = f"motion.{number}"
        if isinstance(phase, TurnPhase):
            turn = math.hypot(*phase.turn)
            if turn > _TURNS * 2.0 * math.pi:
                count = turn / (2.0 * math.pi)
                found.append(f"{key}.turn: {turn:.4g} rad are {count:.3g} full turns; is it in rad, not in degrees?")
        elif isinstance(phase, MovePhase):
            way = phase.length
            if way > _FAR * size:
                times = f"{way / size:.3g} times the body's {size:.3g} m"
                found.append(f"{key}.move: {way:.4g} m are {times}; is it in m, not in mm?")
        elif isinstance(phase, ClosePhase):
            found += _crushes(scene, key, phase, size)
            until = phase.until
            if scene.duration is None and until.force is not None and until.time is None and until.compression is None:
                found.append(
                    f"{key}.until: {until.force:g} N may never be reached, and then the run does not end: give `time` "
                    "or `compression`, too; the first that is met ends the phase"
                )
    return found


def _odd_length(scene: Scene) -> list[str]:
    """That a run has more steps than anybody waits for, or goes on long after its motion."""
    length = expected_duration(scene)
    if length is not None and length / scene.step > _MANY_STEPS:
        return [
            f"step: {scene.step:g} s are {length / scene.step:,.0f} steps in {length:.4g} s, which take hours; are "
            "both in s, not in ms or us?"
        ]
    motion = expected_duration(scene.model_copy(update={"duration": None})) if scene.motion else None
    if scene.duration is None or motion is None or scene.duration <= max(_LONG, _IDLE * motion):
        return []
    return [f"duration: {scene.duration:.4g} s, but the motion is over after {motion:.3g} s; is it in s, not in ms?"]


def _turned_linear(scene: Scene) -> list[str]:
    """That a body turns whose law knows no turns: by itself, or between tools."""
    if all(material.kind != "linear" for material in scene.body.cell_materials):
        return []
    turns = [phase for phase in scene.motion if isinstance(phase, TurnPhase) and len(phase.tools) > 1]
    spun = math.hypot(*scene.body.said("spin", ())) * (expected_duration(scene) or 0.0)
    angle = max([spun, *(math.hypot(*phase.turn) for phase in turns)])
    if angle <= _TURNED:
        return []
    return [
        f"body.material.kind: linear knows no turns: a body that turns by {angle:.2g} rad swells, and goes on turning "
        "too slowly; take neo_hookean"
    ]


def _crushes(scene: Scene, key: str, phase: ClosePhase, size: float) -> list[str]:
    """That a grip's force is beyond what the body can bear."""
    if not scene.body.has_cells:
        return []
    most = _CRUSHING * max(material.young for material in scene.body.cell_materials) * size**2
    found = []
    for name, force in (("force", phase.force), ("until.force", phase.until.force)):
        if force is not None and force > most:
            found.append(
                f"{key}.{name}: {force:.4g} N squeezes a body of {size:.3g} m flat, whose material bears some "
                f"{most / _CRUSHING:.2g} N on the whole of a side; is it in N, not in mN?"
            )
    return found


def _never_gripped(scene: Scene) -> list[str]:
    """That quantities of a grip are asked for where no phase closes tools; who moves tools by hand may still do so."""
    asked = [name for name in scene.quantities if name in _OF_GRIP]
    if not asked or not scene.motion or any(isinstance(phase, ClosePhase) for phase in scene.motion):
        return []
    return [
        f"quantities: {' and '.join(asked)}: no phase of the motion closes two tools, of which that would be: add one "
        "with `close`, or leave it out"
    ]
