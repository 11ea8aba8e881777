"""Of many bodies that touch: which one tools take, and which stand by. The first are worth fine cells and the
model that is right for them, the others few cells and the cheaper model (docs/results/front.md).

What tools take is the body that is nearest, at rest, to the middle of tools that close, or to where one that moves by
itself comes to. It is found from the scene alone, so that every process and every replay finds the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.apart import box_of
from softseam_protocol.scene.bodies import AnyBody as AnyBodySpec
from softseam_protocol.scene.bodies import block_of
from softseam_protocol.scene.interfaces import ContactsSpec
from softseam_protocol.scene.motion import ClosePhase, MovePhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import SolidTool

Floats = NDArray[np.float64]

_CROWD = 3
"""bodies in a crowd, at least"""
_TAKEN, _ASIDE = 4.0, 2.0
"""cells along the least extent of a block that tools take, and of one that stands by"""


@dataclass(frozen=True)
class Role:
    """Of a body in a crowd."""

    taken: bool
    """whether tools take it"""
    by: str
    """which tools take what, in words"""


def role_of(scene: Scene, name: str) -> Role | None:
    """Of a body of a scene whose bodies touch by its `contacts`, blocks at rest; None where there is no crowd, or where
    no tool takes any."""
    boxes = {each: np.array(box) for each, body in scene.bodies.items() if (box := box_of(body)) is not None}
    if not isinstance(scene.contacts, ContactsSpec) or len(boxes) < _CROWD or name not in boxes:
        return None
    taken = _taken(scene, boxes)
    if not taken:
        return None
    by = "; ".join(f"{tools} take {body}" for body, tools in taken.items())
    return Role(name in taken, by)


def with_cells(spec: AnyBodySpec, role: Role) -> AnyBodySpec:
    """The body with cells as its role wants them, where the scene gives none."""
    block = block_of(spec)
    if block is None or block.body.cell is not None or block.shape.graded:
        return spec
    edge = min(block.shape.size) / (_TAKEN if role.taken else _ASIDE)
    return block.body.model_copy(update={"cell": edge})


def _taken(scene: Scene, boxes: dict[str, Floats]) -> dict[str, str]:
    """Bodies that tools take, with the tools' names."""
    at = {name: np.array(tool.position) for name, tool in scene.tools.items() if isinstance(tool, SolidTool)}
    close = {name for phase in scene.motion if isinstance(phase, ClosePhase) for name in phase.tools}
    found: dict[str, str] = {}
    for phase in scene.motion:
        if isinstance(phase, ClosePhase) and at.keys() >= set(phase.tools):
            middle = np.mean([at[name] for name in phase.tools], axis=0)
            found.setdefault(_nearest(boxes, middle), " and ".join(phase.tools))
        elif isinstance(phase, MovePhase):
            for name in at.keys() & set(phase.tools):
                at[name] = at[name] + np.array(phase.move[name] if isinstance(phase.move, dict) else phase.move)
                if name not in close:
                    found.setdefault(_nearest(boxes, at[name]), name)
    return found


def _nearest(boxes: dict[str, Floats], point: Floats) -> str:
    """The body whose box is nearest to a point; of several that hold it, or touch it, whose middle is."""

    def away(name: str) -> tuple[float, float]:
        low, high = boxes[name]
        beside = np.maximum(np.maximum(low - point, point - high), 0.0)
        return float(np.linalg.norm(beside)), float(np.linalg.norm(0.5 * (low + high) - point))

    return min(boxes, key=away)
