"""The levels of a scene's reference: FEM alone on finer and finer cells and with shorter and shorter steps.

Each is stored as soon as it is done: an interrupted reference goes on where it was, and a later one with more time
refines what is there.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from softseam.columns import rms
from softseam.errors import SceneRefused, SoftseamError
from softseam.scenes import bundle_of, bundle_with
from softseam.variants import with_settings
from softseam_protocol.facts import machine
from softseam_protocol.scene.bodies import MOST_CELLS
from softseam_protocol.scene.file import scene_hash
from softseam_protocol.scene.models import ModelsSpec
from softseam_protocol.scene.regions import SeamSpec
from softseam_protocol.scene.scene import Scene
from softseam_studies.study.configurations import Configuration, Fem, particles
from softseam_studies.study.frame import Frame, is_viscous
from softseam_studies.study.measure import Deadline, Outcome, Told, measure, quantity_names
from softseam_studies.study.reference import Level
from softseam_studies.study.richardson import Limit, limit
from softseam_studies.study.series import Series
from softseam_studies.study.store import Identity, Store, cache_folder

Floats = NDArray[np.float64]
Resolution = tuple[float, float]
"""of a level: cells along the body's shortest edge, and the step [s]"""
Watch = Callable[[str, float], Told]
"""receives what is computed now and its foreseen seconds; returns what hears of its progress"""

COARSEST = 2
"""cells along the body's shortest edge that a reference begins with"""
ACROSS = (COARSEST, *range(3, 15), 16, 20, 24, 28, 32)
"""cells along the body's shortest edge, level by level"""
LEAST_ROUND = 3
"""cells across the box around a ball that a reference begins with"""
DEAR = 300
"""cells that a level may solve for though a finer one solves for fewer"""


class Levels:
    """Computes, or reads from the cache, the levels of a scene's reference."""

    def __init__(self, name: str | Path | Scene, settings: Sequence[str], frame: Frame, names: tuple[str, ...]) -> None:
        self._name, self._settings, self.frame, self.names = name, tuple(settings), frame, names
        # an undamped body swings on, which implicit Euler would have to resolve with very short steps
        free = "midpoint" if is_viscous(frame.body) else "bdf2"
        self.integrator = "implicit_euler" if frame.scene.tools else free
        self._store: Store | None = None
        self.done: dict[Resolution, Outcome] = {}
        self.spent = 0.0
        """processor time of the levels that were not in the cache [s]"""
        self.deadline: Deadline | None = None
        """by which all are done"""

    def open(self, code: str, *, fresh: bool) -> None:
        """Use the cache: levels of the same body, tools and motion, computed by the same code. Raises SceneRefused
        where even the coarsest level has too many cells."""
        n_cells = self.n_cells(COARSEST)
        if n_cells > MOST_CELLS:
            raise SceneRefused(
                f"charts and plans compare with FEM on {COARSEST} cells along the body's shortest edge and more; of "
                f"{self.scene!r} these are {n_cells:,} cells, more than {MOST_CELLS:,}: its body is too thin for them"
            )
        key, here = self.key, machine()
        folder = cache_folder() / f"{self.scene}-{Identity(key, code, here).folder}"  # other code begins anew
        self._store = Store(folder, Identity(key, code, here), "compute the reference anew with --fresh")
        if fresh:
            self._store.clear()

    @property
    def scene(self) -> str:
        """The scene's name."""
        return self.frame.scene.name

    @property
    def key(self) -> str:
        """Hash of all that FEM alone depends on, and of probes: of the coarsest level, but not how XPBD or a seam would
        do, nor which quantities are asked for.
        """
        scene, bundle = bundle_of(self._name)
        coarsest = with_settings(
            with_settings(scene, self._settings), self.configuration(COARSEST, self.frame.scene.step).settings
        )
        others = {"models": ModelsSpec(fem=coarsest.models.fem), "seam": SeamSpec(), "quantities": ()}
        nothing = {"tolerance": None, "budget": None, "symmetry": ()}  # one side comes to what the whole comes to
        return scene_hash(bundle_with(coarsest.model_copy(update=others | nothing), bundle, self._name, self._settings))

    def sequence(self) -> tuple[int, ...]:
        """Cells across of its levels, the coarsest first."""
        return levels_of(self.frame)

    def configuration(self, across: float, step: float) -> Configuration:
        """A level's cells and step."""
        return Fem(self.frame, self.frame.level(across), step, "hex27", self.integrator).configuration()

    def n_cells(self, across: float) -> int:
        """Of a level."""
        return self.frame.n_cells(self.frame.level(across))

    def seconds(self, across: float, step: float) -> float:
        """Foreseen time of a level that is not done, by what the finest of the others took [s]."""
        rough = self.configuration(across, step).seconds
        last = max(self.done, default=None, key=lambda size: (size[0] <= across, size[0], size[1] == step, -size[1]))
        return rough if last is None else rough * self.done[last].spent / self.configuration(*last).seconds

    def run(self, across: float, step: float, limit_s: float, report: Told | None = None) -> Outcome:
        """A level, from the cache where it is there. Raises SoftseamError where it cannot be computed."""
        found = self.cached(across, step)
        if found is None:
            found = measure(
                self._name,
                (*self._settings, *self.configuration(across, step).settings),
                quantity_names(self.frame.scene),  # all: another reference of this scene may ask for others
                runs=0,
                limit=limit_s,
                left=self.left,
                length=self.frame.length,
                report=report,
                # at the common times, all: what is looked at every few steps would differ by where that falls
                look=max(1, round(self.frame.scene.step / step)),
            )
            self.spent += found.spent
            if self.deadline is not None:
                self.deadline.learn(found)
            if found.status in ("refused", "failed"):
                raise SoftseamError(f"the reference cannot be computed on {across:g} cells across: {found.reason}")
            if found.status == "done":
                assert self._store is not None
                self._store.write(self._file(across, step), found.as_json())
        if found.status == "done":
            assert found.series is not None
            values = {name: found.series.values[name] for name in self.names}
            self.done[across, step] = replace(found, series=replace(found.series, values=values))
        return found

    def left(self) -> float:
        """Wall time that levels may still take [s]."""
        return math.inf if self.deadline is None else self.deadline.left()

    def cached(self, across: float, step: float) -> Outcome | None:
        """A level that was computed before."""
        assert self._store is not None
        return self._store.outcome(self._file(across, step))

    def _file(self, across: float, step: float) -> str:
        # a scene that asks for other quantities has levels of its own beside these
        names = hashlib.sha256(",".join(sorted(quantity_names(self.frame.scene))).encode()).hexdigest()
        return f"level-{across:g}-{self.n_cells(across)}-{1e3 * step:.6g}ms-{names[:8]}"

    def runs(self) -> list[tuple[Configuration, Outcome]]:
        """Levels that are done, as configurations that a plan may choose."""
        return [(self.configuration(*size), outcome) for size, outcome in sorted(self.done.items())]

    def level(self, across: float, step: float) -> Level:
        """Facts of a level that is done."""
        outcome = self.done[across, step]
        return Level(across, step, outcome.n_cells, outcome.n_nodes, outcome.seconds)

    def series(self, size: Resolution) -> Series:
        """What a level that is done did over time."""
        series = self.done[size].series
        assert series is not None
        return series

    def common(self, sizes: Sequence[Resolution]) -> Floats:
        """Times (n,) of the coarsest step up to where the shortest run ended [s]."""
        coarse = max(sizes, key=lambda size: size[1])
        end = min(float(self.series(size).time[-1]) for size in sizes)
        time = self.series(coarse).time
        return time[time <= end + 1e-9]

    def limits(self, sizes: Sequence[Resolution], time: Floats | None = None) -> dict[str, Limit]:
        """The limit of every quantity over levels that differ in cells, or in steps; uncertainties in its units."""
        time = self.common(sizes) if time is None else time
        by_cells = len({across for across, _ in sizes}) > 1
        h = [self.frame.size(self.frame.level(across)) if by_cells else step for across, step in sizes]
        series = [self.series(size) for size in sizes]
        return {
            name: limit(h, [s.at(name, time) for s in series], lambda values: rms(values, time))
            for name in series[-1].values
        }


def levels_of(frame: Frame) -> tuple[int, ...]:
    """Cells across the coarsest level and finer ones, no two of which are the same cells.

    Where materials meet in planes, every level divides the coarsest's cells alike, if four levels do: others would
    have other shapes on either side of a border, and levels would jump back and forth. And none that solves for many
    cells, and for more of them than a finer one does, which is symmetric.
    """
    different = tuple({frame.level(across): across for across in ACROSS}.values())
    if frame.ball is not None:
        # with two cells across the box forces and sag still go to and fro
        different = tuple(across for across in different if frame.across_ball(frame.level(across)) >= LEAST_ROUND)
    alike = tuple(a for a in different if frame.refines(frame.level(a), frame.level(COARSEST)))
    found = alike if len(alike) > 3 else different
    solved = [frame.n_solved(frame.level(across)) for across in found]
    return tuple(a for k, a in enumerate(found) if solved[k] <= max(DEAR, min(solved[k + 1 :], default=np.inf)))


FIRST = 16
"""substeps of a step that the sequence begins with: with fewer, stiff springs stretch by more than they hang"""


class ParticleLevels(Levels):
    """Levels that differ in the length of substeps; each has the scene's own step, which tools move by."""

    def sequence(self) -> tuple[int, ...]:
        return (1,)

    def n_cells(self, across: float) -> int:
        return 1

    def configuration(self, across: float, step: float) -> Configuration:
        return particles(self.frame, self.frame.scene.step, round(FIRST * self.frame.scene.step / step))
