"""Sleep: which bodies may rest, and what wakes them.

A body sleeps while the rule that its scene names lets it and nothing gives a reason to wake. What sleeps stays where
it is, with the forces that hold it there, and is asked for nothing; to what touches it, it is an obstacle.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.table import Table

__all__ = ["SLEEP", "TOLERANCES", "WAKE", "Neighbourhood", "Reasons", "Tolerance"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Tolerance:
    """How still a body is while it is calm, or sleeps."""

    speed: float
    """below which every node of it is calm [m/s]"""
    force: float
    """by which what presses on it changes [1]"""
    of_load: bool
    """of its load, not of its weight, see `Neighbourhood`"""
    steps: int
    """that it is calm before it sleeps"""


STRICT = Tolerance(2e-3, 0.01, False, 8)
"""of rules that `TOLERANCES` does not name"""
TOLERANCES: dict[str, Tolerance] = {"by_load": Tolerance(4e-3, 0.05, True, 4)}
"""of rules of sleep, by their names"""


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
    way: Floats
    """by how much these went in the last step, lower and upper ones, of those that are awake (b, 2, 3) [m]"""
    weight: Floats
    """(b,) [N]"""
    load: Floats
    """sizes of what tools and other bodies press each with, added up, as it fell asleep or became calm, and at least
    its weight (b,) [N]"""
    calm_steps: Ints
    """steps in a row in which each was calm, and pressed as in the first of them, to the tolerance (b,)"""
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
    half: Floats
    """halves of the edges, along x, y and z, of a box about it that does (t, 3) [m]"""
    moving: Mask
    """whether it moves in the step at hand (t,)"""
    dt: float
    """length of a step [s]"""
    tolerance: Tolerance
    """of the rule that the scene names"""

    @property
    def allowed(self) -> Floats:
        """By how much what presses each may change while it is calm, or sleeps (b,) [N]."""
        return self.tolerance.force * (self.load if self.tolerance.of_load else self.weight)


Reasons = Mapping[int, str]
"""in words, by the numbers of the bodies that have one"""


def calm(around: Neighbourhood) -> Mask:
    """Let what was calm for some steps sleep."""
    return np.asarray(around.calm_steps >= around.tolerance.steps)


def tool_comes(around: Neighbourhood) -> Reasons:
    """Wake what a moving tool will be near as the step ends: the ball and the box that hold it meet the body's box."""
    found: dict[int, str] = {}
    for tool in np.flatnonzero(around.moving).tolist():
        position, half = around.position[tool], around.half[tool]
        gap = np.maximum(around.low - position, position - around.high)
        away = np.maximum(gap, 0.0)
        near = ((away * away).sum(axis=1) < around.reach[tool] ** 2) & (gap < half).all(axis=1)
        for body in np.flatnonzero(near).tolist():
            found.setdefault(body, f"{around.tools[tool]} moves near {around.names[body]}")
    return found


def neighbour_comes(around: Neighbourhood) -> Reasons:
    """Wake what a body that is awake and not calm comes to within the step, if it goes on: their boxes are apart now,
    and will not be. What presses already, or comes sooner than its box shows, is felt in the step."""
    found: dict[int, str] = {}
    moves = ~around.asleep & (around.speed >= around.tolerance.speed)
    if not moves.any():
        return found
    low, high, way = around.low + around.way[:, 0], around.high + around.way[:, 1], np.abs(around.way).max(axis=(1, 2))
    for side in (0, 1):
        own, other = around.pairs[:, side], around.pairs[:, 1 - side]
        may = np.flatnonzero(moves[other])
        own, other = own[may], other[may]
        apart = np.maximum(around.low[own] - around.high[other], around.low[other] - around.high[own]).max(axis=1)
        near = np.flatnonzero((apart > 0.0) & (apart <= way[own] + way[other]))
        own, other = own[near], other[near]
        later = np.maximum(low[own] - high[other], low[other] - high[own]).max(axis=1)
        for pair in np.flatnonzero(later <= 0.0).tolist():
            found.setdefault(int(own[pair]), f"{around.names[other[pair]]} moves beside {around.names[own[pair]]}")
    return found


def force_changed(around: Neighbourhood) -> Reasons:
    """Wake what others press otherwise than as it fell asleep, by more than is allowed."""
    moved = np.flatnonzero(around.asleep & (around.changed > around.allowed))
    return {
        body: f"what presses {around.names[body]} changed by {around.changed[body]:.2g} N" for body in moved.tolist()
    }


SLEEP: Table[Callable[[Neighbourhood], Mask]] = Table("rules of sleep", {"calm": calm, "by_load": calm})
"""which bodies may sleep (b,); a scene names one"""
WAKE: Table[Callable[[Neighbourhood], Reasons]] = Table(
    "reasons to wake",
    {"tool_comes": tool_comes, "neighbour_comes": neighbour_comes, "force_changed": force_changed},
)
"""why bodies wake, or do not fall asleep; those that are left out may sleep on"""
