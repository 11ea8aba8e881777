"""Speed against the thickness of what is hit: nothing passes anything, however fast and however thin."""

from functools import partial
from typing import Any

from softseam.observation import Observation
from softseam_studies.atlas.maps.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import EDGE, MODELS, PAIR, Model
from softseam_studies.atlas.trace import follow
from softseam_studies.atlas.verdicts import Verdict, judge

HIT = ("plate", "rod")
STEP, GAP = 0.01, 0.01


def build(
    speeds: tuple[float, ...] = (0.3, 1.0, 3.0, 10.0), thicknesses: tuple[float, ...] = (0.2e-3, 1e-3, 5e-3, 20e-3)
) -> Map:
    """The map, of speeds [m/s] and thicknesses [m]; a smaller one for tests."""
    panels = [(model, hit) for model in PAIR for hit in HIT]
    cells = [
        Cell(
            panel,
            i,
            j,
            f"{MODELS[model]}, {1e3 * thickness:g} mm {hit} hit at {speed:g} m/s",
            partial(run, model, hit, thickness, speed),
            0.3,
        )
        for panel, (model, hit) in enumerate(panels)
        for i, thickness in enumerate(thicknesses)
        for j, speed in enumerate(speeds)
    ]
    columns = tuple(f"{1e3 * thickness:g}" for thickness in thicknesses)
    rows = tuple(f"{speed:g}" for speed in speeds)
    return Map(
        "impact",
        "Speed against what is hit",
        f"A cube of {1e3 * EDGE:g} mm (E 100 kPa) flies, without gravity, against a plate that is fixed, or its middle "
        f"against a rod, in steps of {1e3 * STEP:g} ms: at 10 m/s it would be through within one. Accurate: its middle "
        "stays on the side from which it came.",
        tuple(
            Panel(f"{MODELS[model]}, {hit}", "thickness [mm]", "speed [m/s]", columns, rows) for model, hit in panels
        ),
        tuple(cells),
    )


def run(model: Model, hit: str, thickness: float, speed: float) -> Verdict:
    """One cell: whether the body was above in every step."""
    above: list[bool] = []

    def share(seen: Observation) -> float:
        above.append(float(seen.surface[:, 2].mean()) > 0.0)
        return float(all(above))

    trace = follow(scene(model, hit, thickness, speed), share, fields=True)
    found = judge(trace, 1.0, 0.5, "side on which it is", "that from which it came")
    if found.error is None:
        return found
    why = f"it passed the {hit}" if found.error > 0.5 else f"the {hit} stopped it"
    return Verdict(found.kind, why, found.error, found.safeguards, found.warned)


def scene(model: Model, hit: str, thickness: float, speed: float) -> dict[str, Any]:
    """The plate's or rod's middle is at the origin, the cube's base 10 mm above the top."""
    plate = {"kind": "box", "size": [0.2, 0.2, thickness]}
    rod = {"kind": "capsule", "radius": 0.5 * thickness, "length": 0.2, "axis": [0, 1, 0]}
    return {
        "softseam": 1,
        "name": "impact",
        "step": STEP,
        "duration": max((GAP + EDGE) / speed, 10 * STEP) + 10 * STEP,
        "gravity": [0, 0, 0],
        "body": {
            "shape": {"kind": "block", "size": [EDGE] * 3},
            "cell": 0.5 * EDGE,
            "position": [0, 0, 0.5 * thickness + GAP],
            "velocity": [0, 0, -speed],
            "material": {"kind": "neo_hookean", "young": 1e5, "poisson": 0.3, "density": 1000.0},
        },
        "tools": {hit: (plate if hit == "plate" else rod) | {"position": [0, 0, 0], "friction": 0.3}},
        "regions": {"default": model},
    }
