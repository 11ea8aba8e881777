"""What a scene's `tolerance` asks of whoever opens or runs it: a session, or settings, of a plan.

Does a plan hold for a motion that it was not made for? A session's error estimate against that of the plan's run.

The plan's run was e off, and estimated of itself to be a_0 off by mesh and model; the body as it stands is estimated to
be a off. The rest of e has other reasons, the step's length above all. So this motion is off by some

    e + a - a_0                                                                                                   (1)

Where that is more than the tolerance, the fastest run is chosen whose e + (r - 1) a_0 is not, r being `ROUGHLY` times
a / a_0 of the plan's run: few cells see less of what another motion does. Most runs were made before.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from softseam.session import Session
from softseam_protocol.messages.session import ErrorEstimate
from softseam_protocol.scene.scene import Scene
from softseam_studies.study.plan import Plan
from softseam_studies.study.plan_command import Wishes, find, planned, settings_of

ROUGHLY = 2.0
"""the ratio of two motions' errors may be so many times as large on other cells [1]"""


@dataclass(frozen=True)
class PlanWatch:
    """A plan, and what it was found for."""

    wishes: Wishes
    plan: Plan
    console: Console
    open: Callable[[tuple[str, ...]], Session]
    """a session with these settings"""

    def begin(self) -> Session:
        """A session that is planned, and can be planned anew."""
        session = self.open((*self.wishes.settings, *settings_of(self.plan)))
        session.plan_anew = self.anew
        return session

    def anew(self, estimate: ErrorEstimate | None) -> Session | None:
        """A session planned for the motion that this is the estimate of; None where the plan holds, or nobody knows."""
        factor = self.needed(estimate)
        if factor is None:
            return None
        wishes = replace(self.wishes, load_factor=factor)
        return replace(self, wishes=wishes, plan=find(wishes, self.console)).begin()

    def needed(self, estimate: ErrorEstimate | None) -> float | None:
        """How many times as large errors may be as in the plan's own run, rounded up; None as of `anew`."""
        choice, goal = self.plan.choice, self.plan.goal
        if estimate is None or choice.estimate <= 0.0:
            return None
        more = estimate.answer - goal.load_factor * choice.estimate
        if more <= 0.0 or self.plan.off + more <= goal.tolerance:
            return None
        return math.ceil(10.0 * ROUGHLY * estimate.answer / choice.estimate) / 10.0


def planned_session(
    scene: str | Path | Scene, settings: tuple[str, ...], begin: Callable[[tuple[str, ...]], Session]
) -> Session:
    """A session that `begin` opens with the settings of a plan, and that can be planned anew.

    Progress goes to the terminal's standard error; where there is none, a line says what takes so long.
    """
    shown = sys.stderr.isatty()
    console, wishes = Console(stderr=True, quiet=not shown), Wishes(scene, settings)

    def begins(text: str) -> None:
        if not shown:
            print(f"softseam: {text}", file=sys.stderr, flush=True)

    return PlanWatch(wishes, find(wishes, console, begins), console, begin).begin()


def planned_settings(
    scene: str, settings: tuple[str, ...], tolerance: float | None, console: Console
) -> tuple[str, ...]:
    """The settings of a plan, which a line says; tolerance: in place of the scene's."""
    return planned(Wishes(scene, settings, tolerance), console)
