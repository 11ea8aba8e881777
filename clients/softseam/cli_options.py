"""Arguments and options that several commands have."""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

PICTURE = "scene.png"
"""where `softseam check --picture` draws to if it is given no name"""


class CheckCommand(TyperCommand):
    """A command whose --picture may stand without a value, after all else or before another option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        for at in range(len(args), 0, -1):
            if args[at - 1] == "--picture" and (at == len(args) or args[at].startswith("-")):
                args.insert(at, PICTURE)
        return super().parse_args(ctx, args)


SceneArgument = Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a bundled scene.")]
Endpoint = Annotated[
    str | None,
    typer.Option("--connect", metavar="ENDPOINT", help="Router of running services, e.g. tcp/127.0.0.1:7447."),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change the scene, e.g. tools.left.friction=0.05. Repeatable."),
]

Tolerance = Annotated[
    float | None,
    typer.Option("--tolerance", metavar="SHARE", help="Largest error of any quantity, e.g. 0.05 for 5 %."),
]
Deployment = Annotated[
    str | None, typer.Option("--deployment", metavar="NAME", help="Keeps apart what shares a router; default: local.")
]
Routes = Annotated[
    list[str] | None,
    typer.Option("--route", metavar="PART=SERVICE", help="Who takes a part, e.g. body.far=my_solver. Repeatable."),
]
Recordings = Annotated[
    Path | None, typer.Option("--recordings", metavar="FOLDER", help="Where the recorder writes; default: recordings.")
]
