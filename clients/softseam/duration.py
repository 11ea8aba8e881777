"""How long a scene's motion will last, and what a step of FEM or of XPBD takes by its cells: roughly, to put runs in
order before any was made."""

import numpy as np

from softseam_protocol.scene.bodies import BlockShape, Shape, block_of
from softseam_protocol.scene.motion import (
    ClosePhase,
    GripPhase,
    HoldPhase,
    MovePhase,
    OpenPhase,
    ReleasePhase,
    TurnPhase,
)
from softseam_protocol.scene.scene import MOST_STEPS, Scene
from softseam_protocol.scene.tools import BoxTool, PlaneTool, ToolSpec


def expected_duration(scene: Scene) -> float | None:
    """Simulated time of the whole run [s]; None where it depends on a force, or on where tools touch, which
    only services know."""
    if scene.duration is not None:
        return scene.duration
    total = 0.0
    closed: dict[str, float] = {}
    for phase in scene.motion:
        if isinstance(phase, HoldPhase):
            total += phase.hold
        elif isinstance(phase, GripPhase):
            total += phase.grip
        elif isinstance(phase, ReleasePhase):
            total += phase.release
        elif isinstance(phase, MovePhase | TurnPhase):
            total += phase.ramp.time
        elif isinstance(phase, OpenPhase):
            back = phase.until.way if phase.until is not None else max(closed.get(name, 0.0) for name in phase.tools)
            total += back / phase.open
            for name in phase.tools:
                closed[name] = max(0.0, closed.get(name, 0.0) - back)
        else:
            length = _closing_time(scene, phase, closed)
            if length is None:
                return None
            total += length
            for name in phase.tools:
                closed[name] = closed.get(name, 0.0) + phase.close * length
    return total


def too_many_steps(scene: Scene) -> str:
    """What to say of a scene whose motion takes more steps than any run has; '' of others."""
    length = expected_duration(scene)
    if length is None or length / scene.step <= MOST_STEPS:
        return ""
    count = f"{length / scene.step:.3g} steps in {length:.3g} s"
    return f"step: {count}, more than {MOST_STEPS:,}: lengthen `step`, or shorten the motion"


def _shape_between(scene: Scene, first: ToolSpec, second: ToolSpec) -> Shape | None:
    """Shape of the body that the two close on; None where it has none, or where it is not known which of several."""
    shapes = [None if (cells := body.in_cells) is None else cells.shape for body in scene.bodies.values()]
    if len(shapes) == 1:
        return shapes[0]
    if isinstance(first, PlaneTool) or isinstance(second, PlaneTool):
        return None
    middle = 0.5 * np.add(first.position, second.position)
    for body in scene.bodies.values():
        if (block := block_of(body)) is not None:
            size = np.array(block.shape.size)
            if (np.abs(middle - block.body.position - [0.0, 0.0, 0.5 * size[2]]) <= 0.5 * size).all():
                return block.shape
    return None


def _closing_time(scene: Scene, phase: ClosePhase, closed: dict[str, float]) -> float | None:
    """Length of a closing phase [s]; `closed` is how far each tool has approached the other before [m]."""
    bounds = [] if phase.until.time is None else [phase.until.time]
    if len(phase.tools) > 2 or phase.about is not None:
        return min(bounds, default=None)
    first, second = (scene.tools[name] for name in phase.tools)
    shape = _shape_between(scene, first, second)
    if (
        phase.until.compression is not None
        and isinstance(shape, BlockShape)
        and not isinstance(first, PlaneTool)
        and not isinstance(second, PlaneTool)
    ):
        way = np.subtract(second.position, first.position)
        axis = way / np.linalg.norm(way)
        askew = any(isinstance(tool, BoxTool) and any(tool.rotation) for tool in (first, second))
        if askew or np.abs(axis).max() < 1.0 - 1e-9:
            return min(bounds, default=None)  # where they touch only services know
        x, y, z = axis.tolist()
        one, other = first.extent((x, y, z)), second.extent((x, y, z))
        if one is not None and other is not None:
            gap = float(way @ axis) - one - other
            gap -= sum(closed.get(name, 0.0) for name in phase.tools)
            width = float(np.abs(axis) @ np.array(shape.size))
            bounds.append(max(0.0, gap - (1.0 - phase.until.compression) * width) / (2.0 * phase.close))
    return min(bounds, default=None)


def fem_step(n_cells: float) -> float:
    """Rough wall time of a step of FEM [s]."""
    return float(2e-4 + 4e-6 * n_cells**1.55)


def xpbd_step(n_cells: float, step: float) -> float:
    """Rough wall time of a step of XPBD of that length [s]."""
    return float(2e-4 + 2.5e-6 * n_cells ** (4 / 3) * step / 0.01)
