"""The levels of a scene's reference: FEM alone on finer and finer cells and steps, each kept as soon as it is done.

An interrupted reference goes on where it was, and a later one with more time refines what is there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from softseam.errors import SceneRefused, SoftseamError
from softseam.scenes import bundle_of
from softseam.study.configurations import Configuration, Fem
from softseam.study.errors import rms
from softseam.study.frame import FEW, Counts, Frame, is_viscous
from softseam.study.measure import Outcome, Told, measure, quantity_names
from softseam.study.reference import Level
from softseam.study.richardson import Limit
from softseam.study.scatter import fitted, settled
from softseam.study.series import Series
from softseam.study.store import Identity, Store, cache_folder
from softseam.variants import with_settings
from softseam_protocol.facts import machine
from softseam_protocol.scene.bodies import MOST_CELLS
from softseam_protocol.scene.file import bundle_scene, scene_hash
from softseam_protocol.scene.models import ModelsSpec
from softseam_protocol.scene.regions import SeamSpec
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]
Rung = tuple[float, float]
"""cells along the body's shortest edge, of a level between two others halves, and the step [s]"""

COARSEST = 2
"""cells along the body's shortest edge that a reference begins with"""
GRADING = 4.0
"""of the levels' second family: of 8, the thinnest cells keep Newton's method busy"""
GROWTH = (1.2, 2.4)
"""bounds of the power of the number of cells that the cost of the next level is foreseen with"""
_MACHINE = "machine"
"""where a level's file says which one computed it"""


class Ladder:
    """Computes, or reads from the cache, the levels of a scene's reference."""

    def __init__(
        self,
        name: str | Path | Scene,
        settings: Sequence[str],
        frame: Frame,
        names: tuple[str, ...],
        grading: float = 1.0,
    ) -> None:
        self._name, self._settings, self._frame, self.names = name, tuple(settings), frame, names
        self._grading, self._towards = grading, (frame.towards or ()) if grading > 1.0 else ()
        second = grading == 1.0 and frame.towards is not None
        self.graded = Ladder(name, settings, frame, names, GRADING) if second else None
        """a second family of levels, whose cells are thinner where stress peaks; None where they cannot be"""
        # an undamped body swings on, which implicit Euler would have to resolve with very short steps
        free = "midpoint" if is_viscous(frame.scene) else "bdf2"
        self.integrator = "implicit_euler" if frame.scene.tools else free
        self._store: Store | None = None
        self.done: dict[Rung, Outcome] = {}
        self._elsewhere: set[Rung] = set()
        self.spent = 0.0
        """own time of the levels that were not in the cache [s]"""

    def open(self, code: str, *, fresh: bool) -> None:
        """Use the cache: levels of the same body, tools and motion, computed by the same code. Raises SceneRefused
        where even the coarsest level has too many cells."""
        n_cells = self._frame.n_cells(self.counts(COARSEST))
        if n_cells > MOST_CELLS:
            raise SceneRefused(
                f"charts and plans compare with FEM on {COARSEST} cells along the body's shortest edge and more; of "
                f"{self.scene!r} these are {n_cells:,} cells, more than {MOST_CELLS:,}: its body is too thin for them"
            )
        key = self.key
        folder = cache_folder() / f"{self.scene}-{key[:12]}-{code[:8]}"  # another version begins anew
        self._store = Store(folder, Identity(key, code), "compute the reference anew with --fresh")
        if fresh:
            self._store.clear()
        if self.graded is not None:
            self.graded.open(code, fresh=fresh)

    @property
    def spent_in_all(self) -> float:
        """By both families [s]."""
        return self.spent + (self.graded.spent if self.graded is not None else 0.0)

    @property
    def scene(self) -> str:
        """The scene's name."""
        return self._frame.scene.name

    @property
    def key(self) -> str:
        """Hash of all that FEM alone depends on, and of probes: of the coarsest level, but not how XPBD or a seam would
        do, nor which quantities are asked for.
        """
        scene, bundle = bundle_of(self._name)
        coarsest = with_settings(with_settings(scene, self._settings), self._level(COARSEST, self._frame.scene.step))
        others = {"models": ModelsSpec(fem=coarsest.models.fem), "seam": SeamSpec(), "quantities": ()}
        nothing = {"tolerance": None, "budget": None, "symmetry": ()}  # one side comes to what the whole comes to
        return scene_hash(bundle_scene(coarsest.model_copy(update=others | nothing), bundle.files))

    def seconds(self, across: float, step: float) -> float:
        """Foreseen wall time of a level that is not done [s]; no less than one that was begun before said it takes."""
        return max(self._foreseen(across, step), self._begun(across, step))

    def _foreseen(self, across: float, step: float) -> float:
        rough = self._fem(across, step).seconds
        coarser = sorted((a, s) for a, s in self.done if a <= across)
        # shorter steps take fewer iterations each
        known = [each for each in coarser if each[1] == step] or coarser
        if not known:
            return rough
        at = known[-1]
        cells, before = self._cells(across), self._cells(at[0])
        power = GROWTH[1]
        if len({a for a, _ in known}) > 1:
            lower = next(k for k in reversed(known) if k[0] < at[0])
            fewer = self._cells(lower[0])
            paid, less = self._paid(at) / at[1] ** -1, self._paid(lower) / lower[1] ** -1
            if before > fewer:
                power = float(np.clip(np.log(paid / less) / np.log(before / fewer), *GROWTH))
        return float(self._paid(at) * (cells / before) ** power * at[1] / step)

    def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
        """A level, from the cache where it is there. Raises SoftseamError where it cannot be computed."""
        found = self.cached(across, step)
        if found is None:
            found = measure(
                self._name,
                (*self._settings, *self._level(across, step)),
                quantity_names(self._frame.scene),  # all: another ladder of this scene may ask for others
                runs=0,
                limit=limit_s,
                length=self._frame.length,
                told=told,
                # at the common times, all: what is looked at every few steps would differ by where that falls
                look=max(1, round(self._frame.scene.step / step)),
            )
            self.spent += found.spent
            if found.status in ("refused", "failed"):
                raise SoftseamError(f"the reference cannot be computed on {across:g} cells across: {found.reason}")
            assert self._store is not None
            if found.status == "done":
                self._store.write(self._file(across, step), found.as_json() | {_MACHINE: machine()})
            elif found.simulated > 0.0:
                # as long as it was seen to take, it is not begun again where there is no more time
                takes = found.spent * self._frame.length / found.simulated
                self._store.write(f"begun-{self._file(across, step)}", {"seconds": takes})
            found = self._own(found)
        if found.status == "done":
            self.done[across, step] = found
        return found

    def tried(self) -> list[tuple[Configuration, Outcome]]:
        """Levels that are done, as configurations that a plan may choose: nothing else is as fine. Those that another
        machine computed, where a home folder is shared, tell no time of this one."""
        here = sorted((rung, outcome) for rung, outcome in self.done.items() if rung not in self._elsewhere)
        own = [(self._fem(*rung).configuration(), outcome) for rung, outcome in here]
        return [*own, *(self.graded.tried() if self.graded is not None else ())]

    def cached(self, across: float, step: float) -> Outcome | None:
        """A level that was computed before."""
        assert self._store is not None
        for name in self._store.names(f"{self._rung(across, step)}-"):
            data = self._store.read(name)
            if data is None:
                continue  # another process began anew
            try:
                found = Outcome.from_json(data)
            except (KeyError, TypeError, ValueError) as error:
                raise self._store.refused(name, f"is corrupt ({error})") from None
            # a scene that asks for others keeps levels of its own beside these
            if found.series is not None and {*self.names} <= {*found.series.values}:
                if data.get(_MACHINE, machine()) != machine():
                    self._elsewhere.add((across, step))
                return self._own(found)
        return None

    def _own(self, outcome: Outcome) -> Outcome:
        """With the series of this ladder's quantities only."""
        series = outcome.series
        if series is None:
            return outcome
        return replace(outcome, series=replace(series, values={name: series.values[name] for name in self.names}))

    def _begun(self, across: float, step: float) -> float:
        """What a level that did not end in time would have taken [s]; 0 where none was begun."""
        if self._store is None:
            return 0.0
        name = f"begun-{self._file(across, step)}"
        data = self._store.read(name) or {"seconds": 0.0}
        if not isinstance(data.get("seconds"), float):
            raise self._store.refused(name, "is corrupt (it has no seconds)")
        return float(data["seconds"])

    def _paid(self, level: Rung) -> float:
        return max(1e-3, self.done[level].spent)

    def _level(self, across: float, step: float) -> tuple[str, ...]:
        return self._fem(across, step).settings

    def counts(self, across: float) -> Counts:
        """A level's cells. Of thin ones as many as fold; of equal ones as many as ever, since what ships is checked
        with them."""
        counts = self._frame.level(across)
        return counts if self._grading == 1.0 else self._frame.folding(counts, self._towards)

    def _cells(self, across: float) -> float:
        """That a level's time goes by."""
        return max(FEW, self._frame.n_solved(self.counts(across)))

    def _fem(self, across: float, step: float) -> Fem:
        return Fem(self._frame, self.counts(across), step, "hex27", self.integrator, self._grading, self._towards)

    def _rung(self, across: float, step: float) -> str:
        cells = "x".join(map(str, self.counts(across)))
        return f"level-{across:g}-{cells}-{1e3 * step:.6g}ms"

    def _file(self, across: float, step: float) -> str:
        names = ",".join(sorted(quantity_names(self._frame.scene)))
        return f"{self._rung(across, step)}-{hashlib.sha256(names.encode()).hexdigest()[:8]}"

    def level(self, across: float, step: float) -> Level:
        """Facts of a level that is done."""
        outcome = self.done[across, step]
        return Level(across, step, outcome.n_cells, outcome.n_nodes, outcome.seconds, self._grading)

    def series(self, rung: Rung) -> Series:
        """What a level that is done did over time."""
        series = self.done[rung].series
        assert series is not None
        return series

    def common(self, rungs: Sequence[Rung]) -> Floats:
        """Times (n,) of the coarsest step up to where the shortest run ended [s]."""
        coarse = max(rungs, key=lambda rung: rung[1])
        end = min(float(self.series(rung).time[-1]) for rung in rungs)
        time = self.series(coarse).time
        return time[time <= end + 1e-9]

    def _size(self, rung: Rung) -> float:
        """Of a level's cells [m]; between planes there are more than across the block."""
        if self._grading == 1.0:
            return self._frame.size(self._frame.level(rung[0]))
        return float((np.prod(self._frame.extent) / self.done[rung].n_cells) ** (1.0 / 3.0))

    def limits(self, rungs: Sequence[Rung], time: Floats | None = None) -> dict[str, Limit]:
        """The limit of every quantity over levels that differ in cells, or in steps; uncertainties in its units."""
        time = self.common(rungs) if time is None else time
        by_cells = len({across for across, _ in rungs}) > 1
        h = [self._size((across, step)) if by_cells else step for across, step in rungs]
        series = [self.series(rung) for rung in rungs]
        approached = fitted if by_cells else settled
        return {
            name: approached(h, [s.at(name, time) for s in series], lambda values: rms(values, time))
            for name in series[-1].values
        }
