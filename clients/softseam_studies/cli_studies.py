"""Commands of the command line that study a scene, or softseam itself: chart, plan, calibrate and atlas."""

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.console import Console

from softseam.cli_options import SceneArgument, Settings, Tolerance, Wanted, command

CHART = (
    "[bold]What it does[/bold]\n\n"
    "The reference is FEM alone, refined in cells and step until every quantity of the scene is known to 1 %, or half "
    "of the minutes are over; it is stored in ~/.cache/softseam. With many of softseam's own scenes one ships, which "
    "is taken as it is. Then FEM, XPBD "
    "and both together run on several cells, with several steps, elements, substeps and sweeps, and each is compared "
    "with the reference: error is the L2 norm over "
    "time of the difference, relative to the reference, of the worst quantity. Left behind: chart.png, chart.html "
    "(point at a mark), chart.csv, chart.json. Ctrl-C is safe: the same command goes on where it was.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam chart tofu_grasp\n\n"
    "softseam chart my.yaml --minutes 3 --out out/my\n\n"
    "softseam chart tofu_grasp --set body.material.young=5e3\n\n"
    "softseam chart tofu_grasp --rivals rivals.json\n\n"
    "softseam chart tofu_grasp --ray 10.0.0.1:6379"
)

PLAN = (
    "[bold]What it does[/bold]\n\n"
    "FEM alone is refined until every quantity of the scene is known to a quarter of the tolerance, but for many of "
    "softseam's own scenes, with which a reference ships; a body of particles is refined in its steps. Then the "
    "configurations of [bold]softseam chart[/bold] are tried, cheapest first, until no other can be faster than the "
    "best one that is accurate enough. Where none is, the most accurate one is refined in cells or steps; of what is, "
    "longer steps and fewer cells are tried, too. To "
    "be so whatever the reference may be off by may cost half as much again; where it would cost more, the plan is not "
    "sure, and says so. What the motion prescribes (compression that is ordered, a force that is held, a lift) any run "
    "has: it decides nothing, and where nothing else is asked for there is no plan. Plan and runs are stored in "
    "~/.cache/softseam, for other tolerances too, and "
    "[bold]softseam run --tolerance[/bold] follows the plan.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam plan tofu_grasp --tolerance 0.05\n\n"
    "softseam plan tofu_grasp --tolerance 0.1 --rtf 50 --quantity grip_force --quantity slip"
)

CALIBRATE = (
    "[bold]What it does[/bold]\n\n"
    "The body, clamped as in the scene but without tools and gravity, is let go from its slowest oscillation with "
    "several counts of substeps and sweeps. Frequency, the Young's modulus that it shows, and what the oscillation "
    "loses a period stand beside the wanted ones: those of hex27 cells, solved exactly. Kept in ~/.cache/softseam.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam calibrate cantilever\n\n"
    "softseam calibrate my.yaml --tolerance 0.01 --report calibration.json"
)

ATLAS = (
    "[bold]What it does[/bold]\n\n"
    "Each map is a grid of short runs through the product, two of its settings along the axes. Every run is judged: "
    "accurate; recovered, where a safeguard acted and it ended well; inaccurate; unstable; or refused by name. A run "
    "that is wrong and did not say so is framed in black. The maps: [bold]step[/bold] (step and Young's modulus; FEM, "
    "XPBD, both), [bold]poisson[/bold] (Poisson's ratio and element), [bold]iterations[/bold] (XPBD and classic PBD), "
    "[bold]seam[/bold] (ratios across the seam and coupling scheme), [bold]squeeze[/bold] (squeeze and speed), "
    "[bold]tools[/bold] and [bold]shapes[/bold] (tools or shapes, and cells, with what runs claim), "
    "[bold]slope[/bold] (slope and friction), [bold]impact[/bold] (thickness and speed of what is hit), "
    "[bold]messages[/bold] (lost, repeated, late), [bold]pitfalls[/bold] (the textbook's, each with a control that "
    "fails and its remedy). Left behind: a picture a map, overview.png, atlas.csv, atlas.json. Ctrl-C is safe: the "
    "same command goes on where it was.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam atlas\n\n"
    "softseam atlas step squeeze --out out/my-atlas\n\n"
    "softseam atlas --long"
)


@dataclass(frozen=True)
class Chart:
    """Chart accuracy against speed: many ways to simulate a scene, each against a converged reference."""

    scene: SceneArgument
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where the results go; default: out/chart-<scene>.")
    ] = None
    minutes: Annotated[
        float, typer.Option(metavar="MINUTES", help="Longest that reference and sweep may run, without compiling.")
    ] = 10.0
    rivals: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Measured rows of other simulators (JSON), drawn with their source."),
    ] = None
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget the stored reference and the stored runs.")] = False
    jobs: Annotated[
        int, typer.Option(metavar="N", min=0, help="Configurations that run side by side; 0: one on each core.")
    ] = 1
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Have a Ray cluster run them: HOST:PORT of its head, or local, this machine's processors.",
        ),
    ] = None
    settings: Wanted = ()


chart = command(Chart, "softseam_studies.study.chart_command:chart")


def plan(
    scene: SceneArgument,
    tolerance: Tolerance = None,
    rtf: Annotated[
        float | None,
        typer.Option("--rtf", metavar="FACTOR", help="Least real-time factor, 0: any; default: the scene's budget."),
    ] = None,
    quantities: Annotated[
        list[str] | None,
        typer.Option("--quantity", metavar="NAME", help="What has to be accurate; default: all the scene asks for."),
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(
            metavar="MINUTES", help="Longest by the clock, without compiling; default: 1, of a mesh 3, or as found."
        ),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget the stored plan, reference and runs.")] = False,
    settings: Settings = None,
) -> None:
    """Find the least that a scene needs: the fastest way to simulate it within a tolerance."""
    began = perf_counter()
    from softseam_studies.study.plan_command import Wishes
    from softseam_studies.study.plan_command import plan as find_plan

    wishes = Wishes(scene, tuple(settings or ()), tolerance, rtf, tuple(quantities or ()), minutes, fresh)
    find_plan(wishes, Console(), began)


@dataclass(frozen=True)
class Calibrate:
    """Measure stiffness, frequency and damping as XPBD shows them, and name the cheapest substeps that will do."""

    scene: SceneArgument
    tolerance: Annotated[
        float, typer.Option(metavar="SHARE", help="Of Young's modulus in time, and of the amplitude a period.")
    ] = 0.05
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the figures to this .json file.")] = None
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what was measured before.")] = False
    settings: Wanted = ()


calibrate = command(Calibrate, "softseam_studies.calibrating:calibrate")


@dataclass(frozen=True)
class Atlas:
    """Map stability where methods fail: which settings are accurate, recovered, wrong, unstable, or refused."""

    maps: Annotated[
        tuple[str, ...], typer.Argument(metavar="[MAP ...]", help="Which maps; default: all. See below.")
    ] = ()
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Where the results go; default: out/atlas.")] = None
    long: Annotated[
        bool, typer.Option("--long", help="Instead: hold a small body for 100,000 steps with each model.")
    ] = False
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget the kept runs of what is asked for.")] = False


atlas = command(Atlas, "softseam_studies.atlas.command:atlas")
