"""`softseam import`, as typed."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

IMPORT = (
    "[bold]What it does[/bold]\n\n"
    "A template says how to solve and nothing of what: body, tools and motion of the scene are assumed, for you to "
    "change. Of each line it is said which key of the scene it becomes; or that it has no equal, why, and what to do. "
    "The chapter's own templates ship as the scenes template_fem and template_pbd.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam import fem_config.yaml\n\n"
    "softseam import pbd_config.yaml --out drape.yaml"
)


def import_template(
    template: Annotated[Path, typer.Argument(metavar="FILE", help="With fem_config or pbd_config as its only key.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The scene to write; default: <template>_scene.yaml, here.")
    ] = None,
) -> None:
    """Make a scene of a configuration template of the textbook chapter (fem_config, pbd_config)."""
    from softseam_studies.importing import import_template as write_scene

    write_scene(template, out, Console())
