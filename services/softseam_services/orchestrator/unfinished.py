"""What to say of a motion that did not get where it was to: phases that time ended, and those that a run left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.motion import ClosePhase, Phase
from softseam_services.orchestrator.force_search import NEAR_ENOUGH

Floats = NDArray[np.float64]

_HELD = 0.9
"""of the force that a phase is to hold, from which on its tools have taken hold"""
_NEAR = 1.0 - NEAR_ENOUGH
"""of the force or squeeze that is to end a phase, from which on it was reached"""
_TURNED, _LEAST_TURNED = 0.25, 0.02
"""of a compression, and [1], both of which a body must lack to be told of: what it deforms by turns it, too"""
_SHORT, _SHORTEST = 0.01, 1e-4
"""of a way, and [m], both of which a tool must lack to be told of"""


def unreached(number: int, phase: Phase, compression: float, force: float) -> str:
    """What a closing phase lacked when its `until.time` ended it, with the remedy; '' where that was nothing.

    compression  of the body between its tools [1]
    force        mean force on them [N]
    """
    if not isinstance(phase, ClosePhase) or phase.until.time is None:
        return ""
    until, short = phase.until, []
    if until.force is not None and force < _NEAR * until.force:
        short.append(f"{max(0.0, force):.3g} N, not with the {until.force:g} N of until.force")
    elif phase.force is not None and force < _HELD * phase.force:
        short.append(f"{max(0.0, force):.3g} N, not with the {phase.force:g} N of `force`")
    if until.compression is not None and compression < _NEAR * until.compression:
        squeezed = f"a compression of {max(0.0, compression):.3g}"
        short.append(f"{squeezed}, not with the {until.compression:g} of until.compression")
    if not short:
        return ""
    tools = " and ".join(phase.tools)
    return (
        f"motion[{number}]: its until.time of {until.time:g} s ended it with {', and '.join(short)}: give {tools} more "
        "time, or more speed, or let them begin nearer to the body"
    )


def turned_away(number: int, phase: ClosePhase, told: float, true: float) -> str:
    """What to say of a closing phase whose body turned between its tools, with the remedy; '' where it did not.

    told  compression that the tools' way comes to [1]
    true  that of the body as it stands in the end [1]
    """
    if told - true < max(_TURNED * told, _LEAST_TURNED):
        return ""
    tools = " and ".join(phase.tools)
    return (
        f"motion[{number}] ends at a compression of {told:.3g}, but the body turned between {tools}, "
        f"and is squeezed by some {max(0.0, true):.2g}: turn them with its faces, support it, or end it by until.force"
    )


def fell_short(number: int, tools: Mapping[str, tuple[Floats, Floats]]) -> str:
    """What to say of a phase whose tools were held up on their ways, with the remedy; '' where none was.

    tools  by name, the way that was ordered and what of it a drive left (3,) [m]
    """
    told = []
    for name, (way, short) in tools.items():
        length = float(np.linalg.norm(way))
        lacking = float(short @ way) / length
        if lacking > max(_SHORT * length, _SHORTEST):
            told.append(f"{name} went {1e3 * (length - lacking):.1f} of {1e3 * length:.1f} mm")
    if not told:
        return ""
    return f"motion[{number}]: {' and '.join(told)}, held up at the force_limit: raise it, or move clear of the body"


def left_out(phases: Sequence[Phase], number: int, begun: bool, duration: float) -> str:
    """What to say of a motion that a run's duration [s] ends in, with the remedy.

    number  first phase that is not over
    begun   whether it was begun
    """
    what = f"motion[{number}] is not over" if begun else f"motion[{number}] is not begun"
    later = len(phases) - number - 1
    if later > 0:
        rest = f"motion[{number + 1}]" if later == 1 else f"motion[{number + 1}] to motion[{len(phases) - 1}]"
        what += f", and {rest} not begun" if begun else f", nor {'is' if later == 1 else 'are'} {rest}"
    return f"the duration of {duration:g} s ends before the motion: {what}; give a longer `duration`, or leave it out"
