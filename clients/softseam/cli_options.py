"""Arguments and options that several commands have, and commands whose options are fields of a dataclass."""

from collections.abc import Callable
from dataclasses import MISSING, Field, fields
from importlib import import_module
from inspect import Parameter, Signature
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from rich.console import Console
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
Wanted = Annotated[tuple[str, ...], *get_args(Settings)[1:]]
"""the same as a field of `command`"""


def _default(field: Field[Any]) -> Any:
    """As typer has it: no values are None."""
    return Parameter.empty if field.default is MISSING else None if field.default == () else field.default


def command(wishes: type[Any], home: str) -> Callable[..., None]:
    """A command that calls MODULE:FUNCTION, loaded when it is given, with its wishes and a console.

    wishes  a dataclass whose fields are arguments and options as typer has them; `settings` comes last in its help
    """
    hints = get_type_hints(wishes, include_extras=True)
    several = [name for name, hint in hints.items() if get_origin(get_args(hint)[0]) is tuple]

    def given(**values: Any) -> None:
        values |= {name: tuple(values[name] or ()) for name in several}
        module, _, function = home.partition(":")
        getattr(import_module(module), function)(wishes(**values), Console())

    hints |= {name: Annotated[list[str] | None, *get_args(hints[name])[1:]] for name in several}
    parameters = [
        Parameter(each.name, Parameter.KEYWORD_ONLY, default=_default(each), annotation=hints[each.name])
        for each in sorted(fields(wishes), key=lambda each: each.name == "settings")
    ]
    given.__doc__, given.__annotations__ = wishes.__doc__, hints
    given.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return given
