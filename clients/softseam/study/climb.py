"""How a reference is refined: cells at the scene's step, then the step at nearly cubic cells about as fine as its own.

Refined until both are fine enough, or the next level would not end within the budget: what is left of that goes into
levels between those that are there, for where levels scatter more of them know more. Where the scene's step changes
much of what happens, cells are refined at a shorter one as well, and these count.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise, takewhile

import numpy as np

from softseam.errors import SoftseamError
from softseam.study.assemble import assemble
from softseam.study.errors import KNOWN, is_faint, is_nothing, largest_stress, rms
from softseam.study.frame import Frame
from softseam.study.ladder import COARSEST, Ladder, Rung
from softseam.study.measure import Told
from softseam.study.reference import TARGET, Reference
from softseam.study.richardson import RECENT, Limit

ACROSS = (COARSEST, *range(3, 15), 16, 20, 24, 28, 32)
"""cells along the body's shortest edge, level by level"""
LEAST_ROUND = 3
"""cells across the box around a ball that a reference begins with"""
STEPS_AT = 4
"""most cells along the shortest edge at which the step is refined"""
STEPS_CELLS = 220
"""and most cells in all, unless the coarsest level has more: steps are halved up to `HALVINGS` times"""
FEWEST = 3
"""levels without which there is no reference: one that fails after these ends the refining"""
DEAR = 300
"""cells that a level may solve for though a finer one solves for fewer"""
HALVINGS = 7
"""most halvings of the step"""
LEAST_HALVINGS = 3
"""steps are refined on so few cells that as many halvings fit the budget"""
MEDDLES = 0.03
"""a step that changes a quantity by more may change what cells do to it, too [1]"""
SHORT = 0.02
"""cells are then refined at the longest step that changes none by more [1]"""
CLEAR = 4
"""levels after which a quantity that approaches nothing is taken to have no limit: the coarsest three may scatter"""


Watch = Callable[[str, float], Told]
"""told what is computed now and its foreseen seconds; returns what is told of its progress"""


def climb(
    ladder: Ladder, frame: Frame, budget: float, watch: Watch, target: float = TARGET, known: float = KNOWN
) -> Reference:
    """Refine cells, then the step, until both are fine enough or the next level would not end within the budget, or
    fails: what coarser ones lead to is known.

    budget  own time of the ladder, without compiling [s]; levels from the cache cost nothing
    target  how uncertain the cells and the step may each leave a quantity [1]
    known   how uncertain a quantity may be that counts [1]
    """
    step, second = frame.scene.step, ladder.graded
    enough = True

    def take(across: float, step: float, share: float, of: Ladder = ladder) -> bool:
        spent = ladder.spent_in_all
        new = of.cached(across, step) is None
        foreseen = of.seconds(across, step) if new else 0.0
        if new and ladder.done and spent + foreseen > share * budget:
            return False
        told = None
        if new:
            kind = "" if of is ladder else " graded"
            told = watch(f"reference, {across:g}{kind} cells across, {1e3 * step:.4g} ms", foreseen)
        try:
            outcome = of.run(across, step, max(1.0, share * budget - spent), told)
        except SoftseamError:
            if len(ladder.done) < FEWEST:
                raise
            return False
        return outcome.status == "done"

    def halvings(across: float) -> float:
        """Foreseen seconds of as many as an order needs."""
        steps = (step / 2**k for k in range(1, LEAST_HALVINGS + 1))
        return sum(ladder.seconds(across, each) for each in steps if ladder.cached(across, each) is None)

    cells: list[float] = []
    for across in levels_of(frame):
        # what the steps will need is kept back, and what a second family will
        if not take(across, step, 0.85 if second is None else 0.5):
            enough = False
            break
        cells.append(across)
        if len(cells) > 2 and fine(ladder.limits([(a, step) for a in cells]), target, len(cells)):
            second = None
            break
    if not cells:
        raise SoftseamError(f"the coarsest reference takes longer than {budget:.0f} s: give more --minutes")
    few = sorted((across for across in cells if across <= steps_at(frame)), reverse=True)
    at = next((across for across in few if halvings(across) <= budget - ladder.spent_in_all), cells[0])
    steps = [step]
    for halving in range(1, HALVINGS + 1):
        if not take(at, step / 2**halving, 1.0 if second is None else 0.75):
            enough = False
            break
        steps.append(step / 2**halving)
        if len(steps) > 2 and fine(ladder.limits([(at, s) for s in steps]), target, len(steps)):
            break
    by_steps = [(at, s) for s in steps]
    base, short = step, short_enough(ladder, by_steps)
    if short < step:
        anew: list[float] = list(takewhile(lambda a: take(a, short, 1.0), levels_of(frame)))
        if len(anew) >= RECENT:
            cells, base = anew, short
    thinner = [] if second is None else climb_graded(second, frame, base, lambda a: take(a, base, 1.0, second))
    if not enough:
        cells = with_halves(ladder, frame, cells, lambda a: take(a, base, 1.0))
    return assemble(ladder, [(a, base) for a in cells], by_steps, enough, target, known, thinner)


def short_enough(ladder: Ladder, rungs: Sequence[Rung]) -> float:
    """The step [s] to refine cells with, of levels of ever shorter steps on the same cells: the first one's, unless it
    changes more of a quantity than `MEDDLES`; then the first that changes no more than `SHORT`."""
    time, finest = ladder.common(rungs), ladder.series(rungs[-1])
    sizes = {name: rms(finest.at(name, time), time) for name in finest.values}
    names = _waited_for(sizes, largest_stress(sizes))

    def changes(rung: Rung) -> float:
        series = ladder.series(rung)
        return max((rms(series.at(n, time) - finest.at(n, time), time) / sizes[n] for n in names), default=0.0)

    enough = SHORT if changes(rungs[0]) > MEDDLES else MEDDLES
    return next(step for across, step in rungs if changes((across, step)) <= enough)


def with_halves(ladder: Ladder, frame: Frame, taken: Sequence[float], take: Callable[[float], bool]) -> list[float]:
    """Levels that were taken, and those half-way between two of them that there is time to `take`, finest first, by
    the size of their cells. None where levels divide the coarsest's cells alike: others would jump."""
    if any(frame.borders) and all(refines(frame, across) for across in taken):
        return list(taken)

    def size(across: float) -> float:
        return float(f"{frame.size(ladder.counts(across)):.9g}")

    sizes = {size(across): across for across in reversed(taken)}
    for coarse, finer in sorted(pairwise(sorted(taken)), reverse=True):
        half = 0.5 * (coarse + finer)
        if size(half) not in sizes and take(half):
            sizes[size(half)] = half
    return [sizes[each] for each in sorted(sizes, reverse=True)]


def climb_graded(second: Ladder, frame: Frame, step: float, take: Callable[[float], bool]) -> list[Rung]:
    """Levels of the second family for as long as there is time to `take` one, each of more cells than all before.

    Thin cells may fail where equal ones do not. That ends this family, and not the reference.
    """

    def taken(across: float) -> bool:
        try:
            return take(across)
        except SoftseamError:
            return False

    # two cells that are thinner towards both faces are equal ones, however graded
    different = {second.counts(a): a for a in reversed(levels_of(frame)) if a > COARSEST or frame.towards}
    found: list[Rung] = []
    for across in with_halves(second, frame, list(takewhile(taken, sorted(different.values()))), taken):
        rung = (across, step)
        # between planes, more across are not always more
        if not found or second.level(*rung).n_cells > second.level(*found[-1]).n_cells:
            found.append(rung)
    return found


def levels_of(frame: Frame) -> tuple[int, ...]:
    """Cells across the coarsest level and finer ones, no two of which are the same cells.

    Where materials meet in planes, every level divides the coarsest's cells alike, if four levels do: others would
    have other shapes on either side of a border, and levels would jump back and forth. And none that solves for many
    cells, and for more of them than a finer one does, which folds.
    """
    different = tuple({frame.level(across): across for across in ACROSS}.values())
    if frame.ball is not None:
        # with two cells across the box forces and sag still go to and fro
        different = tuple(across for across in different if frame.across_ball(frame.level(across)) >= LEAST_ROUND)
    alike = tuple(across for across in different if refines(frame, across))
    found = alike if len(alike) > 3 else different
    solved = [frame.n_solved(frame.level(across)) for across in found]
    return tuple(a for k, a in enumerate(found) if solved[k] <= max(DEAR, min(solved[k + 1 :], default=np.inf)))


def refines(frame: Frame, across: float) -> bool:
    """Whether this level divides the coarsest's cells alike."""
    return frame.refines(frame.level(across), frame.level(COARSEST))


def steps_at(frame: Frame) -> int:
    """Cells along the shortest edge at which the step is refined: as many as cost little, for what a step does to few
    cells it need not do to many (docs/decisions/36)."""
    few = (across for across in range(STEPS_AT, COARSEST, -1) if frame.n_cells(frame.level(across)) <= STEPS_CELLS)
    return next(few, COARSEST)


def fine(limits: Mapping[str, Limit], target: float, n_levels: int) -> bool:
    """Whether every quantity that has a limit is known to the target, and it is clear which have.

    Slip is not waited for where there are others: its scale, the tools' way, is not known here, and it hardly ever
    decides.
    """
    sizes = {name: float(np.sqrt(np.mean(found.value**2))) for name, found in limits.items()}
    stress = largest_stress({name: size for name, size in sizes.items() if limits[name].converges})
    for name in _waited_for(sizes, stress):
        found = limits[name]
        if (found.converges or n_levels < CLEAR) and found.uncertainty > target * sizes[name]:
            return False
    return True


def _waited_for(sizes: Mapping[str, float], stress: float) -> list[str]:
    """Quantities that are neither nothing nor faint beside the largest stress [Pa], nor slip, but where it is alone."""
    every = [name for name in sizes if not is_nothing(name, sizes[name]) and not is_faint(name, sizes[name], stress)]
    return [name for name in every if name != "slip"] or every
