"""A reference from its levels. What cells and steps leave adds up,

    J_ref = lim_h J(h, dt) + [lim_dt J(h', dt') - J(h', dt)],

and so does what either limit may be off by (richardson.py). Where there are levels of graded cells, too, the first
limit is that of both families together (scatter.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from softseam.errors import SoftseamError
from softseam.study.errors import (
    FAINT,
    KNOWN,
    Truth,
    is_faint,
    is_hardly_known,
    is_nothing,
    largest_stress,
    rms,
    scale_of,
)
from softseam.study.ladder import Ladder, Rung
from softseam.study.reference import TARGET, Part, Reference, in_words
from softseam.study.richardson import RECENT
from softseam.study.scatter import together

NEAR = 0.2
"""levels that went by less than this share of what a quantity has to be known to are near enough, fall or not [1]"""
_DISAGREE = "not known: its levels disagree"


def assemble(
    ladder: Ladder,
    by_cells: Sequence[Rung],
    by_steps: Sequence[Rung],
    enough: bool,
    target: float = TARGET,
    known: float = KNOWN,
    graded: Sequence[Rung] = (),
) -> Reference:
    """The reference that levels refined in cells, and others refined in steps, one of them that of the cells, lead to.

    graded: levels of the ladder's second family
    """
    second = ladder.graded if len(graded) >= RECENT else None
    time = ladder.common([*by_cells, *by_steps])
    if second is not None:
        time = time[time <= second.common(graded)[-1] + 1e-9]
    finest = ladder.series(by_cells[-1])
    cells, steps = ladder.limits(by_cells, time), ladder.limits(by_steps, time)
    if second is not None:
        thinner = second.limits(graded, time)
        cells = {name: together(one, thinner[name], lambda values: rms(values, time)) for name, one in cells.items()}
    travel = np.interp(time, finest.time, finest.travel)
    base = ladder.series(next(rung for rung in by_steps if rung[1] == by_cells[0][1]))
    truth: dict[str, Truth] = {}
    parts: dict[str, Part] = {}
    for name, by_cell in cells.items():
        by_step = steps[name]
        # relative uncertainties so far; the limit's own norm is the scale
        values = by_cell.value + (by_step.value - base.at(name, time))
        scale = scale_of(name, values, travel, time)
        if is_nothing(name, scale):
            continue
        part = parts[name] = Part(
            by_cell.uncertainty / scale,
            by_step.uncertainty / scale,
            by_cell.order,
            by_step.order,
            rms(by_cell.value - finest.at(name, time), time) / scale,
            by_cell.converges,
        )
        truth[name] = Truth(values, scale, part.uncertainty)
    levels = [ladder.level(*rung) for rung in dict.fromkeys([*by_cells, *by_steps])]
    if second is not None:
        levels += [second.level(*rung) for rung in graded]
    nothing = tuple(name for name in cells if name not in truth)
    found = Reference(time, truth, parts, tuple(levels), ladder.integrator, enough, nothing)
    return counted(found, truth, target, known)


def counted(found: Reference, names: Iterable[str], target: float = TARGET, known: float = KNOWN) -> Reference:
    """The reference of these quantities, and which of them count where one has to be known to so much to do so.

    Complete is what was before, and leaves no quantity that counts more uncertain than twice the target.
    """
    truth = {name: found.truth[name] for name in names if name in found.truth}
    if not truth:
        raise SoftseamError("every quantity of the scene is zero: there is nothing to compare")
    parts, enough = {name: found.parts[name] for name in truth}, found.complete
    stress = largest_stress({name: true.scale for name, true in truth.items() if parts[name].converges})
    for name, true in truth.items():
        part, why = parts[name], ""
        has_limit = part.converges or part.uncertainty_cells <= NEAR * known
        if is_faint(name, true.scale, stress):
            has_limit, why = False, f"below {100 * FAINT:g} % of the largest stress"
        elif not has_limit:
            why = "no limit: it grows with every refinement"
        elif part.uncertainty > known:
            why = f"known to {in_words(part.uncertainty)} only" if part.uncertainty < 1.0 else _DISAGREE
            why += ", and perhaps without a limit" if is_hardly_known(name, part.uncertainty) else ""
        truth[name] = replace(true, left_out=why, has_limit=has_limit)
    if all(true.left_out for true in truth.values()):
        truth = {name: replace(true, left_out="", has_limit=True) for name, true in truth.items()}
        enough = False
    complete = enough and all(t.uncertainty <= 2 * target for t in truth.values() if not t.left_out)
    return replace(found, truth=truth, parts=parts, complete=complete)
