"""Forces of FEM and XPBD on ever shorter cells, and what FEM claims there: what maps of tools and shapes share."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from softseam.claims.claim import Scale
from softseam_studies.atlas.maps.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import FEM, MODELS, PAIR, Model
from softseam_studies.atlas.trace import Trace
from softseam_studies.atlas.verdicts import Verdict, judge, percent

BOUND = 0.1
"""largest relative error of an accurate force [1]"""
MATERIAL: dict[str, str | float] = {
    "kind": "neo_hookean",
    "young": 2e4,
    "poisson": 0.4,
    "density": 1000.0,
    "retardation_time": 5e-3,
}
"""of every body; some viscosity lets it come to rest within a short hold"""
CLAIM_HOLDS = "A claim, by the difference to cells twice as long, is accurate where it is no less than the error."


@dataclass(frozen=True)
class ByCells:
    """Forces between a tool and a body, by what is varied and by edge of the cells."""

    force: Callable[[Model, str, float], Trace]
    """of a model, what is varied, and an edge; remembered by whoever gives it"""
    quantity: str
    """what a report calls it, by which its claims go"""
    edges: tuple[float, ...]
    """of the rows, from the longest"""
    finest: float
    """the edge of the truth, which is FEM's"""

    def map(
        self, name: str, title: str, text: str, columns: tuple[str, ...], axes: tuple[str, str], seconds: float
    ) -> Map:
        """A panel of forces for each model and one of claims; `axes` name columns and rows, `seconds` a run's time."""
        runs: list[tuple[str, Callable[[str, float], Verdict]]] = [
            *((f"{MODELS[model]}: force", partial(self.run, model)) for model in PAIR),
            ("Claims of FEM", self.claim),
        ]
        rows = tuple(f"{edge:.3g}" for edge in self.edges)
        cells = [
            Cell(panel, i, j, f"{head}, {axes[0]} {column}, {axes[1]} {row}", partial(what, column, edge), seconds)
            for panel, (head, what) in enumerate(runs)
            for i, column in enumerate(columns)
            for j, (row, edge) in enumerate(zip(rows, self.edges, strict=True))
        ]
        return Map(name, title, text, tuple(Panel(head, *axes, columns, rows) for head, _ in runs), tuple(cells))

    def run(self, model: Model, column: str, edge: float) -> Verdict:
        """One cell of forces."""
        return judge(self.force(model, column, edge), self.truth(column), BOUND, "force", "FEM on small cells")

    def claim(self, column: str, edge: float) -> Verdict:
        """One cell of claims; of the longest cells, which have no longer ones, the sibling's are half as long."""
        sibling = 2.0 * edge if edge < self.edges[0] else 0.5 * edge
        here, there = (self.force(FEM, column, each) for each in (edge, sibling))
        right = self.truth(column)
        scale = Scale(alike=True, taken=0.0, finer=sibling < edge).at(self.quantity)
        claimed = scale.claim(abs(here.value - there.value), right, 0.0) / right
        error = abs(here.value - right) / right
        why = f"the force is off by {percent(error)}, and {percent(claimed)} is claimed"
        return Verdict("accurate" if claimed >= error else "inaccurate", why, error, warned=here.warned)

    def truth(self, column: str) -> float:
        """[N]"""
        return self.force(FEM, column, self.finest).value
