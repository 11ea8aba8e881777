"""What a scene's `tolerance` asks of whoever opens or runs it: a session, or settings, of a plan."""

import sys
from collections.abc import Callable
from pathlib import Path

from rich.console import Console

from softseam.session import Session
from softseam_protocol.scene.scene import Scene
from softseam_studies.study.plan_command import Wishes, find, planned
from softseam_studies.study.plan_watch import PlanWatch


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
