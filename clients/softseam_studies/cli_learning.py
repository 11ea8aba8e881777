"""Commands of the command line that learn: `softseam train` and `softseam evaluate`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from softseam.cli_options import Wanted, command

Algorithm = Literal["ppo", "sac"]
LiftModel = Literal["xpbd", "fem"]

TRAIN = (
    "[bold]What it does[/bold]\n\n"
    "Learns with stable-baselines3 and leaves policy.zip, training.json and curve.png in the folder, every 20,000 "
    "steps, too. Ctrl-C is safe: --resume goes on. TofuLift is learned from many pieces at once, by XPBD in this "
    "process: on coarse cells first, which are faster, then on fine ones, unless --no-stages. "
    "Beside it, FEM replays some episodes with the same actions, and the curve and a table say how far XPBD is off. "
    "SliceLift, PushGentle and TowelFold are learned from sessions, in a process for each processor. "
    "softseam evaluate judges the policy, but for TowelFold by FEM.\n\n"
    "[bold]Examples[/bold]\n\n"
    "softseam train TofuLift\n\n"
    "softseam train TofuLift --algo sac --steps 50000 --seed 1 --out out/mine\n\n"
    "softseam train SliceLift --shape bread.stl --set body.shape.scale=0.001\n\n"
    "softseam train TofuLift --set body.material.young=10e3"
)
EVALUATE = (
    "[bold]Examples[/bold]\n\n"
    "softseam evaluate out/TofuLift-ppo-0\n\n"
    "softseam evaluate out/TofuLift-ppo-0 --pieces 256 --record out/episodes\n\n"
    "softseam evaluate out/TofuLift-ppo-0 --pieces 256 --ray 10.0.0.1:6379"
)


@dataclass(frozen=True)
class Train:
    """Learn a policy, e.g. how to lift tofu gently."""

    task: Annotated[str, typer.Argument(help="What to learn: TofuLift, SliceLift, PushGentle or TowelFold.")] = (
        "TofuLift"
    )
    algorithm: Annotated[Algorithm, typer.Option("--algo", help="How.")] = "ppo"
    steps: Annotated[int | None, typer.Option(metavar="N", help="Actions in all; default: the task's.")] = None
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Of the pieces and of the learner.")] = 0
    model: Annotated[
        LiftModel | None,
        typer.Option(
            help="That simulates the pieces; default: the task's, of TofuLift a batch of XPBD. FEM is slower."
        ),
    ] = None
    environments: Annotated[
        int | None, typer.Option(metavar="N", help="Pieces at a time; default: the task's, 64 in a batch, else 16.")
    ] = None
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Where it goes; default: out/TASK-ALGO-SEED.")] = (
        None
    )
    resume: Annotated[bool, typer.Option("--resume", help="Go on where the folder's training stopped.")] = False
    check: Annotated[
        bool | None,
        typer.Option("--check/--no-check", help="Replay some episodes of a batch by FEM, in a process beside."),
    ] = None
    stages: Annotated[
        bool | None,
        typer.Option(
            "--stages/--no-stages",
            help="Coarse cells of XPBD for two thirds of the actions and until 95 % succeed, then fine ones. "
            "With --set body.cell: those alone.",
        ),
    ] = None
    shape: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Of SliceLift's body: a mesh, or a scene with a body; default: dumpling."),
    ] = None
    settings: Wanted = ()


train = command(Train, "softseam_studies.learn.train:train")


@dataclass(frozen=True)
class Evaluate:
    """Judge a policy on pieces that it has not seen, beside fixed rules."""

    policy: Annotated[Path, typer.Argument(metavar="FOLDER", help="What softseam train left.")]
    pieces: Annotated[int, typer.Option(metavar="N", help="How many, none of which it has seen.")] = 64
    step: Annotated[float, typer.Option(metavar="SECONDS", help="Of the simulation.")] = 0.01
    record: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Record the gentlest episode and the worst, to replay.")
    ] = None
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Share the pieces out over a Ray cluster: HOST:PORT of its head, or local, this machine's processors.",
        ),
    ] = None


evaluate = command(Evaluate, "softseam_studies.learn.evaluate:evaluate")
