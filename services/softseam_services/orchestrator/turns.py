"""Whether the steps that are not linked are direct or condensed, and whose compliance a direct one asks for."""

from __future__ import annotations

_REPEATS = 2
"""steps in contact in a row that took more than one exchange after which the near side is condensed: it is then asked
once a step where the far side, the cheaper one, is asked twice"""
_PATIENCE = 64
"""condensed steps before both sides are tried at once again"""
_CALM_STEPS = 3
"""calm condensed steps in a row after which both sides are tried at once again"""


class Turns:
    """All of it evolves."""

    def __init__(self, fresh: bool):
        self.condensed = False
        """whether steps are, unless `fresh`"""
        self.fresh = fresh
        """whether both sides' compliances are to be asked for"""
        self.resumed = False
        """whether the near side's compliance is: it is as old as the last direct step"""
        self._wait = 0
        self._repeated = 0  # steps in a row that touched and took more than one exchange or, condensed, were calm

    def know_far(self) -> None:
        """The far side has told its compliance outside of a direct step."""
        self.fresh, self.resumed = False, True

    def know_both(self) -> None:
        """A direct step has both sides' compliances."""
        self.fresh = self.resumed = False

    def wait(self) -> None:
        """Steps are condensed for a while."""
        self.condensed, self._wait = True, _PATIENCE

    def condense(self) -> None:
        """Direct steps are slow: those to come are condensed for a while."""
        self.wait()
        self._repeated = 0

    def direct_ended(self, repeats: bool) -> bool:
        """Whether so many direct steps in a row were of the kind that repeats that they are to be condensed."""
        self._repeated = self._repeated + 1 if repeats else 0
        return self._repeated >= _REPEATS

    def condensed_begun(self) -> None:
        """A condensed step is taken."""
        self._wait -= 1
        self.condensed = self._wait > 0
        self.resumed = not self.condensed

    def condensed_ended(self, calm: bool) -> None:
        """It agreed; calm where the far side hardly had to move."""
        self._repeated = self._repeated + 1 if calm else 0
        if self.condensed and self._repeated == _CALM_STEPS:
            self.condensed, self.resumed = False, True
        if not self.condensed:
            self._repeated = 0

    def to_list(self) -> list[float]:
        return [self.condensed, self._wait, self._repeated, self.fresh, self.resumed]

    def take(self, numbers: list[float]) -> None:
        """Continue from `to_list`."""
        condensed, wait, repeated, fresh, resumed = numbers
        self.condensed, self._wait, self._repeated = bool(condensed), int(wait), int(repeated)
        self.fresh, self.resumed = bool(fresh), bool(resumed)
