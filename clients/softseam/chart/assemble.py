"""A reference from its levels. What cells and steps leave adds up,

    J_ref = lim_h J(h, dt) + [lim_dt J(h', dt') - J(h', dt)],

and so does what either limit may be off by (richardson.py).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softseam.chart.errors import FAINT, KNOWN, Truth, is_faint, is_nothing, largest_stress, rms, scale_of
from softseam.chart.ladder import Ladder, Rung
from softseam.chart.reference import TARGET, Part, Reference, in_words
from softseam.errors import SoftseamError

NEAR = 0.2
"""levels that went by less than this share of what a quantity has to be known to are near enough, fall or not [1]"""


def assemble(
    ladder: Ladder,
    by_cells: Sequence[Rung],
    by_steps: Sequence[Rung],
    enough: bool,
    target: float = TARGET,
    known: float = KNOWN,
) -> Reference:
    """The reference that levels refined in cells, and others refined in steps, lead to."""
    time = ladder.common([*by_cells, *by_steps])
    finest = ladder.series(by_cells[-1])
    cells, steps = ladder.limits(by_cells, time), ladder.limits(by_steps, time)
    travel = np.interp(time, finest.time, finest.travel)
    truth: dict[str, Truth] = {}
    parts: dict[str, Part] = {}
    stress = largest_stress({name: rms(by_cell.value, time) for name, by_cell in cells.items() if by_cell.converges})
    for name, by_cell in cells.items():
        by_step = steps[name]
        # relative uncertainties so far; the limit's own norm is the scale
        values = by_cell.value + (by_step.value - ladder.series(by_steps[0]).at(name, time))
        scale = scale_of(name, values, travel, time)
        if is_nothing(name, scale):
            continue
        part = Part(
            by_cell.uncertainty / scale,
            by_step.uncertainty / scale,
            by_cell.order,
            by_step.order,
            rms(by_cell.value - finest.at(name, time), time) / scale,
        )
        uncertainty = part.uncertainty_cells + part.uncertainty_steps
        why = ""
        has_limit = by_cell.converges or part.uncertainty_cells <= NEAR * known
        if is_faint(name, scale, stress):
            has_limit, why = False, f"below {100 * FAINT:g} % of the largest stress"
        elif not has_limit:
            why = "no limit: finer cells change it by as much as coarser ones did"
        elif uncertainty > known:
            why = f"known to {in_words(uncertainty)} only" if uncertainty < 1.0 else "not known: its levels disagree"
        truth[name], parts[name] = Truth(values, scale, uncertainty, why, has_limit), part
    if not truth:
        raise SoftseamError("every quantity of the scene is zero: there is nothing to compare")
    if all(true.left_out for true in truth.values()):
        truth = {name: Truth(t.values, t.scale, t.uncertainty) for name, t in truth.items()}
        enough = False
    levels = tuple(ladder.level(*level) for level in dict.fromkeys([*by_cells, *by_steps]))
    complete = enough and all(t.uncertainty <= 2 * target for t in truth.values() if not t.left_out)
    return Reference(time, truth, parts, levels, ladder.integrator, complete)
