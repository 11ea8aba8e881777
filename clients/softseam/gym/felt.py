"""What tools feel of a body, over the time of an action."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam.observation import Observation

Floats = NDArray[np.float64]


class Felt(NamedTuple):
    """What k tools feel."""

    wrench: Floats
    """force on each (k, 3) [N]"""
    touching: Floats
    """surface points that touch each (k,)"""

    @classmethod
    def of(cls, observation: Observation, tools: Sequence[str]) -> Felt:
        """At the end of a step."""
        wrench = np.array([observation.wrench[tool][:3] for tool in tools])
        numbers = [observation.tool_names.index(tool) for tool in tools]
        return cls(wrench, np.array([float((observation.contact_tool == number).sum()) for number in numbers]))

    @classmethod
    def nothing(cls, tools: Sequence[str]) -> Felt:
        """Before the first step."""
        return cls(np.zeros((len(tools), 3)), np.zeros(len(tools)))


def mean_of_ends(felt: Sequence[Felt]) -> Felt:
    """Over time, of what was felt at the start and at the ends of steps, by the trapezoidal rule."""
    return Felt(*(np.trapezoid(np.array(each), axis=0) / (len(felt) - 1) for each in zip(*felt, strict=True)))


def mean_of_means(felt: Sequence[Felt]) -> Felt:
    """Over time, of what was felt in each step on the mean."""
    return Felt(*(np.mean(np.array(each), axis=0) for each in zip(*felt, strict=True)))
