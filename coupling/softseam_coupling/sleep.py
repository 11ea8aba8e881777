"""Sleep: which bodies may rest, and what wakes them.

A body sleeps while the rule that its scene names lets it and nothing gives a reason to wake. What sleeps stays where
it is, with the forces that hold it there, and is asked for nothing; to what touches it, it is an obstacle.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.table import Table

__all__ = ["SLEEP", "WAKE", "Neighbourhood", "Reasons"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

CALM = 2e-3
"""speed below which every node of a body is calm [m/s]"""
_CALM_STEPS = 8
"""that a body is calm before it sleeps"""
STEADY = 0.01
"""of its weight by which what presses on a body may change while it is calm, or sleeps [1]"""


@dataclass(frozen=True)
class Neighbourhood:
    """What rules of sleep look at: b bodies, of which m pairs may touch, and t tools."""

    names: Sequence[str]
    """of the bodies"""
    kinetic: Floats
    """kinetic energies (b,) [J]"""
    speed: Floats
    """of each body's fastest node (b,) [m/s]"""
    low: Floats
    """lower corners of their boxes (b, 3) [m]"""
    high: Floats
    """and upper ones"""
    weight: Floats
    """(b,) [N]"""
    calm_steps: Ints
    """steps in a row in which each was slower than `CALM`, and pressed as in the first of them to `STEADY` (b,)"""
    asleep: Mask
    """(b,)"""
    pairs: Ints
    """bodies that contact may bring together within a pile (m, 2)"""
    changed: Floats
    """by how much what others press each body with changed since it fell asleep, or is calm, all contacts added up
    (b,) [N]"""
    tools: Sequence[str]
    """names of the tools"""
    position: Floats
    """where each tool will be as the step at hand ends (t, 3) [m]"""
    reach: Floats
    """radius of a ball about each tool that holds it, infinite for a plane (t,) [m]"""
    moving: Mask
    """whether it moves in the step at hand (t,)"""
    dt: float
    """length of a step [s]"""


Reasons = Mapping[int, str]
"""in words, by the numbers of the bodies that have one"""


def calm(around: Neighbourhood) -> Mask:
    """Let what was calm for some steps sleep."""
    return np.asarray(around.calm_steps >= _CALM_STEPS)


def tool_comes(around: Neighbourhood) -> Reasons:
    """Wake what a moving tool will be near as the step ends: the ball that holds it meets the body's box."""
    found: dict[int, str] = {}
    for tool in np.flatnonzero(around.moving).tolist():
        position = around.position[tool]
        away = np.maximum(np.maximum(around.low - position, position - around.high), 0.0)
        near = np.flatnonzero((away * away).sum(axis=1) < around.reach[tool] ** 2)
        for body in near.tolist():
            found.setdefault(body, f"{around.tools[tool]} moves near {around.names[body]}")
    return found


def neighbour_comes(around: Neighbourhood) -> Reasons:
    """Wake what a body that is awake and not calm may press within the step: their boxes are as near as it is fast."""
    found: dict[int, str] = {}
    moves = ~around.asleep & (around.speed >= CALM)
    for side in (0, 1):
        own, other = around.pairs[:, side], around.pairs[:, 1 - side]
        may = np.flatnonzero(moves[other])
        own, other = own[may], other[may]
        apart = np.maximum(around.low[own] - around.high[other], around.low[other] - around.high[own]).max(axis=1)
        for pair in np.flatnonzero(apart <= around.speed[other] * around.dt).tolist():
            found.setdefault(int(own[pair]), f"{around.names[other[pair]]} moves beside {around.names[own[pair]]}")
    return found


def force_changed(around: Neighbourhood) -> Reasons:
    """Wake what others press otherwise than as it fell asleep, by more than a hundredth of its weight."""
    moved = np.flatnonzero(around.asleep & (around.changed > STEADY * around.weight))
    return {
        body: f"what presses {around.names[body]} changed by {around.changed[body]:.2g} N" for body in moved.tolist()
    }


SLEEP: Table[Callable[[Neighbourhood], Mask]] = Table("rules of sleep", {"calm": calm})
"""which bodies may sleep (b,); a scene names one"""
WAKE: Table[Callable[[Neighbourhood], Reasons]] = Table(
    "reasons to wake",
    {"tool_comes": tool_comes, "neighbour_comes": neighbour_comes, "force_changed": force_changed},
)
"""why bodies wake, or do not fall asleep; those that are left out may sleep on"""
