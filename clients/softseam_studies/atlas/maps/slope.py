"""Slope against friction: what friction holds stays, what it does not hold slides as Coulomb says."""

import math
from functools import partial
from typing import Any

import numpy as np

from softseam_studies.atlas.maps.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import DENSITY, MODELS, PAIR, YOUNG, Model
from softseam_studies.atlas.trace import follow
from softseam_studies.atlas.verdicts import Verdict, judge, percent

GROUNDS = ("plane", "box")
BOUND = 0.01
"""of the speed of what slides, of that without friction"""
CREEP = 2e-4
"""fastest that what holds may creep, as a mean [m/s]"""
GRAVITY, TIME, STEP = 9.81, 0.6, 0.01
VISCOUS = 5e-3
"""of the block: one that nothing damps rings on, and slips each time that it hardly presses [s]"""
SIZE = (0.04, 0.04, 0.02)


def build(
    slopes: tuple[float, ...] = (10.0, 20.0, 30.0, 40.0), frictions: tuple[float, ...] = (0.2, 0.4, 0.6, 0.8, 1.0)
) -> Map:
    """The map, of slopes [degrees] and friction; a smaller one for tests."""
    panels = [(model, ground) for model in PAIR for ground in GROUNDS]
    cells = [
        Cell(
            panel,
            i,
            j,
            f"{MODELS[model]} on a {ground}, slope {slope:g} degrees, friction {friction:g}",
            partial(run, model, ground, slope, friction),
            0.3,
        )
        for panel, (model, ground) in enumerate(panels)
        for i, slope in enumerate(slopes)
        for j, friction in enumerate(frictions)
    ]
    columns, rows = tuple(f"{slope:g}" for slope in slopes), tuple(f"{friction:g}" for friction in frictions)
    return Map(
        "slope",
        "Slope against friction",
        f"A block of 40 x 40 x 20 mm (E 20 kPa) lies on a slope, for {TIME:g} s in steps of 10 ms. Accurate: where "
        f"friction exceeds the slope's tangent it creeps by less than {1e3 * CREEP:g} mm/s, else its speed is g (sin "
        f"- friction cos) t within {100 * BOUND:g} % of g sin t.",
        tuple(
            Panel(f"{MODELS[model]} on a {ground}", "slope [degrees]", "friction", columns, rows)
            for model, ground in panels
        ),
        tuple(cells),
    )


def run(model: Model, ground: str, slope: float, friction: float) -> Verdict:
    """One cell."""
    angle, mass = math.radians(slope), DENSITY * math.prod(SIZE)
    trace = follow(scene(model, ground, angle, friction), lambda seen: float(seen.momentum[0]) / mass)
    if not trace.times:
        return judge(trace, 1.0, BOUND, "speed")
    time = float(np.mean(trace.times[-max(1, len(trace.times) // 4) :]))
    free, held = GRAVITY * math.sin(angle) * time, friction > math.tan(angle)
    truth = 0.0 if held else free - friction * GRAVITY * math.cos(angle) * time
    found = judge(trace, free, math.inf, "speed")
    if found.error is None or found.kind == "unstable":
        return found
    off = abs(trace.value - truth) / free
    why = f"it goes at {1e3 * trace.value:.3g} mm/s, {percent(off)} of a slide without friction off Coulomb's law"
    right = abs(trace.value) <= CREEP if held else off <= BOUND
    return Verdict(found.kind if right else "inaccurate", why, off, found.safeguards, found.warned)


def scene(model: Model, ground: str, angle: float, friction: float) -> dict[str, Any]:
    """Gravity is turned in place of the ground; angle [rad]."""
    box = {"kind": "box", "size": [2.0, 0.2, 0.05], "position": [0.5, 0.0, -0.025]}
    plane = {"kind": "plane", "normal": [0.0, 0.0, 1.0]}
    return {
        "softseam": 1,
        "name": "slope",
        "step": STEP,
        "duration": TIME,
        "gravity": [GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)],
        "body": {
            "shape": {"kind": "block", "size": list(SIZE)},
            "cell": [0.02, 0.02, 0.01],
            "material": {"kind": "neo_hookean", "young": YOUNG, "poisson": 0.3, "density": DENSITY}
            | {"retardation_time": VISCOUS},
        },
        "tools": {"ground": (plane if ground == "plane" else box) | {"friction": friction}},
        "regions": {"default": model},
    }
