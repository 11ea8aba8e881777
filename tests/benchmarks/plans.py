"""Is a plan right? Each scene is charted, and planned for several tolerances from the chart's own runs.

The planner stops refining its reference where a tolerance lets it, and stops trying where nothing can be faster. Here
its choice is held against the whole sweep and the best reference: the error that it really has, and how much faster
the fastest configuration is that meets the tolerance. `python tests/benchmarks/plans.py [SCENE ...]`; a scene takes
some minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from softseam.chart.command import Wishes, chart, quantity_names
from softseam.chart.configurations import Configuration, configurations, frame_of
from softseam.chart.measure import Outcome, Told
from softseam.chart.reference import Ladder, climb
from softseam.embedded import solver_digest
from softseam.plan.planner import REFERENCE, Goal, NoPlan, choose, judged
from softseam.scenes import bundle_of
from softseam.variants import AS_GIVEN, with_settings

SCENES = ("tofu_grasp", "tofu_push", "tofu_drop", "silken_tofu", "cantilever", "sausage_bend", "tofu_pads")
TOLERANCES = (0.2, 0.1, 0.05, 0.02)
MINUTES = 6.0


def _silent(text: str, seconds: float) -> Told:
    return lambda done: None


def plans_of(name: str, table: Table, console: Console) -> tuple[int, int, int]:
    """Rows of a scene; how many plans were made, met their tolerance, and cost at most 1.5 times the least."""
    rows, best = chart(Wishes(name, minutes=MINUTES, out=Path("out") / f"plans-{name}"), console)
    scene = with_settings(bundle_of(name)[0], AS_GIVEN)
    frame = frame_of(scene, name, AS_GIVEN)
    outcomes = {row.configuration.key: row.outcome for row in rows}
    wanted = [c for c in configurations(frame) if c.key in outcomes]
    truth = {c.key: judged(c, outcomes[c.key], best) for c in wanted}
    ladder = Ladder(name, AS_GIVEN, frame, quantity_names(scene))
    ladder.open(solver_digest(), fresh=False)
    n_made = n_met = n_cheap = 0
    for tolerance in TOLERANCES:
        asked: list[str] = []

        def measured(configuration: Configuration, asked: list[str] = asked) -> Outcome:
            asked.append(configuration.key)
            return outcomes[configuration.key]

        fast = [one.rtf for one in truth.values() if one.error - best.uncertainty <= tolerance]
        reference = climb(ladder, frame, 1e-3, _silent, 0.5 * REFERENCE * tolerance)
        goal = f"{100 * tolerance:g} %"
        try:
            plan = choose(Goal(tolerance), reference, wanted, measured)
        except NoPlan as error:
            table.add_row(name, goal, "none", "", "", "", str(error)[:60])
            continue
        true = next(truth[c.key] for c in wanted if c.settings == plan.choice.settings)
        ratio = max(fast, default=true.rtf) / true.rtf
        n_made += 1
        n_met += true.error - best.uncertainty <= tolerance
        n_cheap += ratio <= 1.5
        off, tried = f"{100 * true.error:.2g} %", f"{len(asked)} tried"
        table.add_row(name, goal, plan.choice.label, f"{true.rtf:.3g}", off, f"{ratio:.2f}", tried)
    return n_made, n_met, n_cheap


def main() -> None:
    console = Console(width=150)
    table = Table(box=None, padding=(0, 2))
    for column in ("scene", "tolerance", "choice", "RTF", "error, at most", "fastest / choice", ""):
        table.add_column(column)
    counts = [plans_of(name, table, Console(stderr=True)) for name in sys.argv[1:] or SCENES]
    console.print(table)
    made, met, cheap = (sum(count) for count in zip(*counts, strict=True))
    console.print(f"{made} plans: {met} meet their tolerance, {cheap} cost at most 1.5 times the least")


if __name__ == "__main__":
    main()
