"""`softseam surrogate`: runs a scene many times, and leaves a file that answers for all that lies between."""

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.errors import BadInput
from softseam.outputs import cannot_write, check_ending, check_outputs
from softseam.scenes import bundle_of, inputs_of
from softseam_protocol.quantities import QUANTITIES
from softseam_studies.cli_fitting import MakeSurrogate
from softseam_studies.surrogate.learn import checked, learn
from softseam_studies.surrogate.surrogate import Surrogate, Varied

_TENTH = 10


def make_surrogate(wishes: MakeSurrogate, console: Console) -> Surrogate:
    """Make it, print what it claims, and write it. Raises BadInput, SceneRefused and SimulationFailed."""
    if not wishes.vary:
        raise BadInput("--vary: name what may differ, e.g. --vary body.material.young=10e3..40e3")
    varied = [Varied.read(text) for text in wishes.vary]
    names = tuple(name.strip() for name in wishes.of.split(","))
    for name in names:
        if name not in QUANTITIES:
            raise BadInput(f"--of {name}: no quantity is called so (softseam quantities lists them)")
    check_ending("--out", wishes.out, ".json", "a surrogate")
    check_outputs([("--out", wishes.out)], inputs=inputs_of(wishes.scene))
    scene, _ = bundle_of(wishes.scene)
    checked(scene, varied, wishes.settings)

    def show(done: int) -> None:
        if done % max(1, wishes.runs // _TENTH) == 0:
            console.print(Text(f"{done} of {wishes.runs} runs", style="dim"))

    found = learn(wishes.scene, varied, names, wishes.runs, wishes.settings, show)
    try:
        found.write(wishes.out)
    except OSError as error:
        raise cannot_write(wishes.out, error) from None
    _print(found, console)
    console.print(Text(f"surrogate: {wishes.out}"), soft_wrap=True)
    return found


def _print(found: Surrogate, console: Console) -> None:
    first, last = float(found.squeezes[0]), float(found.squeezes[-1])
    console.print(Text(f"{found.runs} runs in {found.seconds:.0f} s, polynomials of degree {found.degree}"))
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column("squeezed by")
    squeezes = np.geomspace(first, last, 4)
    for squeeze in squeezes:
        table.add_column(f"{squeeze:.1%}", justify="right")
    for name, claim in zip(found.quantities, found.claims, strict=True):
        row = np.expm1(np.interp(np.log(squeezes), np.log(found.squeezes), claim))
        table.add_row(f"{name} is given to", *(f"{share:.1%}" for share in row))
    console.print(table)
