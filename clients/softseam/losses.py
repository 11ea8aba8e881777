"""Losses: numbers that are read off a run, with their derivatives by its forces and positions.

A loss is any function `loss(run: Run) -> tuple[float, Slope]`; those here cover the usual ones, and add up.

>>> from softseam.losses import displacement, tool_force, total
>>> push = tool_force("left", [1.0, 0.0, 0.0])              # sum over steps of the force along x [N]
>>> rise = displacement([0.0, 0.0, -10.0], at=(0, 0, 0.05))  # and of minus ten times the way up of the top [m]
>>> loss = total(push, rise)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softseam.errors import BadInput, UnknownTool

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """What a loss may be read off: s steps of a body with n nodes. Arrays are read-only."""

    time: Floats
    """as each step ends (s,) [s]"""
    force: Mapping[str, Floats]
    """of the body on each tool as each step ends (s, 3) [N]"""
    positions: Floats
    """of the nodes as each step ends (s, n, 3) [m]"""
    start: Floats
    """of the nodes before the first step (n, 3) [m]"""
    tool_positions: Mapping[str, Floats]
    """of each tool as each step ends (s, 3) [m]"""


@dataclass(frozen=True)
class Slope:
    """Derivatives of a loss; what is left out is zero."""

    force: Mapping[str, Floats] = field(default_factory=dict)
    """by the force on each tool as each step ends (s, 3) [1/N]"""
    positions: Floats | None = None
    """by the positions of the nodes as each step ends (s, n, 3) [1/m]"""
    start: Floats | None = None
    """and before the first (n, 3) [1/m]"""


Loss = Callable[[Run], tuple[float, Slope]]


def tool_force(tool: str, weight: ArrayLike) -> Loss:
    """Sum over steps of weight . force of the body on a tool; weight (3,) alike in all steps, or (s, 3) [1/N].

    The loss raises UnknownTool, and BadInput for a weight of another shape.
    """

    def loss(run: Run) -> tuple[float, Slope]:
        if tool not in run.force:
            raise UnknownTool(f"the loss is of a tool {tool!r}; the scene has: {', '.join(run.force) or 'none'}")
        by_step = _by_step(weight, len(run.time), f"the loss of {tool!r}")
        return float(np.sum(by_step * run.force[tool])), Slope({tool: by_step})

    return loss


def displacement(weight: ArrayLike, *, nodes: Sequence[int] | None = None, at: Sequence[float] | None = None) -> Loss:
    """Sum over steps of weight . mean displacement of nodes since the start; weight (3,) or (s, 3) [1/m].

    nodes  their numbers, as in `Observation.positions`; all where neither is given
    at     in place of nodes: the one that is nearest to this place at the start, as a marker (3,) [m]
    The loss raises BadInput for nodes that are none, and for a weight of another shape.
    """
    if nodes is not None and at is not None:
        raise BadInput("a displacement is of `nodes`, or of the node `at` a place, not of both")

    def loss(run: Run) -> tuple[float, Slope]:
        by_step, n_nodes = _by_step(weight, len(run.time), "the loss of a displacement"), len(run.start)
        own = np.arange(n_nodes) if nodes is None else np.asarray(nodes, dtype=np.int64).ravel()
        if at is not None:
            own = np.array([np.argmin(np.linalg.norm(run.start - np.asarray(at, dtype=np.float64), axis=1))])
        if not len(own) or own.min() < 0 or own.max() >= n_nodes:
            raise BadInput(
                f"the loss of a displacement is of nodes {list(own)}: the body has those from 0 to {n_nodes - 1}"
            )
        away = run.positions[:, own].mean(axis=1) - run.start[own].mean(axis=0)
        share = np.bincount(own, minlength=n_nodes)[:, None] / len(own)
        slope = share * by_step[:, None, :]
        start = -share * by_step.sum(axis=0)
        return float(np.sum(by_step * away)), Slope(positions=slope, start=start)

    return loss


def total(*losses: Loss) -> Loss:
    """The sum of several."""

    def loss(run: Run) -> tuple[float, Slope]:
        value = 0.0
        force: dict[str, Floats] = {}
        positions, start = np.zeros_like(run.positions), np.zeros_like(run.start)
        for one in losses:
            more, slope = one(run)
            value += more
            for tool, by_force in slope.force.items():
                force[tool] = force.get(tool, 0.0) + by_force
            positions += 0.0 if slope.positions is None else slope.positions
            start += 0.0 if slope.start is None else slope.start
        return value, Slope(force, positions, start)

    return loss


def _by_step(weight: ArrayLike, n_steps: int, whose: str) -> Floats:
    """A weight (3,) or (s, 3) as (s, 3). Raises BadInput."""
    given = np.asarray(weight, dtype=np.float64)
    if given.shape not in ((3,), (n_steps, 3)) or not np.isfinite(given).all():
        raise BadInput(
            f"{whose} has a weight of shape {given.shape}: give three finite numbers, or {n_steps} times three"
        )
    return np.broadcast_to(given, (n_steps, 3)).copy()
