"""How a reference is refined: cells at the scene's step, then the step at few cells.

Refined until both are fine enough, or the next level would not end within the budget.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from softseam.columns import is_nothing, unit_of
from softseam.errors import SoftseamError
from softseam_studies.study.errors import KNOWN, is_faint, largest_stress
from softseam_studies.study.levels import Levels, Resolution, Watch
from softseam_studies.study.reference import TARGET, Reference, counted, joined
from softseam_studies.study.richardson import Limit

STEPS_AT, STEPS_CELLS = 4, 220
"""most cells along the shortest edge, and in all, at which the step is refined, unless the coarsest level has more"""
HALVINGS, LEAST_HALVINGS = 7, 3
"""most halvings of the step; it is refined on so few cells that so many fit the budget"""
FEWEST = 3
"""levels without which there is no reference: one that fails after these ends the refining"""
CLEAR = 4
"""levels after which a quantity that approaches nothing is taken to have no limit: the coarsest three may scatter"""
CELLS_SHARE = 0.8
"""of the budget, for cells: the steps need the rest [1]"""


def refine(levels: Levels, budget: float, watch: Watch, target: float = TARGET, known: float = KNOWN) -> Reference:
    """Refine cells, then the step, until both are fine enough or the next level would not end within the budget, or
    fails: what coarser ones lead to is known.

    budget  processor time of the levels, without compiling [s]; those from the cache cost nothing
    target  how uncertain the cells and the step may each leave a quantity [1]
    known   how uncertain a quantity may be that counts [1]
    """
    step, enough = levels.frame.scene.step, True

    def take(across: float, step: float, share: float) -> bool:
        new, left = levels.cached(across, step) is None, share * budget - levels.spent
        foreseen, deadline = levels.seconds(across, step), levels.deadline
        late = deadline is not None and not deadline.fits(foreseen, (1.0 - share) * budget)
        if new and levels.done and (late or foreseen > left):
            return False
        report = watch(f"reference: {levels.configuration(across, step).label}", foreseen) if new else None
        try:
            return levels.run(across, step, max(1.0, left), report).status == "done"
        except SoftseamError:
            if len(levels.done) < FEWEST:
                raise
            return False

    cells: list[float] = []
    for across in levels.sequence():
        if not take(across, step, CELLS_SHARE):
            enough = False
            break
        cells.append(across)
        if len(cells) > 2 and fine(levels.limits([(a, step) for a in cells]), target, len(cells)):
            break
    if not cells:
        raise SoftseamError(f"the coarsest reference takes longer than {budget:.0f} s: give more --minutes")
    few = [a for a in cells if a <= STEPS_AT and levels.n_cells(a) <= STEPS_CELLS]
    in_all = 2.0 ** (LEAST_HALVINGS + 1) - 2.0  # runs' lengths of so many halvings
    fits = (a for a in reversed(few) if in_all * levels.seconds(a, step) <= budget - levels.spent)
    at, steps = next(fits, cells[0]), [step]
    for halving in range(1, HALVINGS + 1):
        if not take(at, step / 2**halving, 1.0):
            enough = False
            break
        steps.append(step / 2**halving)
        if len(steps) > 2 and fine(levels.limits([(at, s) for s in steps]), target, len(steps)):
            break
    by_steps = [(at, s) for s in steps]
    return assemble(levels, [(a, step) for a in cells], by_steps, enough, target, known)


def assemble(
    levels: Levels,
    by_cells: Sequence[Resolution],
    by_steps: Sequence[Resolution],
    enough: bool,
    target: float = TARGET,
    known: float = KNOWN,
) -> Reference:
    """The reference that levels refined in cells and others refined in steps lead to, one of them that of the cells."""
    time = levels.common([*by_cells, *by_steps])
    by_cell = levels.limits(by_cells, time)
    if levels.sequence() == (1,):
        by_cell = {
            name: replace(found, uncertainty=0.0) for name, found in by_cell.items()
        }  # nothing is coarser or finer
    found = joined(
        time,
        by_cell,
        levels.limits(by_steps, time),
        finest=levels.series(by_cells[-1]),
        base=levels.series(next(each for each in by_steps if each[1] == by_cells[0][1])),
        levels=tuple(levels.level(*each) for each in dict.fromkeys([*by_cells, *by_steps])),
        integrator=levels.integrator,
        complete=enough,
    )
    return counted(found, levels.names, target, known)


def fine(limits: Mapping[str, Limit], target: float, n_levels: int) -> bool:
    """Whether every quantity that has a limit is known to the target, and it is clear which have: of stress, for forces
    and ways have one."""
    sizes = {name: float(np.sqrt(np.mean(found.value**2))) for name, found in limits.items()}
    stress = largest_stress({name: size for name, size in sizes.items() if limits[name].converges})
    return all(
        limits[name].uncertainty <= target * sizes[name]
        or not (limits[name].converges or n_levels < CLEAR or unit_of(name) != "Pa")
        for name in _waited_for(sizes, stress)
    )


def _waited_for(sizes: Mapping[str, float], stress: float) -> list[str]:
    """Quantities that are neither nothing nor faint beside the largest stress [Pa]. Slip, which errs relative to the
    tools' way, hardly ever decides, and is not waited for unless it is alone."""
    every = [name for name in sizes if not is_nothing(name, sizes[name]) and not is_faint(name, sizes[name], stress)]
    return [name for name in every if name != "slip"] or every
