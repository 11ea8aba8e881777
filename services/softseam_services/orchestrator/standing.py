"""What tools carry of bodies that sleep: what is lacking to their weights goes down to the tools that hold them.

A body that falls asleep still swings a little, and forces on it are off its weight by mass times acceleration. As it
stands they cannot be. What each lacks upwards, l_i, goes through its contacts in proportion to what these carry, c_ij
between two that sleep and c_i by tools, as currents go through resistors:

    sum_j c_ij (u_i - u_j) + c_i u_i = l_i                                                                         (1)

and tools carry c_i u_i more of each body.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.loop import Outcome

Floats = NDArray[np.float64]


def passed_down(lacks: Floats, pairs: NDArray[np.int64], carried: Floats, by_tools: Floats) -> Floats:
    """u of eq. (1) (b,) [1]; 0 of bodies that no tool carries, by way of others neither.

    lacks     upwards, of each body (b,) [N]
    pairs     of bodies (m, 2)
    carried   upwards or downwards between these (m,) [N]
    by_tools  upwards, of each body (b,) [N]
    """
    b = len(lacks)
    matrix = np.zeros((b, b))
    one, other = pairs[:, 0], pairs[:, 1]
    np.add.at(matrix, (one, other), -carried)
    matrix += matrix.T
    held = by_tools > 0.0
    while (more := held | (matrix[:, held] < 0.0).any(axis=1)).sum() > held.sum():
        held = more
    rows = np.flatnonzero(held)
    own = matrix[np.ix_(rows, rows)]
    own[np.arange(len(rows)), np.arange(len(rows))] = by_tools[rows] - own.sum(axis=1)
    found = np.zeros(b)
    found[rows] = np.linalg.solve(own, lacks[rows])
    return found


def with_more(wrench: Floats, force: Floats) -> Floats:
    """Wrenches (..., 6) [N, N m] with more force (..., 3) [N] on the line on which each acts."""
    old, torque = wrench[..., :3], wrench[..., 3:]
    square = np.einsum("...c,...c->...", old, old)[..., None]
    arm = np.divide(np.cross(old, torque), square, out=np.zeros_like(old), where=square > 0.0)
    return np.concatenate([old + force, torque + np.cross(arm, force)], axis=-1)


def standing_on_tools(outcome: Outcome, weight: Floats) -> Outcome:
    """Of a body of this weight (3,) [N] that only tools hold: as they carry it while it stands."""
    size, replies = float(np.sqrt(weight @ weight)), outcome.replies
    wrenches = np.array([reply.wrench for reply in replies.values()])
    lifts = -wrenches[..., :3] @ -weight / size if size else np.zeros(0)
    holds = np.maximum(lifts, 0.0)
    if not holds.any():
        return outcome
    more = (size - float(lifts.sum())) / float(holds.sum())
    stands = with_more(wrenches, more * holds[..., None] * weight / size)
    changed = {part: replace(replies[part], wrench=own) for part, own in zip(replies, stands, strict=True)}
    return replace(outcome, replies=changed)
