"""Fixed rules that policies are measured against: actions from what is seen, or from `info`, which no policy sees."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from softseam.gym import push_gentle, towel_fold
from softseam.gym.scene_env import Numbers
from softseam.gym.task_env import ACT
from softseam.gym.towel_fold import TowelFold

Rule = Callable[[Numbers, dict[str, Any]], list[float]]


def pressed(newton: float) -> Rule:
    """Of a lift: close until the pads press with so much, then rise."""
    return lambda seen, info: [0.4, 0.0] if info["grip_force"] < newton else [0.0, 0.6]


def squeezed(share: float) -> Rule:
    """Of a lift: close until the body is squeezed by so much, then rise."""
    return lambda seen, info: [0.4, 0.0] if info["compression"] < share else [0.0, 0.6]


def pushed(speed: float) -> Rule:
    """Of a push: ahead until something is touched, then along the line to the target; speed in parts of full speed."""

    def rule(seen: Numbers, info: dict[str, Any]) -> list[float]:
        now = dict(zip(push_gentle.SEEN, seen.tolist(), strict=True))
        if now["finger in contact"] == 0.0 and now["force ahead"] == 0.0:
            return [speed, 0.0]
        ahead, aside = 0.05 * now["target ahead of the marker"], 0.01 * now["target aside of it"]
        return [speed, 6.0 * speed * min(max(aside / max(ahead, push_gentle.NEAR), -0.5), 0.5)]

    return rule


def folded(actions: int) -> Rule:
    """Of a fold: half of a circle to the other edge in so many actions, then down to where the corners belong."""
    reach = TowelFold.speed * ACT / _EDGE

    def rule(seen: Numbers, info: dict[str, Any]) -> list[float]:
        taken = round(float(seen[-1]) * towel_fold.STEPS) + 1
        ways, to_go = seen[:6].astype(np.float64), seen[12:18].astype(np.float64)
        angle = math.pi * taken / actions
        goal = np.array([0.5 * (math.cos(angle) - 1.0), 0.0, 0.42 * math.sin(angle)] * 2)
        if taken > actions:
            goal = ways + 0.5 * to_go
        found: list[float] = ((goal - ways) / reach).tolist()
        return found

    return rule


_EDGE = 0.5
"""of the towel [m]"""
