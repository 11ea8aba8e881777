"""Iterations against stiffness: XPBD's material stays what it is, that of classic PBD follows its sweeps."""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from softseam.observation import Observation
from softseam_protocol.scene.models import CLASSIC_PBD
from softseam_studies.atlas.maps.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import XPBD, force_share, press, pressed
from softseam_studies.atlas.trace import Trace, follow
from softseam_studies.atlas.verdicts import Verdict, judge

SUBSTEPS: tuple[int | str, ...] = (1, 2, 4, 8, 16, 32, 64, "auto")
SWEEPS = (1, 2, 4, 8, 16, 32)
STRETCHES = (5.0, 50.0, 500.0, 5000.0)
SHARES = (0.1, 0.3, 0.6, 0.9)
CALIBRATED = 4
"""sweeps at which classic PBD is taken to be as stiff as it should be"""
BOUND = 0.05
LENGTH, DENSITY, DIVISIONS = 0.4, 0.05, 8


def build(sweeps: tuple[int, ...] = SWEEPS, substeps: tuple[int | str, ...] = SUBSTEPS) -> Map:
    """The map; a smaller one for tests."""
    cells: list[Cell] = []

    def panel(
        number: int, columns: tuple[Any, ...], rows: tuple[float, ...], name: str, run: Callable[..., Verdict]
    ) -> None:
        for i, column in enumerate(columns):
            for j, row in enumerate(rows):
                label = f"{name}, {column}, {row:g}"
                cells.append(Cell(number, i, j, label, partial(run, column, row), 0.2, number == 2))

    panel(0, substeps, (1e3, 1e4, 1e5, 1e6), "XPBD block", block)
    panel(1, sweeps, STRETCHES, "XPBD rope", rope)
    panel(2, sweeps, SHARES, "classic rope", partial(classic, per_substep=False))
    panel(3, sweeps, SHARES, "classic rope, per substep", partial(classic, per_substep=True))
    counts = tuple(str(n) for n in sweeps)
    shares = tuple(f"k {share:g}" for share in SHARES)
    return Map(
        "iterations",
        "Iterations against stiffness",
        "The cube of the first map in steps of 10 ms, and a rope of 0.4 m and 20 g hanging by one end. Accurate: "
        f"within {100 * BOUND:g} % of the closed form (force; stretch of the rope). Classic PBD has no physical "
        f"stiffness: its stretch is compared with its own at {CALIBRATED} sweeps, as if it had been calibrated there. "
        "E A [N]: the rope's stiffness against stretch; k: the share of a constraint's error that a sweep of classic "
        "PBD takes away. XPBD's ropes take as many substeps as let unfinished sweeps stretch them by 0.5 % of their "
        "length: by many times what a stiff one stretches by itself (at 5000 N 0.002 %), which the run says; who needs "
        "that asks for more substeps.",
        (
            Panel(
                "Block, XPBD", "substeps a step", "Young's modulus",
                tuple(str(n) for n in substeps), ("1 kPa", "10 kPa", "100 kPa", "1 MPa"),
            ),
            Panel("Rope, XPBD", "sweeps a substep", "E A", counts, tuple(f"{ea:g} N" for ea in STRETCHES)),
            Panel("Rope, classic PBD (control)", "sweeps a substep", "stiffness k of a sweep", counts, shares),
            Panel("Rope, classic, per substep", "sweeps a substep", "stiffness k of a substep", counts, shares),
        ),
        tuple(cells),
    )  # fmt: skip


def block(substeps: int | str, young: float) -> Verdict:
    """The press, with so many substeps a step."""
    scene = press(young, 0.01, XPBD, pbd={"substeps": substeps})
    return judge(follow(scene, force_share(young)), pressed(0.1), BOUND, "force")


def rope(sweeps: int, stretch: float) -> Verdict:
    """XPBD's rope against the discrete rope's closed form."""
    trace = hang({"sweeps": sweeps}, stretch)
    return judge(trace, weight_stretch(stretch), BOUND, "stretch")


def rope_share(sweeps: int, stretch: float = 50.0) -> float:
    """Strain of XPBD's rope [1]."""
    return hang({"sweeps": sweeps}, stretch).value


def classic(sweeps: int, share: float, per_substep: bool) -> Verdict:
    """Classic PBD's rope against itself at another number of sweeps."""
    source = f"its own at {CALIBRATED} sweeps"
    calibrated = _classic(CALIBRATED, share, per_substep).value
    return judge(_classic(sweeps, share, per_substep), calibrated, BOUND, "stretch", source)


@cache
def _classic(sweeps: int, share: float, per_substep: bool) -> Trace:
    keys = {"stretch": share, "bending": 0.0, "per_substep": per_substep}
    return hang({"method": CLASSIC_PBD, "classic": keys, "sweeps": sweeps, "substeps": 4}, 500.0)


def hang(pbd: dict[str, Any], stretch: float) -> Trace:
    """A rope that hangs by its upper end from rest, until it is calm."""
    scene = {
        "softseam": 1,
        "name": "rope",
        "gravity": [0, 0, -9.81],
        "step": 0.01,
        "duration": 1.2,
        "body": {
            "kind": "rope",
            "length": LENGTH,
            "divisions": DIVISIONS,
            "density": DENSITY,
            "stretch": stretch,
            "rotation": [0, 1.5707963267948966, 0],
            "damping": 8.0,
            "fixed": [{"min": [-1, -1, 0.499 * LENGTH], "max": [1, 1, 1]}],
        },
        "models": {XPBD: pbd},
        "quantities": ["sag", "worst_stretch", "stretch_violation"],
    }
    unmet = 0.0

    def longer(observation: Observation) -> float:
        nonlocal unmet
        quantities = observation.quantities
        unmet = quantities["stretch_violation"] / max(abs(quantities["worst_stretch"]), 1e-12)
        return -quantities["sag"] / LENGTH

    trace = follow(scene, longer)
    if unmet > BOUND:
        trace.warned = (*trace.warned, "quantity: stretch violation")
    return trace


def weight_stretch(stretch: float) -> float:
    """Strain of a rope of n springs under its own weight: sum over springs of what hangs below, g rho L/(2 E A) [1]."""
    return 9.81 * DENSITY * LENGTH / (2.0 * stretch)
