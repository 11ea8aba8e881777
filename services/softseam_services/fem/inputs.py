"""What acts on a region over a step, as a request says it and as kernels take it, and what the step comes to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Advance, ToolMotion
from softseam_services.body.body import Floats
from softseam_services.jit import record
from softseam_services.tools.tool_set import ToolSet

from . import substeps

NO_PUSH = np.zeros((0, 3))


@record
class Inputs(NamedTuple):
    """Of one step (s seam nodes)."""

    dt: float
    """[s]"""
    tools: Tools
    """over the step"""
    seam_force: Floats
    """on the seam nodes (s, 3) [N]"""
    past: float
    """as of `FemState`; of statics, the share of the load that is borne when the step ends"""
    pace: float = 1.0
    """share of a penetration and of an offset at the start that the step takes out, 1 but for parts of a step; see
    kernels/contact.py"""
    push: Floats = NO_PUSH
    """of a correction: the force that the step is moved on by (s, 3) [N]"""


@record
class NewtonSettings(NamedTuple):
    """How a step is iterated, see `kernels.newton`."""

    tolerance: float
    """[m]"""
    most: int
    """iterations"""
    careful: bool
    """a new, positive semi-definite matrix every time, and short steps along it"""


@record
class Result(NamedTuple):
    """What a step came to, beside the state at its end (c cells, s seam nodes, t tools). Overwritten by the next."""

    out: Floats
    """energies, momenta and counts, in the places of `kernels.step` (N_OUT,)"""
    wrench: Floats
    """on the body (t, 6) [N, N m]"""
    seam_x: Floats
    """(s, 3) [m]"""
    distance: Floats
    """of each cell from the nearest tool (c,) [m]"""
    compliance: Floats
    """d(seam_x)/d(seam force), where it was asked for (3s, 3s) [m/N]"""


def build_result(n_cells: int, n_seam: int, n_tools: int, n_out: int) -> Result:
    """Of a step not taken yet."""
    return Result(
        out=np.zeros(n_out),
        wrench=np.zeros((n_tools, 6)),
        seam_x=np.zeros((n_seam, 3)),
        distance=np.zeros(n_cells),
        compliance=np.zeros((3 * n_seam, 3 * n_seam)),
    )


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


NO_TURN = np.zeros(0)
AT_ONCE = substeps.Substeps(n_accepted=1)
"""what a step takes as a rule"""


class StepInputs(NamedTuple):
    """What acts on a region over one step, but for its length (s seam nodes); the seam as of `Advance`."""

    tools: Tools
    seam_force: Floats
    """(s, 3) [N]"""
    seam_force_start: Floats
    """(s, 3) [N], (0, 3) where the force is constant"""
    seam_target: Floats
    """(s, 3) [m], (0, 3) where nothing beyond the seam resists"""
    seam_impedance: Floats
    """(3s, 3s) [N/m], (0, 0) where it is as before"""
    parts: int = 1
    """that the tools' way asks for, a power of 2"""
    turn: Floats = NO_TURN
    """of the whole body, where it is in several parts, as of `Advance`"""

    @classmethod
    def of(cls, request: Advance, tools: Tools, parts: int = 1) -> StepInputs:
        """What a request says, with the tools over the step, which is taken in so many parts at least."""
        sent = request.coupling_force, request.coupling_force_start, request.coupling_target, request.coupling_impedance
        return cls(tools, *sent, parts, request.turn)

    def part(self, number: int) -> StepInputs:
        """What acts over one of the parts, whose seam the other side does not follow."""
        first, last = number / self.parts, (number + 1) / self.parts
        start, force = self.seam_force_start, self.seam_force
        if len(start):
            start, force = (start + share * (force - start) for share in (first, last))
        return StepInputs(part_of(self.tools, first, last), force, start, self.seam_target[:0], self.seam_impedance)


class StepResult(NamedTuple):
    """What a step came to, beside the state at its end."""

    status: int
    """of `kernels.newton`; the rest is valid where it is CONVERGED"""
    arrays: Result
    """overwritten by the next step"""
    substeps: substeps.Substeps
    """what it took to get through"""
