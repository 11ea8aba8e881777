"""Islands: what interfaces join, directly or by others, and nothing else; when they sleep, and what wakes them.

An island sleeps while the rule that its scene names lets it and nothing gives a reason to wake. What sleeps stays where
it is, with the forces that hold it there, and is asked for nothing.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.table import Table

__all__ = ["SLEEP", "WAKE", "Island", "islands_of"]

Floats = NDArray[np.float64]

CALM = 1e-3
"""root mean square speed below which an island is calm [m/s]"""
_CALM_STEPS = 8
"""that an island is calm before it sleeps"""


@dataclass(frozen=True)
class Island:
    """What rules of sleep look at."""

    kinetic: float
    """kinetic energy of all its bodies [J]"""
    mass: float
    """[kg]"""
    calm_steps: int
    """steps in a row that it was slower than `CALM`"""
    bounds: Mapping[str, Floats]
    """lower and upper corner of each body's box, by name (2, 3) [m]"""
    tools: Mapping[str, Floats]
    """where each tool will be as the step at hand ends, by name (3,) [m]"""
    reach: Mapping[str, float]
    """radius of a ball about each tool that holds it, infinite for a plane [m]"""
    moving: frozenset[str]
    """tools that move in the step at hand"""

    @property
    def speed(self) -> float:
        """Root mean square [m/s]."""
        return math.sqrt(2.0 * self.kinetic / self.mass)


def calm(island: Island) -> bool:
    """Let what was calm for some steps sleep."""
    return island.calm_steps >= _CALM_STEPS


def tool_comes(island: Island) -> str:
    """Wake what a moving tool will be near as the step ends: the ball that holds it meets a body's box."""
    for tool in island.moving:
        for body, (low, high) in island.bounds.items():
            position = island.tools[tool]
            away = float(np.linalg.norm(np.maximum(np.maximum(low - position, position - high), 0.0)))
            if away < island.reach[tool]:
                return f"{tool} moves near {body}"
    return ""


SLEEP: Table[Callable[[Island], bool]] = Table("rules of sleep", {"calm": calm})
"""whether an island may sleep; a scene names one"""
WAKE: Table[Callable[[Island], str]] = Table("reasons to wake", {"tool_comes": tool_comes})
"""why an island wakes, or does not fall asleep; '' where it may sleep on"""


def islands_of(names: Iterable[str], joined: Iterable[tuple[str, str]]) -> list[tuple[str, ...]]:
    """Names that pairs join, each in one island; islands and what is in them in the order of the names.

    Each name points at an earlier one of its island, or at itself (Tarjan, J. ACM 22, 1975, 215-225). Raises KeyError
    for a pair with a name that is not there.
    """
    first = {name: name for name in names}

    def root(name: str) -> str:
        while first[name] != name:
            first[name] = first[first[name]]
            name = first[name]
        return name

    order = {name: place for place, name in enumerate(first)}
    for a, b in joined:
        one, other = sorted((root(a), root(b)), key=order.__getitem__)
        first[other] = one
    found: dict[str, list[str]] = {}
    for name in first:
        found.setdefault(root(name), []).append(name)
    return [tuple(island) for island in found.values()]
