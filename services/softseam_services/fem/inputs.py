"""What a step takes besides structure, parameters and state, and what it comes to, for the kernels."""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.jit import record

from .tool_motion import Tools

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
