"""A plan: what it has to reach, what was chosen and from what, as it is kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np

from softseam.study.measure import Status


@dataclass(frozen=True)
class Goal:
    """What a plan has to reach."""

    tolerance: float
    """largest error of any quantity, L2 over time and relative [1]"""
    rtf: float = 0.0
    """least real-time factor, 0 for any"""
    harder: float = 1.0
    """how many times as large errors of mesh and model are in the motion to plan for as in the scene's own [1]"""


@dataclass(frozen=True)
class Tried:
    """A configuration that was to be run, and what became of it."""

    label: str
    settings: tuple[str, ...]
    rtf: float
    error: float
    """its worst error, the reference's counted in: infinite where it failed [1]"""
    decided_by: str
    """the quantity that is worst, or why it failed"""
    estimate: float = 0.0
    """what the run itself estimated that it is off by, 0 where it could not [1]"""
    status: Status = "done"
    differs: float = float("inf")
    """what it differs from the reference by in the worst quantity, whatever that may be off by [1]"""

    @property
    def was_run(self) -> bool:
        """To its end, or until it failed."""
        return self.status in ("done", "failed")

    @property
    def was_late(self) -> bool:
        """Whether there was no time for it, or not enough."""
        return self.status in ("left out", "stopped")


@dataclass(frozen=True)
class Plan:
    """What was chosen, and from what."""

    goal: Goal
    choice: Tried
    tried: tuple[Tried, ...]
    uncertainty: float
    """of the reference [1]"""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """quantities that do not count, and why"""
    truth: str = ""
    """where the reference comes from, as a predicate"""
    vague: bool = False
    """whether the reference was to be known better, and was not"""
    minutes: float = 0.0
    """that the search was given"""

    @property
    def is_sure(self) -> bool:
        """Whether the choice is accurate enough with all that the reference may be off by."""
        return self.choice.error <= self.goal.tolerance

    @property
    def off(self) -> float:
        """What the choice is off by, as it was judged: with what the reference may be off by where that is sure [1]."""
        return self.choice.error if self.is_sure else self.choice.differs

    @property
    def n_run(self) -> int:
        """Configurations that were run."""
        return sum(one.was_run for one in self.tried)

    @property
    def n_late(self) -> int:
        """Configurations that might be faster, and had no time."""
        return sum(one.was_late for one in self.tried)

    def holds_for(self, minutes: float) -> bool:
        """Whether a search of so many minutes can find nothing else: nothing lacked time, or they are no more."""
        return minutes <= self.minutes or not (self.n_late or self.vague)

    def as_json(self) -> dict[str, Any]:
        return {
            "tolerance": self.goal.tolerance,
            "rtf": self.goal.rtf,
            "harder": self.goal.harder,
            "uncertainty": self.uncertainty,
            "left_out": dict(self.left_out),
            "truth": self.truth,
            "vague": self.vague,
            "minutes": self.minutes,
            "choice": self.tried.index(self.choice),
            "tried": [
                vars(one)
                | {"settings": list(one.settings), "error": _finite(one.error), "differs": _finite(one.differs)}
                for one in self.tried
            ],
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Plan:
        """Raises KeyError, TypeError, ValueError or IndexError where the data are no plan.

        A plan that was kept before plans said so lacked no time.
        """
        tried = tuple(
            Tried(
                str(one["label"]),
                tuple(map(str, one["settings"])),
                float(one["rtf"]),
                _number(one["error"]),
                str(one["decided_by"]),
                float(one.get("estimate", 0.0)),
                _status(one.get("status", "done")),
                _number(one.get("differs")),
            )
            for one in data["tried"]
        )
        goal = Goal(float(data["tolerance"]), float(data["rtf"]), float(data.get("harder", 1.0)))
        left_out = {str(name): str(why) for name, why in dict(data.get("left_out", {})).items()}
        choice, uncertainty = tried[int(data["choice"])], float(data["uncertainty"])
        truth, vague, minutes = data.get("truth", ""), data.get("vague", False), data.get("minutes", 0.0)
        return cls(goal, choice, tried, uncertainty, left_out, str(truth), bool(vague), float(minutes))


def _status(text: str) -> Status:
    known: tuple[Status, ...] = get_args(Status)
    for status in known:
        if status == text:
            return status
    raise ValueError(f"no status is called {text!r}")


def _number(value: float | None) -> float:
    return float("inf") if value is None else float(value)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
