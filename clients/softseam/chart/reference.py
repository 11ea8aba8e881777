"""A scene's reference: FEM alone on ever finer cells and steps, and how far its limit is known.

Cells are refined at the scene's step, steps at nearly cubic cells about as fine as the scene's own, which are moderate.
The two errors add up,

    J_ref = lim_h J(h, dt) + [lim_dt J(h', dt') - J(h', dt)],

and so do the uncertainties (richardson.py). Every level is kept as soon as it is done, so an interrupted reference
goes on where it was, and a later one with more time refines what is there.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.chart.configurations import Configuration, Frame, fem_one, fem_seconds, fem_settings, is_viscous
from softseam.chart.errors import KNOWN, Truth, is_nothing, largest_stress, rms, scale_of
from softseam.chart.measure import Outcome, Told, measure
from softseam.chart.richardson import Limit, limit
from softseam.chart.series import Series
from softseam.chart.store import Identity, Store
from softseam.errors import SoftseamError
from softseam.scenes import bundle_of
from softseam.variants import with_settings
from softseam_protocol.scene import Scene
from softseam_protocol.scene_file import bundle_scene, scene_hash

Floats = NDArray[np.float64]

ACROSS = (2, 3, 4, 6, 8, 12, 16)
"""cells along the body's shortest edge, level by level"""
BETWEEN = {6: 5, 8: 7, 12: 10, 16: 14}
"""level that is taken in place of one that would not end within the budget: the last one, then"""
STEPS_AT = 3
"""cells along the shortest edge at which the step is refined, where the scene leaves its cells to the solver"""
FINEST_STEPS_AT = 4
"""and the most of them: steps are halved up to `HALVINGS` times, which is for moderate cells"""
HALVINGS = 7
"""most halvings of the step"""
CLEAR = 4
"""levels after which a quantity that approaches nothing is taken to have no limit: the coarsest three may scatter"""
SCATTER = 0.2
"""levels that differ by less than this share of what a quantity has to be known to are near enough, fall or not [1]"""
TARGET = 0.005
"""refined until the cells and the step each leave less than this uncertain: together less than 1 % [1]"""
GROWTH = (1.2, 2.4)
"""bounds of the power of the number of cells that the cost of the next level is foreseen with"""


@dataclass(frozen=True)
class Level:
    """One computation of the ladder."""

    across: int
    step: float
    """[s]"""
    n_cells: int
    n_nodes: int
    seconds: float
    """time of its run [s]"""


@dataclass(frozen=True)
class Part:
    """How a quantity's limit came about."""

    uncertainty_cells: float
    """relative to the quantity's scale [1]"""
    uncertainty_steps: float
    """[1]"""
    order_cells: float
    """NaN where none was found"""
    order_steps: float
    extrapolated: float
    """norm of what the limit differs from the finest cells by, relative to the scale [1]"""


@dataclass(frozen=True)
class Reference:
    """What every run is compared with."""

    time: Floats
    """common times (n,) [s]"""
    truth: Mapping[str, Truth]
    parts: Mapping[str, Part]
    levels: tuple[Level, ...]
    integrator: str
    complete: bool
    """whether every quantity that has a limit is known as well as was asked for"""

    @property
    def counted(self) -> list[str]:
        """Quantities that count in the accuracy."""
        return [name for name, true in self.truth.items() if not true.left_out]

    @property
    def uncertainty(self) -> float:
        """The worst of the quantities that count [1]."""
        return max(self.truth[name].uncertainty for name in self.counted)


class Ladder:
    """Computes, or reads from the cache, the levels of a scene's reference."""

    def __init__(self, name: str | Path | Scene, settings: Sequence[str], frame: Frame, names: tuple[str, ...]) -> None:
        self._name, self._settings, self._frame, self._names = name, tuple(settings), frame, names
        # an undamped body swings on, which implicit Euler would have to resolve with very short steps
        free = "midpoint" if is_viscous(frame.scene) else "bdf2"
        self.integrator = "implicit_euler" if frame.scene.tools else free
        self._store: Store | None = None
        self.done: dict[tuple[int, float], Outcome] = {}
        self.spent = 0.0
        """own time of the levels that were not in the cache [s]"""

    def open(self, code: str, *, fresh: bool) -> None:
        """Use the cache: levels of the same body, tools and motion, computed by the same code."""
        scene, bundle = bundle_of(self._name)
        coarsest = with_settings(with_settings(scene, self._settings), self._level(ACROSS[0], self._frame.scene.step))
        key = scene_hash(bundle_scene(coarsest, bundle.files))
        folder = cache_folder() / f"{scene.name}-{key[:12]}-{code[:8]}"  # another version begins anew
        self._store = Store(folder, Identity(key, code), "compute the reference anew with --fresh")
        if fresh:
            self._store.clear()

    def seconds(self, across: int, step: float) -> float:
        """Foreseen wall time of a level that is not done [s]."""
        rough = fem_seconds(self._frame, self._frame.across(across), step)
        known = sorted((a, s) for a, s in self.done if a <= across)
        if not known:
            return rough
        at = known[-1]
        cells, before = (float(np.prod(self._frame.across(a))) for a in (across, at[0]))
        power = GROWTH[1]
        if len({a for a, _ in known}) > 1:
            lower = next(k for k in reversed(known) if k[0] < at[0])
            fewer = float(np.prod(self._frame.across(lower[0])))
            paid, less = self._paid(at) / at[1] ** -1, self._paid(lower) / lower[1] ** -1
            power = float(np.clip(np.log(paid / less) / np.log(before / fewer), *GROWTH))
        return float(self._paid(at) * (cells / before) ** power * at[1] / step)

    def run(self, across: int, step: float, limit_s: float, told: Told | None = None) -> Outcome:
        """A level, from the cache where it is there. Raises SoftseamError where it cannot be computed."""
        found = self.cached(across, step)
        if found is None:
            found = measure(
                self._name,
                (*self._settings, *self._level(across, step)),
                self._names,
                runs=0,
                limit=limit_s,
                length=self._frame.length,
                told=told,
                # at the common times, all: what is looked at every few steps would differ by where that falls
                look=max(1, round(self._frame.scene.step / step)),
            )
            self.spent += found.spent
            if found.status in ("refused", "failed"):
                raise SoftseamError(f"the reference cannot be computed on {across} cells across: {found.reason}")
            if found.status == "done":
                assert self._store is not None
                self._store.write(self._file(across, step), found.as_json())
        if found.status == "done":
            self.done[across, step] = found
        return found

    def tried(self) -> list[tuple[Configuration, Outcome]]:
        """Levels that are done, as configurations that a plan may choose: nothing else is as fine."""
        frame, how = self._frame, self.integrator
        return [
            (fem_one(frame, frame.across(across), step, integrator=how), outcome)
            for (across, step), outcome in sorted(self.done.items())
        ]

    def cached(self, across: int, step: float) -> Outcome | None:
        """A level that was computed before."""
        assert self._store is not None
        name = self._file(across, step)
        data = self._store.read(name)
        if data is None:
            return None
        try:
            return Outcome.from_json(data)
        except (KeyError, TypeError, ValueError) as error:
            raise self._store.refused(name, f"is corrupt ({error})") from None

    def _paid(self, level: tuple[int, float]) -> float:
        return max(1e-3, self.done[level].spent)

    def _level(self, across: int, step: float) -> tuple[str, ...]:
        return fem_settings(self._frame, self._frame.across(across), step, integrator=self.integrator)

    def _file(self, across: int, step: float) -> str:
        return f"level-{across}-{1e3 * step:.6g}ms-looked"

    def level(self, across: int, step: float) -> Level:
        """Facts of a level that is done."""
        outcome = self.done[across, step]
        return Level(across, step, outcome.n_cells, outcome.n_nodes, outcome.seconds)


Watch = Callable[[str, float], Told]
"""told what is computed now and its foreseen seconds; returns what is told of its progress"""


def climb(
    ladder: Ladder, frame: Frame, budget: float, watch: Watch, target: float = TARGET, known: float = KNOWN
) -> Reference:
    """Refine cells, then the step, until both are fine enough or the next level would not end within the budget.

    budget  own time of the ladder, without compiling [s]; levels from the cache cost nothing
    target  how uncertain the cells and the step may each leave a quantity [1]
    known   how uncertain a quantity may be that counts [1]
    """
    step = frame.scene.step
    enough = True

    def take(across: int, step: float, share: float) -> bool:
        new = ladder.cached(across, step) is None
        foreseen = ladder.seconds(across, step) if new else 0.0
        if new and ladder.done and ladder.spent + foreseen > share * budget:
            return False
        told = None
        if new:
            told = watch(f"reference, {across} cells across, {1e3 * step:.4g} ms", foreseen)
        outcome = ladder.run(across, step, max(1.0, share * budget - ladder.spent), told)
        return outcome.status == "done"

    cells: list[int] = []
    for across in levels_of(frame):
        # what the steps will need is kept back
        if not take(across, step, 0.85):
            enough = False
            between = BETWEEN.get(across, 0)
            if cells and between and refines(frame, between) and take(between, step, 0.85):
                cells.append(between)
            break
        cells.append(across)
        if len(cells) > 2 and fine(_limits(ladder, frame, [(a, step) for a in cells]), target, len(cells)):
            break
    if not cells:
        raise SoftseamError(f"the coarsest reference takes longer than {budget:.0f} s: give more --minutes")
    at = max((across for across in cells if across <= steps_at(frame)), default=cells[0])
    steps = [step]
    for halving in range(1, HALVINGS + 1):
        if not take(at, step / 2**halving, 1.0):
            enough = False
            break
        steps.append(step / 2**halving)
        if len(steps) > 2 and fine(_limits(ladder, frame, [(at, s) for s in steps]), target, len(steps)):
            break
    return assemble(ladder, frame, [(a, step) for a in cells], [(at, s) for s in steps], enough, target, known)


def levels_of(frame: Frame) -> tuple[int, ...]:
    """Cells across the coarsest level and finer ones, no two of which are the same cells.

    Where materials meet in planes, every level divides the coarsest's cells alike, as far as four levels do: others
    would have other shapes on either side of a border, and levels would jump back and forth.
    """
    different = tuple({frame.across(across): across for across in ACROSS}.values())
    alike = tuple(across for across in different if refines(frame, across))
    return alike if len(alike) > 3 else different


def refines(frame: Frame, across: int) -> bool:
    """Whether this level divides the coarsest's cells alike."""
    return frame.refines(frame.across(across), frame.across(ACROSS[0]))


def steps_at(frame: Frame) -> int:
    """Cells along the shortest edge at which the step is refined: about the scene's own."""
    if frame.own is None:
        return STEPS_AT
    finest = float((frame.extent / np.array(frame.own)).min())
    return int(np.clip(round(float(frame.extent.min()) / finest), ACROSS[0], FINEST_STEPS_AT))


def assemble(
    ladder: Ladder,
    frame: Frame,
    by_cells: Sequence[tuple[int, float]],
    by_steps: Sequence[tuple[int, float]],
    enough: bool,
    target: float = TARGET,
    known: float = KNOWN,
) -> Reference:
    """The reference that levels refined in cells, and others refined in steps, lead to."""
    time = _common(ladder, [*by_cells, *by_steps])
    finest = _series(ladder, by_cells[-1])
    cells, steps = _limits(ladder, frame, by_cells, time), _limits(ladder, frame, by_steps, time)
    travel = np.interp(time, finest.time, finest.travel)
    truth: dict[str, Truth] = {}
    parts: dict[str, Part] = {}
    stress = largest_stress({name: rms(by_cell.value, time) for name, by_cell in cells.items()})
    for name, by_cell in cells.items():
        by_step = steps[name]
        # relative uncertainties so far; the limit's own norm is the scale
        values = by_cell.value + (by_step.value - _series(ladder, by_steps[0]).at(name, time))
        scale = scale_of(name, values, travel, time)
        if is_nothing(name, scale, stress):
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
        has_limit = by_cell.converges or part.uncertainty_cells <= SCATTER * known
        if not has_limit:
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


def _limits(
    ladder: Ladder, frame: Frame, levels: Sequence[tuple[int, float]], time: Floats | None = None
) -> dict[str, Limit]:
    """The limit of every quantity over levels that differ in cells, or in steps; uncertainties in the units of each."""
    time = _common(ladder, levels) if time is None else time
    by_cells = len({across for across, _ in levels}) > 1
    h = [frame.size(frame.across(across)) if by_cells else step for across, step in levels]
    series = [_series(ladder, level) for level in levels]
    return {
        name: limit(h, [s.at(name, time) for s in series], lambda values: rms(values, time))
        for name in series[-1].values
    }


def fine(limits: Mapping[str, Limit], target: float, n_levels: int) -> bool:
    """Whether every quantity that has a limit is known to the target, and it is clear which have.

    Slip is not waited for: its scale, the tools' way, is not known here, and it hardly ever decides.
    """
    sizes = {name: float(np.sqrt(np.mean(found.value**2))) for name, found in limits.items()}
    stress = largest_stress(sizes)
    for name, found in limits.items():
        size = sizes[name]
        waited = name != "slip" and not is_nothing(name, size, stress) and (found.converges or n_levels < CLEAR)
        if waited and found.uncertainty > target * size:
            return False
    return True


def _common(ladder: Ladder, levels: Sequence[tuple[int, float]]) -> Floats:
    """Times of the coarsest step up to where the shortest run ended."""
    coarse = max(levels, key=lambda level: level[1])
    end = min(float(_series(ladder, level).time[-1]) for level in levels)
    time = _series(ladder, coarse).time
    return time[time <= end + 1e-9]


def _series(ladder: Ladder, level: tuple[int, float]) -> Series:
    series = ladder.done[level].series
    assert series is not None
    return series


def cache_folder() -> Path:
    """Where references are kept: $XDG_CACHE_HOME/softseam/references, or ~/.cache/softseam/references."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "softseam" / "references"


def described(reference: Reference) -> dict[str, Any]:
    """The reference as plain data that JSON can hold; no number is a NaN."""
    return {
        "integrator": reference.integrator,
        "complete": reference.complete,
        "uncertainty": _number(reference.uncertainty),
        "levels": [asdict(level) for level in reference.levels],
        "quantities": {
            name: {
                "counts": not true.left_out,
                "left_out": true.left_out,
                "scale": true.scale,
                "uncertainty": _number(true.uncertainty),
                **{key: _number(value) for key, value in asdict(reference.parts[name]).items()},
                "values": [float(f"{value:.7g}") if np.isfinite(value) else None for value in true.values],
            }
            for name, true in reference.truth.items()
        },
        "time": [float(f"{value:.9g}") for value in reference.time],
    }


def in_words(uncertainty: float) -> str:
    """An uncertainty in per cent."""
    return f"{100 * uncertainty:.2g} %" if np.isfinite(uncertainty) else "an unknown degree"


def _number(value: float) -> float | None:
    return float(f"{value:.5g}") if np.isfinite(value) else None
