"""A plan: what it has to reach, what was chosen and from what, as it is stored."""

from pydantic import BaseModel, ConfigDict

from softseam_studies.study.measure import Status


class _Stored(BaseModel):
    model_config = ConfigDict(frozen=True)


class Goal(_Stored):
    """What a plan has to reach."""

    tolerance: float
    """largest error of any quantity, L2 over time and relative [1]"""
    rtf: float = 0.0
    """least real-time factor, 0 for any"""
    load_factor: float = 1.0
    """how many times as large errors of mesh and model are in the motion to plan for as in the scene's own [1]"""


class Tried(_Stored):
    """A configuration that was to be run, and what became of it."""

    label: str
    settings: tuple[str, ...]
    rtf: float = 0.0
    error: float | None = None
    """its worst error, the reference's counted in; None where it was not run to its end [1]"""
    differs: float | None = None
    """what it differs from the reference by in the worst quantity, whatever that may be off by [1]"""
    decided_by: str
    """the quantity that is worst, or why there is no error"""
    estimate: float = 0.0
    """what the run itself estimated that it is off by, 0 where it could not [1]"""
    status: Status = "done"

    def within(self, tolerance: float) -> bool:
        """Whether it differs from the reference by no more."""
        return self.differs is not None and self.differs <= tolerance

    def surely_within(self, tolerance: float) -> bool:
        """The same with all that the reference may be off by."""
        return self.error is not None and self.error <= tolerance


class Plan(_Stored):
    """What was chosen, and from what."""

    goal: Goal
    choice: Tried
    tried: tuple[Tried, ...]
    left_out: dict[str, str] = {}
    """quantities that do not count, and why"""
    truth: str = ""
    """where the reference comes from, as a predicate"""
    minutes: float = 0.0
    """that the search was given"""

    @property
    def is_sure(self) -> bool:
        """Whether the choice is accurate enough with all that the reference may be off by."""
        return self.choice.surely_within(self.goal.tolerance)

    @property
    def off(self) -> float:
        """What the choice is off by, as it was judged: with what the reference may be off by where that is sure [1]."""
        found = self.choice.error if self.is_sure else self.choice.differs
        assert found is not None
        return found

    @property
    def n_run(self) -> int:
        """Configurations that were run, to their end or until they failed."""
        return sum(one.status in ("done", "failed") for one in self.tried)

    @property
    def n_late(self) -> int:
        """Configurations that might be faster, and had no time, or not enough."""
        return sum(one.status in ("left out", "stopped") for one in self.tried)

    def holds_for(self, minutes: float) -> bool:
        """Whether a search of so many minutes can find nothing else: nothing lacked time, or they are no more."""
        return minutes <= self.minutes or not self.n_late
