"""What the client has from `softseam_studies`, by name: commands, and the planner of scenes that have a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

if TYPE_CHECKING:
    from rich.console import Console

    from softseam.session import Session
    from softseam_protocol.scene.scene import Scene

COMMANDS = {
    "check": {
        "chart": "softseam_studies.cli_studies:chart",
        "plan": "softseam_studies.cli_studies:plan",
        "calibrate": "softseam_studies.cli_studies:calibrate",
        "atlas": "softseam_studies.cli_studies:atlas",
    },
    "quantities": {
        "materials": "softseam_studies.cli_fitting:materials",
    },
    "schema": {
        "import": "softseam_studies.cli_fitting:import_template",
        "fit": "softseam_studies.cli_fitting:fit",
        "surrogate": "softseam_studies.cli_fitting:surrogate",
        "train": "softseam_studies.cli_learning:train",
        "evaluate": "softseam_studies.cli_learning:evaluate",
    },
}
"""each as MODULE:FUNCTION, after the command of the client's own that lists have it after; the module's constant of the
command's name, in capitals, is what its help ends with"""
PLANNER = "softseam_studies.study.plan_watch"
"""the module that finds what a scene's `tolerance` and `budget` ask for, a `Planner`"""


class Command(NamedTuple):
    """A command that is declared elsewhere."""

    name: str
    function: Callable[..., None]
    epilog: str


class Planner(Protocol):
    """What a scene's `tolerance` and `budget` ask for: found by runs, or read where it was found before."""

    def planned_session(
        self, scene: str | Path | Scene, settings: tuple[str, ...], begin: Callable[[tuple[str, ...]], Session]
    ) -> Session:
        """A session that `begin` opens with the settings of a plan, and that can be planned anew."""

    def planned_settings(
        self, scene: str, settings: tuple[str, ...], tolerance: float | None, console: Console
    ) -> tuple[str, ...]:
        """The settings of a plan, which a line says; tolerance: in place of the scene's."""


def commands_after(own: str) -> list[Command]:
    """The commands that are listed after this one of the client's own."""
    found = []
    for name, row in COMMANDS[own].items():
        home, _, function = row.partition(":")
        module: Any = import_module(home)
        found.append(Command(name, getattr(module, function), getattr(module, name.upper())))
    return found


def planner() -> Planner:
    """The planner, loaded."""
    return cast(Planner, import_module(PLANNER))
