"""The command of the command line that fits: `softseam fit`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from softseam.cli_options import SceneArgument, Settings

FIT = (
    "[bold]What it does[/bold]\n\n"
    "The file has a line of names, then numbers: time [s], and forces of the body on tools [N]: left is the size of "
    "that on the tool left, left.x its part along x. The scene's own motion is run with FEM, and Gauss-Newton's method "
    "finds the numbers for which it is nearest to the file, by exact derivatives along the run. Standard errors follow "
    "from what is left, as if it were noise of every row apart. A number that the file cannot tell is named, and "
    "stays.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam fit my.yaml squeeze.csv\n\n"
    "softseam fit my.yaml squeeze.csv --find young,friction --out fitted.yaml\n\n"
    "softseam fit my.yaml drag.csv --find friction.plate --set body.material.young=12e3"
)


def fit(
    scene: SceneArgument,
    curve: Annotated[Path, typer.Argument(metavar="CURVE", help="Measured forces, a .csv file.")],
    find: Annotated[
        str, typer.Option(metavar="NAMES", help="What to find: young, friction (of all tools), friction.TOOL.")
    ] = "young",
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the fitted scene to this .yaml file.")] = None,
    runs: Annotated[int, typer.Option(metavar="N", help="Most runs of the scene.")] = 10,
    settings: Settings = None,
) -> None:
    """Find a body's stiffness and friction from a measured force, and say how sure they are."""
    from softseam.fit.command import Wishes, fit_scene

    fit_scene(Wishes(scene, curve, find, out, runs, tuple(settings or ())), Console())
