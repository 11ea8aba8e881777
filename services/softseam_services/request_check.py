"""What makes a request impossible to serve: the same words from every participant, before a kernel reads it."""

import math

import numpy as np

from softseam_protocol.messages.participant import Advance, Correct
from softseam_services.tools.kernels import all_finite


def problem_of(request: Advance, n_tools: int, n_seam: int) -> str:
    """What is wrong with the step's length, the tools' poses or the seam force; '' where nothing is."""
    motion, force = request.tools, request.coupling_force
    if not (math.isfinite(request.dt) and request.dt > 0.0):
        return f"the time step is {request.dt} s: not finite, or not positive"
    if force.shape != (n_seam, 3):
        return f"the seam force has shape {force.shape}, this region's seam needs ({n_seam}, 3)"
    poses = (motion.position, motion.orientation, motion.position_next, motion.orientation_next)
    for pose, width in zip(poses, (3, 4, 3, 4), strict=True):
        if pose.shape != (n_tools, width):
            return f"tool poses of {n_tools} tools have shape ({n_tools}, {width}), not {pose.shape}"
    start = request.coupling_force_start
    if start.shape not in ((0, 3), (n_seam, 3)):
        return f"the seam force at the step's start has shape {start.shape}, this region's seam needs ({n_seam}, 3)"
    if len(start) and len(request.coupling_target):
        return "a seam force that is linear in time beside an anchor: send one of the two"
    asked = request.coupling_asked
    if len(asked) and (asked[0] < 0 or asked[-1] >= n_seam or (np.diff(asked) <= 0).any()):
        return f"the nodes whose answers are asked for are no ascending places among {n_seam} coupling nodes"
    if len(request.turn) and (request.turn.shape != (22,) or not np.isfinite(request.turn).all()):
        return "the turn of the whole body is 22 finite numbers, or none"
    if not all_finite(*poses, force) or (len(start) and not np.isfinite(start).all()):
        if not (np.isfinite(force).all() and np.isfinite(start).all()):
            return "the seam force is not finite: the seam solver must send finite multipliers"
        return "tool poses are not finite: they hold NaN or infinity"
    return ""


def problem_of_correction(request: Correct, n_seam: int) -> str:
    """What is wrong with the forces that a step is moved on by; '' where nothing is."""
    push, force = request.push, request.force
    if push.shape != (n_seam, 3) or force.shape != (n_seam, 3):
        return f"a correction of this region's seam has shape ({n_seam}, 3)"
    if not (np.isfinite(push).all() and np.isfinite(force).all()):
        return "the correction is not finite: the coupling must send finite forces"
    return ""


def problem_of_target(request: Advance, n_seam: int, knows_impedance: bool) -> str:
    """What is wrong with how the other side of the seam is said to resist, or ''; `knows_impedance`: from before."""
    anchor, stiffness = request.coupling_target, request.coupling_impedance
    if not len(anchor):
        return ""
    n = 3 * n_seam
    if anchor.shape != (n_seam, 3) or stiffness.shape not in ((n, n), (0, 0)):
        return f"a seam anchor ({n_seam}, 3) needs a stiffness ({n}, {n}) beside it, or none"
    if not stiffness.size and not knows_impedance:
        return "a seam anchor without a stiffness, and none came since the last snapshot: send it again"
    if not (np.isfinite(anchor).all() and np.isfinite(stiffness).all()):
        return "the seam's anchor or stiffness is not finite"
    return ""
