"""Tools that a phase of the motion takes half through themselves in a step, as it begins or is fastest."""

from collections.abc import Iterator

from softseam_protocol.scene.motion import MovePhase, TurnPhase
from softseam_services.orchestrator.grips import Grips
from softseam_services.orchestrator.program import Program, Progress
from softseam_services.to_check import Cells
from softseam_services.tools.motion import tool_motion
from softseam_services.tools.travel import beyond_middle


def look(seen: Cells) -> Iterator[str]:
    scene, tools = seen.scene, seen.tools
    program = Program(scene.motion, scene.step, tools, Grips(scene, tools, [seen.body]))
    for phase, spec in enumerate(scene.motion):
        fastest = 0.0
        if isinstance(spec, MovePhase | TurnPhase) and spec.acceleration is not None:
            fastest = max(0.0, 0.5 * (spec.ramp.time - scene.step))
        command, _ = program.step(Progress(phase, fastest), tools.position, tools.orientation)
        for name in beyond_middle(tools, tool_motion(tools, tools.position, tools.orientation, command, scene.step)):
            yield (
                f"motion.{phase}: {name} moves half its thickness in a step of {1e3 * scene.step:g} ms: the body may "
                "come out behind it; shorten `step`, or move it more slowly"
            )
