"""Phases whose tools never touched a body, or took hold of none of its particles; each tool is named once."""

from collections.abc import Iterator

import numpy as np

from softseam.to_check import Ended
from softseam_protocol.scene.motion import ClosePhase, GripPhase, MovePhase, TurnPhase


def look(run: Ended) -> Iterator[str]:
    columns, named = run.columns, set[str]()
    reached = columns["phase"].max(initial=-1.0)
    held = [columns[f"quantity.{name}"] for name in columns.names("quantity.") if name.rpartition(".")[2] == "held"]

    def touched(tool: str) -> bool:
        return any(bool(columns[f"tool.{tool}.f{axis}"].any()) for axis in "xyz")

    for number, phase in enumerate(run.scene.motion):
        if number > reached:
            break
        if isinstance(phase, ClosePhase) and not any(map(touched, phase.tools)):
            named.update(phase.tools)
            tools = " and ".join(phase.tools)
            yield f"motion[{number}]: {tools} never touched a body: close longer, or begin nearer to it"
        elif isinstance(phase, MovePhase | TurnPhase):
            for tool in phase.tools:
                if tool not in named and not touched(tool):
                    named.add(tool)
                    yield f"motion[{number}]: {tool} never touched a body: move it farther, or begin nearer to it"
        elif isinstance(phase, GripPhase) and held and not any(np.nan_to_num(each).any() for each in held):
            yield (
                f"motion[{number}]: {' and '.join(phase.tools)} took hold of nothing: a tool takes the particles "
                "within one spacing of it, so move it there first"
            )
