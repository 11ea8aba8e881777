"""The levels of a scene's reference: FEM alone on finer and finer cells and with shorter and shorter steps.

Each is stored as soon as it is done: an interrupted reference goes on where it was, and a later one with more time
refines what is there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from softseam.errors import SceneRefused, SoftseamError
from softseam.scenes import bundle_of
from softseam.study.configurations import Configuration, Fem
from softseam.study.errors import rms
from softseam.study.frame import Frame, is_viscous
from softseam.study.measure import Outcome, Told, measure, quantity_names
from softseam.study.reference import Level
from softseam.study.richardson import Limit, limit
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
"""of a level: cells along the body's shortest edge, and the step [s]"""
Watch = Callable[[str, float], Told]
"""told what is computed now and its foreseen seconds; returns what is told of its progress"""

COARSEST = 2
"""cells along the body's shortest edge that a reference begins with"""


class Levels:
    """Computes, or reads from the cache, the levels of a scene's reference."""

    def __init__(self, name: str | Path | Scene, settings: Sequence[str], frame: Frame, names: tuple[str, ...]) -> None:
        self._name, self._settings, self.frame, self.names = name, tuple(settings), frame, names
        # an undamped body swings on, which implicit Euler would have to resolve with very short steps
        free = "midpoint" if is_viscous(frame.scene) else "bdf2"
        self.integrator = "implicit_euler" if frame.scene.tools else free
        self._store: Store | None = None
        self.done: dict[Rung, Outcome] = {}
        self.spent = 0.0
        """processor time of the levels that were not in the cache [s]"""

    def open(self, code: str, *, fresh: bool) -> None:
        """Use the cache: levels of the same body, tools and motion, computed by the same code. Raises SceneRefused
        where even the coarsest level has too many cells."""
        n_cells = self.frame.n_cells(self.frame.level(COARSEST))
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
            with_settings(scene, self._settings), self.fem(COARSEST, self.frame.scene.step).settings
        )
        others = {"models": ModelsSpec(fem=coarsest.models.fem), "seam": SeamSpec(), "quantities": ()}
        nothing = {"tolerance": None, "budget": None, "symmetry": ()}  # one side comes to what the whole comes to
        return scene_hash(bundle_scene(coarsest.model_copy(update=others | nothing), bundle.files))

    def fem(self, across: float, step: float) -> Fem:
        """A level's cells and step."""
        return Fem(self.frame, self.frame.level(across), step, "hex27", self.integrator)

    def seconds(self, across: float, step: float) -> float:
        """Foreseen time of a level that is not done, by what the finest of the others took [s]."""
        rough = self.fem(across, step).seconds
        last = max(self.done, default=None, key=lambda rung: (rung[0] <= across, rung[0], rung[1] == step, -rung[1]))
        return rough if last is None else rough * self.done[last].spent / self.fem(*last).seconds

    def run(self, across: float, step: float, limit_s: float, told: Told | None = None) -> Outcome:
        """A level, from the cache where it is there. Raises SoftseamError where it cannot be computed."""
        found = self.cached(across, step)
        if found is None:
            found = measure(
                self._name,
                (*self._settings, *self.fem(across, step).settings),
                quantity_names(self.frame.scene),  # all: another reference of this scene may ask for others
                runs=0,
                limit=limit_s,
                length=self.frame.length,
                told=told,
                # at the common times, all: what is looked at every few steps would differ by where that falls
                look=max(1, round(self.frame.scene.step / step)),
            )
            self.spent += found.spent
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

    def cached(self, across: float, step: float) -> Outcome | None:
        """A level that was computed before."""
        assert self._store is not None
        return self._store.outcome(self._file(across, step))

    def _file(self, across: float, step: float) -> str:
        # a scene that asks for other quantities has levels of its own beside these
        names = ",".join(sorted(quantity_names(self.frame.scene)))
        cells = "x".join(map(str, self.frame.level(across)))
        return f"level-{across:g}-{cells}-{1e3 * step:.6g}ms-{hashlib.sha256(names.encode()).hexdigest()[:8]}"

    def runs(self) -> list[tuple[Configuration, Outcome]]:
        """Levels that are done, as configurations that a plan may choose."""
        return [(self.fem(*rung).configuration(), outcome) for rung, outcome in sorted(self.done.items())]

    def level(self, across: float, step: float) -> Level:
        """Facts of a level that is done."""
        outcome = self.done[across, step]
        return Level(across, step, outcome.n_cells, outcome.n_nodes, outcome.seconds)

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

    def limits(self, rungs: Sequence[Rung], time: Floats | None = None) -> dict[str, Limit]:
        """The limit of every quantity over levels that differ in cells, or in steps; uncertainties in its units."""
        time = self.common(rungs) if time is None else time
        by_cells = len({across for across, _ in rungs}) > 1
        h = [self.frame.size(self.frame.level(across)) if by_cells else step for across, step in rungs]
        series = [self.series(rung) for rung in rungs]
        return {
            name: limit(h, [s.at(name, time) for s in series], lambda values: rms(values, time))
            for name in series[-1].values
        }
