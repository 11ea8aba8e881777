"""Squeeze against closing speed, with FEM and XPBD: crushed cells, negative Jacobians, impacts."""

from functools import partial

from softseam_studies.atlas.maps.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import MODELS, PAIR, YOUNG, Model, confined, force_share, press
from softseam_studies.atlas.trace import follow
from softseam_studies.atlas.verdicts import Verdict, judge

SPEEDS = (0.01, 0.1, 0.3, 1.0, 3.0)
BOUND = 0.02
STEP, HOLD = 0.005, 0.4


def build(
    squeezes: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8), speeds: tuple[float, ...] = SPEEDS
) -> Map:
    """The map; a smaller one for tests."""
    cells = [
        Cell(
            panel,
            i,
            j,
            f"{MODELS[model]}, squeezed by {100 * squeeze:g} % at {speed:g} m/s",
            partial(run, model, squeeze, speed),
            0.4,
        )
        for panel, model in enumerate(PAIR)
        for i, squeeze in enumerate(squeezes)
        for j, speed in enumerate(speeds)
    ]
    columns, rows = tuple(f"{100 * s:.0f}" for s in squeezes), tuple(f"{speed:g}" for speed in speeds)
    return Map(
        "squeeze",
        "Squeeze and impact",
        "The cube (E 20 kPa) in a smooth box, in steps of 5 ms; two of its walls close at the speed given, stop, "
        f"and hold for {HOLD:g} s. Accurate: the held force is within {100 * BOUND:g} % of its closed form. At three "
        "metres a second the plates cross the whole squeeze within a step.",
        tuple(Panel(MODELS[model], "squeeze [%]", "speed of each plate [m/s]", columns, rows) for model in PAIR),
        tuple(cells),
    )


def run(model: Model, squeeze: float, speed: float) -> Verdict:
    """One cell."""
    scene = press(YOUNG, STEP, model, squeeze=squeeze, speed=speed, hold=HOLD, walls=True)
    return judge(follow(scene, force_share(YOUNG)), confined(squeeze), BOUND, "force")
