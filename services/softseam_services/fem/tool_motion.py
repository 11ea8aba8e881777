"""The tools as kernels see them: over a step, and over a part of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import ToolMotion
from softseam_services.body.body import Floats
from softseam_services.jit import record
from softseam_services.tools.tool_set import ToolSet


@record
class Tools(NamedTuple):
    """Tools over one step (t tools), for the kernels."""

    kind: NDArray[np.int64]
    shape: Floats
    reach: Floats
    half_width: Floats
    bends: Floats
    places: NDArray[np.int64]
    followed: NDArray[np.bool_]
    position: Floats
    orientation: Floats
    position_next: Floats
    orientation_next: Floats


def at_rest(tools: ToolSet) -> Tools:
    """Tools with poses of zeros, to be set by `moved`."""
    poses = (np.zeros((len(tools.names), width)) for width in (3, 4, 3, 4))
    shapes = tools.kind, tools.shape, tools.reach, tools.half_width, tools.bends, tools.places
    return Tools(*shapes, tools.followed, *poses)


def moved(whole: Tools, motion: ToolMotion) -> Tools:
    """The tools over a step; the arrays are the same in every step."""
    whole.position[:], whole.orientation[:] = motion.position, motion.orientation
    whole.position_next[:], whole.orientation_next[:] = motion.position_next, motion.orientation_next
    return whole


def part_of(whole: Tools, first: float, last: float) -> Tools:
    """The tools' motion between two fractions of the step; turns are interpolated along the shorter way."""
    if last - first == 1.0:
        return whole
    travel = whole.position_next - whole.position
    turn = np.where(
        np.sum(whole.orientation * whole.orientation_next, axis=1, keepdims=True) < 0.0,
        -whole.orientation_next,
        whole.orientation_next,
    )
    turns = [whole.orientation + f * (turn - whole.orientation) for f in (first, last)]
    unit = [q / np.linalg.norm(q, axis=1, keepdims=True) for q in turns]
    return whole._replace(
        position=whole.position + first * travel,
        position_next=whole.position + last * travel,
        orientation=unit[0],
        orientation_next=unit[1],
    )
