"""The commands of numbers, given and found: `softseam materials`, `fit`, `surrogate` and `import`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console

from softseam.cli_options import SceneArgument, Wanted, command
from softseam_protocol.scene.foods import FOODS

if TYPE_CHECKING:
    FoodName = str
else:
    FoodName = Literal[tuple(FOODS)]

MATERIALS = (
    "[bold]What it does[/bold]\n\n"
    "`material: tofu_firm` in a scene takes all numbers of a food, `material: {food: tofu_firm, young: 30e3}` all but "
    "those that are said. What is simulated and recorded are numbers.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam materials\n\n"
    "softseam materials --show tofu_firm --picture tofu_firm.png"
)


@dataclass(frozen=True)
class Foods:
    """Foods that a scene's `material` may name: their numbers, where these are from, and which are assumed."""

    show: Annotated[FoodName | None, typer.Option(metavar="NAME", help="All numbers of one, with their sources.")] = (
        None
    )
    picture: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Draw what it does when it is pulled, pressed and held.")
    ] = None


materials = command(Foods, "softseam_studies.foods.command:foods")


FIT = (
    "[bold]What it does[/bold]\n\n"
    "The file has a line of names, then numbers: time \\[s], and forces of the body on tools \\[N]: left is the size "
    "of that on the tool left, left.x its part along x. The scene's own motion is run with FEM, and Gauss-Newton's "
    "method finds the numbers for which it is nearest to the file, by exact derivatives along the run. Standard errors "
    "follow from what is left, as if it were noise of every row apart. A number that the file does not determine is "
    "named, and stays.\n\n"
    "Without a scene the file is a laboratory's, of a material: frequency \\[rad/s], storage and loss \\[Pa] of a "
    "sweep, or time \\[s], stretch and stress \\[Pa] of a bar whose sides are free, however it was pulled, pressed and "
    "held. Found are its modulus and the branches of `relaxation`, one a decade, by least squares.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam fit my.yaml squeeze.csv\n\n"
    "softseam fit my.yaml squeeze.csv --find young,friction --out fitted.yaml\n\n"
    "softseam fit my.yaml drag.csv --find friction.plate --set body.material.young=12e3\n\n"
    "softseam fit sweep.csv --picture sweep.png"
)


@dataclass(frozen=True)
class Fit:
    """Find stiffness, friction and how a material relaxes from measured curves, and say how sure they are."""

    scene: Annotated[
        str,
        typer.Argument(metavar="SCENE", help="A scene file, or the name of a bundled scene; left out, of a material."),
    ]
    curve: Annotated[Path | None, typer.Argument(metavar="CURVE", help="What was measured, a .csv file.")] = None
    find: Annotated[
        str, typer.Option(metavar="NAMES", help="What to find: young, friction (of all tools), friction.TOOL.")
    ] = "young"
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the fitted scene to this .yaml file.")] = None
    runs: Annotated[int, typer.Option(metavar="N", help="Most runs of the scene.")] = 10
    picture: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Draw what was measured and fitted, of a material.")
    ] = None
    settings: Wanted = ()


fit = command(Fit, "softseam_studies.fit.command:fit_curve")


SURROGATE = (
    "[bold]What it does[/bold]\n\n"
    "The scene's own motion, which is to squeeze a body, is run with FEM for values spread between the bounds of what "
    "is varied. Polynomials then give the quantities for any values between them and for any squeeze that all runs "
    "reach, within microseconds, and with a claim: by how much they may be off, for 95 % of what lies between. In "
    "Python: Surrogate.read(FILE).at({KEY: VALUE, ...}, squeeze).\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam surrogate my.yaml --vary body.material.young=10e3..40e3 --out my.json\n\n"
    "softseam surrogate tofu_grasp --vary body.material.young=10e3..40e3 "
    "--vary tools.left.friction+tools.right.friction=0.3..0.8 --out tofu.json"
)


@dataclass(frozen=True)
class MakeSurrogate:
    """Run a squeeze many times beforehand; a formula then gives force and stress in microseconds, with its error."""

    scene: SceneArgument
    out: Annotated[Path, typer.Option(metavar="FILE", help="Write the surrogate to this .json file.")]
    vary: Annotated[
        tuple[str, ...],
        typer.Option(metavar="KEY=LOW..HIGH", help="What may differ; keys with one value are joined by +. Repeatable."),
    ] = ()
    of: Annotated[str, typer.Option("--of", metavar="QUANTITIES", help="What it gives, of `softseam quantities`.")] = (
        "grip_force,peak_von_mises"
    )
    runs: Annotated[int, typer.Option(metavar="N", help="Runs of the scene.")] = 64
    settings: Wanted = ()


surrogate = command(MakeSurrogate, "softseam_studies.surrogate.command:make_surrogate")


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
