"""What can be learned at the command line: a row a task."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from softseam.gym.batch_env import BatchEnv
from softseam.gym.tofu_lift import TofuLift
from softseam.learn.curriculum import COARSE_TO_FINE, Stage

VERSION = 3
"""of what the tasks show and take; a policy of another one cannot be used"""


@dataclass(frozen=True)
class Task:
    """An environment, and the rules that a policy is measured against."""

    make: type[TofuLift]
    batch: type[BatchEnv]
    """many of it, by XPBD"""
    steps: int
    """that learning takes by default"""
    rules: dict[str, Callable[[dict[str, Any]], list[float]]]
    """actions from `info`, which policies do not see, by name"""
    stages: tuple[Stage, ...]
    """of a training by XPBD"""


def _pressed(newton: float) -> Callable[[dict[str, Any]], list[float]]:
    return lambda info: [0.4, 0.0] if info["grip_force"] < newton else [0.0, 0.6]


def _squeezed(share: float) -> Callable[[dict[str, Any]], list[float]]:
    return lambda info: [0.4, 0.0] if info["compression"] < share else [0.0, 0.6]


TASKS = {
    "TofuLift": Task(
        TofuLift,
        BatchEnv,
        300_000,
        {"close to 1 N": _pressed(1.0), "close to 2 N": _pressed(2.0), "squeeze by 15 %": _squeezed(0.15)},
        COARSE_TO_FINE,
    )
}
