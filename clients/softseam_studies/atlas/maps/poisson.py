"""Poisson's ratio against the element: who locks. Uncured low orders are there to be seen to fail."""

from functools import cache, partial
from typing import Any

from softseam.observation import Observation
from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.kinds import ElementKind
from softseam_studies.atlas.maps.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import FEM, YOUNG
from softseam_studies.atlas.trace import Trace, follow
from softseam_studies.atlas.verdicts import Verdict, judge

ELEMENTS: tuple[ElementKind, ...] = tuple(reversed(list(FACTS)))
CONTROLS: tuple[ElementKind, ...] = ("hex8_full", "tet4")
"""elements without a cure"""
BOUND = 0.05


def build(
    ratios: tuple[float, ...] = (0.3, 0.4, 0.45, 0.49, 0.499, 0.4999), elements: tuple[ElementKind, ...] = ELEMENTS
) -> Map:
    """The map; a smaller one for tests."""
    cells = [
        Cell(
            panel,
            i,
            j,
            f"{title}, {element}, nu {ratio:g}",
            partial(run, element, ratio, bends),
            0.2,
            element in CONTROLS,
        )
        for panel, (title, bends) in enumerate((("bending", True), ("bonded squeeze", False)))
        for i, ratio in enumerate(ratios)
        for j, element in enumerate(elements)
    ]
    columns = tuple(f"{ratio:g}" for ratio in ratios)
    rows = tuple(f"{element} (control)" if element in CONTROLS else element for element in elements)
    return Map(
        "poisson",
        "Poisson's ratio against the element",
        "FEM at rest on cells of 20 mm (eight linear hexahedra or 48 linear tetrahedra in each): a cantilever of 3 x 1 "
        "x 1 cells under its own weight, and a cube of 2 x 2 x 2 bonded to plates and squeezed by 5 %. Accurate: tip "
        f"or force within {100 * BOUND:g} % of hex27 on cells a third (tip) or half (force) as long. "
        "Where tet10 is 100 % off it found no force: held to the plates by friction, the corners of its faces come to "
        "no rest at ratios near 1/2 (decision 19).",
        (
            Panel("Cantilever: deflection of the tip", "Poisson's ratio", "element", columns, rows),
            Panel("Bonded squeeze: force", "Poisson's ratio", "", columns, rows),
        ),
        tuple(cells),
    )


def run(element: ElementKind, ratio: float, bends: bool) -> Verdict:
    """One cell."""
    truth = reference(ratio, bends)
    what = "deflection" if bends else "force"
    source = f"hex27 on cells {'a third' if bends else 'half'} as long"
    return judge(solve(element, ratio, bends, 1), truth, BOUND, what, source)


@cache
def reference(ratio: float, bends: bool) -> float:
    """Deflection [m] or force [N] of hex27 on fine cells."""
    return solve("hex27", ratio, bends, 3 if bends else 2).value


def solve(element: str, ratio: float, bends: bool, refine: int) -> Trace:
    """Settle one of the two bodies, on cells divided by `refine`."""
    return follow(
        cantilever(element, ratio, refine) if bends else bonded(element, ratio, refine), _tip if bends else _push
    )


def cantilever(element: str, ratio: float, refine: int) -> dict[str, Any]:
    """60 x 20 x 20 mm, clamped at x = 0; the tip sinks by some 5 % of the length."""
    size, edge = [0.06, 0.02, 0.02], 0.02 / refine
    return _scene(element, ratio, size, [edge] * 3, [{"min": [-1, -1, -1], "max": [-0.0299, 1, 1]}]) | {
        "gravity": [0, 0, -9.81],
        "duration": 0.1,
        "quantities": ["tip_deflection"],
    }


def bonded(element: str, ratio: float, refine: int) -> dict[str, Any]:
    """A cube of 40 mm, its base clamped, its top held by the friction of a plate that comes down by 5 %."""
    edge = 0.02 / refine
    scene = _scene(element, ratio, [0.04] * 3, [edge] * 3, [{"min": [-1, -1, -1], "max": [1, 1, 1e-6]}])
    plate = {"kind": "box", "size": [0.1, 0.1, 0.02], "position": [0, 0, 0.05], "friction": 100.0}
    return scene | {
        "gravity": [0, 0, 0],
        "tools": {"plate": plate},
        "motion": [{"tools": ["plate"], "move": [0, 0, -0.002], "speed": 0.01}, {"hold": 0.2}],
    }


def _scene(element: str, ratio: float, size: list[float], cell: list[float], fixed: list[Any]) -> dict[str, Any]:
    return {
        "softseam": 1,
        "name": "poisson",
        "step": 0.1,
        "body": {
            "shape": {"kind": "block", "size": size},
            "cell": cell,
            "material": {"kind": "neo_hookean", "young": YOUNG, "poisson": ratio, "density": 1000.0},
            "fixed": fixed,
        },
        "regions": {"default": FEM},
        "models": {FEM: {"element": element, "integrator": "static"}},
    }


def _tip(observation: Observation) -> float:
    return observation.quantities.get("tip_deflection", float("nan"))


def _push(observation: Observation) -> float:
    return float(observation.wrench["plate"][2])
