"""The commands, as they are typed; models and services are those of the tables as this is imported.

Every command says what it did; what becomes of errors, `cli` says.
"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console

from softseam.cli_options import (
    PICTURE,
    CheckCommand,
    Deployment,
    Endpoint,
    Recordings,
    Routes,
    SceneArgument,
    Settings,
    Tolerance,
)
from softseam.commands import commands_after
from softseam.variants import models
from softseam_protocol.models import roles

app = typer.Typer(
    name="softseam",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="One soft body, two models at once: implicit FEM where fingers touch, XPBD in the far field.\n\n"
    "Begin with [bold]softseam demo[/bold], or [bold]softseam run tofu_grasp[/bold].",
    epilog="Exit codes: 0 done, 1 failed, 2 bad input. SOFTSEAM_TRACEBACK=1 shows where an internal error comes from.",
)

if TYPE_CHECKING:
    Model = str
    Role = str
else:
    Model, Role = Literal[models()], Literal[roles()]


def _out() -> Console:
    return Console()


def _list_after(own: str) -> None:
    for each in commands_after(own):
        app.command(name=each.name, epilog=each.epilog)(each.function)


@app.command(
    epilog="[bold]Examples[/bold]\n\n"
    "softseam run tofu_grasp\n\n"
    "softseam run my.yaml --record run.mcap --report run.json --pictures pictures\n\n"
    "softseam run tofu_grasp --model fem --set step=0.005\n\n"
    "softseam run tofu_grasp --tolerance 0.05\n\n"
    "softseam run tofu_grasp --set tools.left.friction=0.05 --set tools.right.friction=0.05"
)
def run(
    scene: SceneArgument,
    model: Annotated[
        Model | None,
        typer.Option(
            help="Simulate with FEM alone, PBD alone, or both, whatever the scene says; several bodies each with that "
            "model, or, as hybrid, with the model and cells that are right for it."
        ),
    ] = None,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Record to this .mcap file.")] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write figures, ledger and events to this .json file.")
    ] = None,
    pictures: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Draw pictures into this folder.")] = None,
    connect: Endpoint = None,
    view: Annotated[bool, typer.Option("--view", help="Show the run in rerun afterwards.")] = False,
    tolerance: Tolerance = None,
    step_limit: Annotated[
        float | None,
        typer.Option(
            "--step-limit",
            metavar="SECONDS",
            min=0.0,
            help="End the run where no step is solved for so long, 0: never; default: 20 s, and 10 ms a node.",
        ),
    ] = None,
    estimate: Annotated[
        bool | None,
        typer.Option(
            "--estimate/--no-estimate",
            show_default=False,
            help="Claim by a second run, on cells and with steps twice as long, how far quantities are off; default: "
            "where that takes at most 40 % of this run's time.",
        ),
    ] = None,
    condition: Annotated[
        bool, typer.Option("--condition", help="Tell the condition number of XPBD's system, and what it means.")
    ] = False,
    settings: Settings = None,
) -> None:
    """Simulate a scene: progress, a closing table, and whatever files you ask for."""
    from softseam.running import Wishes
    from softseam.running import run as run_scene

    options = tuple(settings or ())
    wishes = Wishes(
        scene, model, options, connect, record, report, pictures, view, tolerance, step_limit, estimate, condition
    )
    if run_scene(wishes, _out())["verdict"]["outcome"] == "failed":
        raise typer.Exit(1)


@app.command(epilog="[bold]Examples[/bold]\n\nsoftseam demo\n\nsoftseam demo --scene tofu_pads --out out/pads")
def demo(
    scene: Annotated[
        str, typer.Option(metavar="SCENE", help="A scene file, or the name of a bundled scene.")
    ] = "tofu_grasp",
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where the results go; default: out/demo-<scene>.")
    ] = None,
) -> None:
    """Simulate with real processes on a bus; leaves recording, .rrd, report and pictures in a folder."""
    from softseam.demo import run_demo

    run_demo(scene, out, _out())


@app.command(
    epilog="[bold]Examples[/bold]\n\n"
    "softseam replay run.mcap\n\n"
    "softseam replay run.mcap --save run.rrd\n\n"
    "softseam replay run.mcap --verify"
)
def replay(
    recording: Annotated[
        Path, typer.Argument(metavar="FILE", help="A recording (.mcap), or a folder: its newest one.")
    ],
    save: Annotated[Path | None, typer.Option(metavar="FILE", help="Save for rerun (.rrd) instead of showing.")] = None,
    web: Annotated[bool, typer.Option("--web", help="Show in a web browser, served on this machine alone.")] = False,
    verify: Annotated[bool, typer.Option("--verify", help="Simulate again and compare bit for bit.")] = False,
    pictures: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Draw pictures into this folder.")] = None,
    bind: Annotated[str, typer.Option(metavar="ADDRESS", help="For --web: where browsers reach it.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(metavar="PORT", help="For --web: the browser's port.")] = 9090,
) -> None:
    """Show a recording in rerun, save it for rerun, draw it, or verify it.

    Rerun's usage reporting is off; SOFTSEAM_RERUN_ANALYTICS=1 leaves it as `rerun analytics` set it.
    """
    from softseam.showing import show

    code = show(recording, _out(), save=save, web=web, verify=verify, pictures=pictures, bind=bind, port=port)
    raise typer.Exit(code)


@app.command(
    cls=CheckCommand,
    epilog="[bold]Examples[/bold]\n\n"
    "softseam check my.yaml --set body.cell=0.01\n\n"
    "softseam check my.yaml --picture\n\n"
    "softseam check my.yaml --picture look.png",
)
def check(
    scene: SceneArgument,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="[FILE]",
            help=f"Draw bodies, tools, their ways and what touches to this .png; without a name: {PICTURE}.",
        ),
    ] = None,
    settings: Settings = None,
) -> None:
    """Validate a scene and its mesh, and say what simulating it will take. Simulates nothing."""
    from softseam.checking import check_scene

    check_scene(scene, tuple(settings or ()), _out(), picture)


_list_after("check")


@app.command(
    epilog="[bold]Examples[/bold]\n\nsoftseam up\n\nsoftseam up -- softseam run tofu_grasp --connect tcp/127.0.0.1:7447"
)
def up(
    command: Annotated[
        list[str] | None,
        typer.Argument(metavar="[-- COMMAND]", help="Run this once all services are ready, then stop."),
    ] = None,
    connect: Endpoint = None,
    deployment: Deployment = None,
    recordings: Recordings = None,
    route: Routes = None,
) -> None:
    """Run router, fem, pbd, orchestrator and recorder on this machine; what dies or freezes is restarted."""
    from softseam.processes import up as run_all

    raise typer.Exit(run_all(connect, deployment, recordings, tuple(route or ()), tuple(command or ())))


@app.command(
    epilog="[bold]Examples[/bold]\n\nsoftseam serve router --connect tls/0.0.0.0:7447\n\n"
    "softseam serve fem --guard --connect tls/router.example:7447"
)
def serve(
    role: Annotated[Role, typer.Argument(help="What to serve.")],
    connect: Endpoint = None,
    deployment: Deployment = None,
    recordings: Recordings = None,
    route: Routes = None,
    guard: Annotated[bool, typer.Option("--guard", help="Restart it when it dies or freezes.")] = False,
) -> None:
    """Run one service until Ctrl-C: for several machines, containers, or a supervisor of your own."""
    from softseam.processes import serve as run_one

    raise typer.Exit(run_one(role, connect, deployment, recordings, tuple(route or ()), guard=guard))


@app.command(epilog="[bold]Example[/bold]\n\nsoftseam health --connect tcp/127.0.0.1:7447")
def health(connect: Endpoint = None, deployment: Deployment = None) -> None:
    """Which services are well; exit code 0 if all are, 1 if not, 2 where no router answers."""
    from softseam.processes import health as ask

    raise typer.Exit(ask(connect, deployment))


@app.command(
    epilog="[bold]Examples[/bold]\n\nsoftseam keys\n\nsoftseam keys --host lab.example --host 192.0.2.7\n\n"
    "softseam keys --renew"
)
def keys(
    host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Certify a name, or number, by which other machines reach this. Repeatable."),
    ] = None,
    renew: Annotated[
        bool, typer.Option("--renew", help="Change all passwords; start router and services anew afterwards.")
    ] = False,
) -> None:
    """Keys of the bus, which `up` makes by itself: prepare it for other machines; say which file to hand out."""
    from softseam.errors import BadInput
    from softseam_protocol.bus.certificates import prepare
    from softseam_protocol.errors import BusError

    try:
        handed = prepare(tuple(host or ()), renew)
    except BusError as error:
        raise BadInput(str(error)) from None
    _out().print(f"keys are in {handed.parent}; hand out {handed}", highlight=False, soft_wrap=True)


@app.command(
    epilog="[bold]What it does[/bold]\n\n"
    "A block of two cells is configured, advanced, corrected, saved and refused, in sessions of its own: other "
    "sessions of the service are not disturbed. Each check is a sentence of the contract, docs/guide/"
    "write-a-participant.md; where one fails, the table says what was expected and what came. What the participant's "
    "Capabilities do not claim is not checked. Exit code 1 where a check fails.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam conform tcp/127.0.0.1:7447 --service fem\n\n"
    "softseam conform tcp/127.0.0.1:7447 --service my_solver --check momentum --check restore"
)
def conform(
    endpoint: Annotated[str, typer.Argument(metavar="ENDPOINT", help="The router, e.g. tcp/127.0.0.1:7447.")],
    service: Annotated[
        str | None, typer.Option("--service", metavar="NAME", help="The participant; default: the only one there.")
    ] = None,
    model: Annotated[
        str | None, typer.Option("--model", metavar="NAME", help="What it is asked for; default: its service's name.")
    ] = None,
    check: Annotated[
        list[str] | None, typer.Option("--check", metavar="NAME", help="Only this check. Repeatable.")
    ] = None,
    deployment: Deployment = None,
) -> None:
    """Check a participant on the bus against the protocol: a table of what it must do, and does."""
    from softseam.conform.command import conform as run_kit

    if not run_kit(endpoint, service, model, deployment, tuple(check or ()), _out()):
        raise typer.Exit(1)


@app.command()
def quantities() -> None:
    """What a scene's `quantities` may name: units and meanings."""
    from rich.table import Table

    from softseam_protocol.quantities import QUANTITIES

    bodies = {"any": "", "cells": "bodies in cells", "particles": "sheets, ropes, tetrahedra"}
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading in ("quantity", "unit", "", "of"):
        table.add_column(heading)
    for name, row in QUANTITIES.items():
        table.add_row(name, row.unit, row.meaning, bodies[row.of])
    _out().print(table)


_list_after("quantities")


@app.command()
def schema(
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Write to this file instead of printing.")] = None,
) -> None:
    """The JSON Schema of scene files, for an editor's completion."""
    from softseam_protocol.scene.file import scene_schema

    if out is None:
        sys.stdout.write(scene_schema())
    else:
        from softseam.outputs import cannot_write, check_outputs

        check_outputs([("--out", out)], inputs={})
        try:
            out.write_text(scene_schema(), encoding="utf-8")
        except OSError as error:
            raise cannot_write(out, error) from None


_list_after("schema")
