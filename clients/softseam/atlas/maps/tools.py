"""Shape and size of a tool against the cells that it presses, and whether claims of the error hold there."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from softseam.atlas.maps.grid import Cell, Map, Panel
from softseam.atlas.scenes import MODELS, Model
from softseam.atlas.trace import Trace, follow
from softseam.atlas.verdicts import Verdict, judge, percent
from softseam.claims.claim import FACTOR

TOOLS: dict[str, dict[str, Any]] = {
    "ball 3": {"kind": "sphere", "radius": 3e-3},
    "ball 10": {"kind": "sphere", "radius": 10e-3},
    "rod 3": {"kind": "capsule", "radius": 3e-3, "length": 0.02, "axis": [1, 0, 0]},
    "end 5": {"kind": "cylinder", "radius": 5e-3, "length": 0.02, "axis": [0, 0, 1]},
    "box 12": {"kind": "box", "size": [0.012, 0.012, 0.02]},
}
"""by name, with radius or edge [mm]"""
ABOVE = {"ball 3": 3e-3, "ball 10": 10e-3, "rod 3": 3e-3, "end 5": 10e-3, "box 12": 10e-3}
"""height of each one's middle over its lowest point [m]"""
CELLS = (20e-3, 10e-3, 20e-3 / 3, 5e-3)
"""edges [m]"""
FINEST = 20e-3 / 6
PAIR: tuple[Model, ...] = ("fem", "pbd")
BOUND = 0.1
DEPTH, SPEED = 2e-3, 0.02
PLACE = 3.1e-3, 2.7e-3
"""of the tool's axis, between nodes [m]"""


def build(tools: tuple[str, ...] = tuple(TOOLS), edges: tuple[float, ...] = CELLS) -> Map:
    """The map; a smaller one for tests."""
    runs: list[tuple[str, Callable[[str, float], Verdict]]] = [
        *((f"{MODELS[model]}: force", partial(run, model)) for model in PAIR),
        ("Claims of FEM", claim),
    ]
    cells = [
        Cell(panel, i, j, f"{title}, {tool} mm, cells of {1e3 * edge:.3g} mm", partial(what, tool, edge), 1.0)
        for panel, (title, what) in enumerate(runs)
        for i, tool in enumerate(tools)
        for j, edge in enumerate(edges)
    ]
    rows = tuple(f"{1e3 * edge:.3g}" for edge in edges)
    return Map(
        "tools",
        "Tools against cells",
        f"Tools, by radius or edge, are pressed {1e3 * DEPTH:g} mm into a bonded block of 40 x 40 x 20 mm (E 20 kPa), "
        "between its nodes. "
        f"Accurate: the force is within {100 * BOUND:g} % of FEM's on cells of {1e3 * FINEST:.2g} mm. A claim is "
        f"accurate where {FACTOR:g} times the difference to cells twice as long is no less than the error.",
        tuple(Panel(title, "tool [mm]", "cell [mm]", tools, rows) for title, _ in runs),
        tuple(cells),
    )


def run(model: Model, tool: str, edge: float) -> Verdict:
    """One cell of forces."""
    return judge(pressed(model, tool, edge), truth(tool), BOUND, "force", "FEM on small cells")


def claim(tool: str, edge: float) -> Verdict:
    """One cell of claims; of the longest cells, which have no longer ones, the sibling's are half as long."""
    here, there = (pressed("fem", tool, each) for each in (edge, 2.0 * edge if edge < CELLS[0] else 0.5 * edge))
    right = truth(tool)
    claimed, error = FACTOR * abs(here.value - there.value) / right, abs(here.value - right) / right
    why = f"the force is off by {percent(error)}, and {percent(claimed)} is claimed"
    return Verdict("accurate" if claimed >= error else "inaccurate", why, error, told=here.told)


@cache
def truth(tool: str) -> float:
    """[N]"""
    return pressed("fem", tool, FINEST).value


@cache
def pressed(model: Model, tool: str, edge: float) -> Trace:
    """Press, and hold until it rests."""
    return follow(scene(model, tool, edge), lambda seen: float(seen.wrench["tool"][2]))


def scene(model: Model, tool: str, edge: float) -> dict[str, Any]:
    """Some viscosity lets it come to rest within the hold."""
    side, height, gap = 0.04, 0.02, 0.5e-3
    cells = [side / max(1, round(side / edge))] * 2 + [height / max(1, round(height / edge))]
    return {
        "softseam": 1,
        "name": "tools",
        "step": 0.01,
        "gravity": [0, 0, 0],
        "body": {
            "shape": {"kind": "block", "size": [side, side, height]},
            "cell": cells,
            "material": {
                "kind": "neo_hookean",
                "young": 2e4,
                "poisson": 0.4,
                "density": 1000.0,
                "retardation_time": 5e-3,
            },
            "fixed": [{"min": [-1, -1, -1e-3], "max": [1, 1, 1e-4]}],
        },
        "tools": {"tool": TOOLS[tool] | {"position": [*PLACE, height + gap + ABOVE[tool]], "friction": 0.3}},
        "motion": [{"tools": ["tool"], "move": [0, 0, -DEPTH - gap], "speed": SPEED}, {"hold": 0.1}],
        "regions": {"default": model},
    }
