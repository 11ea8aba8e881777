"""Phases in another unit than meant, or whose end may not come; quantities of a grip where nothing closes."""

import math
from collections.abc import Iterator

from softseam.to_check import Written
from softseam_protocol.scene.motion import ClosePhase, MovePhase, TurnPhase

_OF_GRIP = ("grip_force", "compression")


def look(seen: Written) -> Iterator[str]:
    scene, size = seen.scene, seen.size
    asked = [name for name in scene.quantities if name in _OF_GRIP]
    if asked and scene.motion and not any(isinstance(phase, ClosePhase) for phase in scene.motion):
        yield (
            f"quantities: {' and '.join(asked)}: no phase of the motion closes two tools, of which that would be: add "
            "one with `close`, or leave it out"
        )
    for number, phase in enumerate(scene.motion):
        key = f"motion.{number}"
        if isinstance(phase, TurnPhase) and (turns := math.hypot(*phase.turn) / (2.0 * math.pi)) > 2.0:
            turn = math.hypot(*phase.turn)
            yield f"{key}.turn: {turn:.4g} rad are {turns:.3g} full turns; is it in rad, not in degrees?"
        elif isinstance(phase, MovePhase) and phase.length > 30.0 * size:
            times = f"{phase.length / size:.3g} times the body's {size:.3g} m"
            yield f"{key}.move: {phase.length:.4g} m are {times}; is it in m, not in mm?"
        elif isinstance(phase, ClosePhase):
            yield from _crushes(seen, key, phase)
            until = phase.until
            if scene.duration is None and until.force is not None and until.time is None and until.compression is None:
                yield (
                    f"{key}.until: {until.force:g} N may never be reached, and then the run does not end: give `time` "
                    "or `compression`, too; the first that is met ends the phase"
                )


def _crushes(seen: Written, key: str, phase: ClosePhase) -> Iterator[str]:
    """A grip's force beyond three times what Young's modulus makes of a side of the body's largest extent."""
    if not seen.body.has_cells:
        return
    bears = max(material.young for material in seen.body.cell_materials) * seen.size**2
    for name, force in (("force", phase.force), ("until.force", phase.until.force)):
        if force is not None and force > 3.0 * bears:
            yield (
                f"{key}.{name}: {force:.4g} N squeezes a body of {seen.size:.3g} m flat, whose material bears some "
                f"{bears:.2g} N on the whole of a side; is it in N, not in mN?"
            )
