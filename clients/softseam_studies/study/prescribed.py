"""What a scene's motion prescribes: every run has it, however wrong it is in all else, so no plan promises it."""

from softseam_protocol.scene.motion import ClosePhase, MovePhase
from softseam_protocol.scene.scene import Scene


def prescribed(scene: Scene) -> dict[str, str]:
    """Names of quantities, and what prescribes each."""
    grips = [phase for phase in scene.motion if isinstance(phase, ClosePhase)]
    found = {}
    if any(grip.force is not None for grip in grips):
        found["grip_force"] = "the motion prescribes it: tools hold this force"
    elif grips and all(grip.until.force is None for grip in grips):
        found["compression"] = "the motion prescribes it: tools close by so much"
    moves = (phase for phase in scene.motion if isinstance(phase, MovePhase))
    if any(way[2] > 0.0 for phase in moves for way in phase.ways.values()):
        found["lift_height"] = "the motion prescribes it: tools rise by so much"
    return found
