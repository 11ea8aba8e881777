"""What in a scene's motion is likely a mistake: another unit than meant, or an end that may not come."""

from __future__ import annotations

import math

from softseam_protocol.scene.motion import ClosePhase, MovePhase, TurnPhase
from softseam_protocol.scene.scene import Scene

_TURNS = 2.0
"""more full turns are unlike a hand's"""
_FAR = 30.0
"""moves so many times as long as the body are unlike a hand's"""
_OF_GRIP = ("grip_force", "compression")


def odd_motion(scene: Scene, size: float) -> list[str]:
    """Sentences, each beginning with its key.

    size  largest extent of the body [m]
    """
    found = _never_gripped(scene)
    for number, phase in enumerate(scene.motion):
        key = f"motion.{number}"
        if isinstance(phase, TurnPhase):
            turn = math.hypot(*phase.turn)
            if turn > _TURNS * 2.0 * math.pi:
                count = turn / (2.0 * math.pi)
                found.append(f"{key}.turn: {turn:.4g} rad are {count:.3g} full turns; is it in rad, not in degrees?")
        elif isinstance(phase, MovePhase):
            way = math.hypot(*phase.move)
            if way > _FAR * size:
                times = f"{way / size:.3g} times the body's {size:.3g} m"
                found.append(f"{key}.move: {way:.4g} m are {times}; is it in m, not in mm?")
        elif isinstance(phase, ClosePhase) and scene.duration is None:
            until = phase.until
            if until.force is not None and until.time is None and until.compression is None:
                found.append(
                    f"{key}.until: {until.force:g} N may never be reached, and then the run does not end: give `time` "
                    "or `compression`, too; the first that is met ends the phase"
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
