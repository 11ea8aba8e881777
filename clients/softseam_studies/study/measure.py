"""One configuration, run and timed in this process: compiling and setting up are measured, and left out."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter, process_time
from typing import Any, Literal, get_args

from softseam.embedded import compile_clock
from softseam.errors import BadInput, SceneRefused, SimulationFailed
from softseam.interrupt import Interrupt
from softseam.observation import Observation
from softseam.scenes import Source
from softseam.session import Session, open_as_given
from softseam_protocol.quantities import QUANTITIES, probed
from softseam_protocol.scene.scene import Scene
from softseam_studies.study.series import Series, SeriesBuilder

RUNS = 3
"""timed runs of a configuration"""
BRIEF, MOST = 0.5, 12
"""brief ones go on until they took this long together [s], or were so many: a machine's speed changes faster"""
ENOUGH = 12.0
"""no further run begins once those before took this long together [s]"""


Status = Literal["done", "refused", "failed", "stopped", "left out"]
Told = Callable[[float], None]
"""hears now and then how much of a run is done, 0 to 1"""


Clock = Callable[[], tuple[float, float]]
"""wall and processor time that kernels have taken to compile or to read so far [s]"""


def timed_for(seconds: float, runs: int = RUNS) -> float:
    """Rough time that the timed runs take together of a configuration one of whose runs takes so long [s]."""
    return min(ENOUGH, max(runs * seconds, min(BRIEF, MOST * seconds))) if runs else 0.0


@dataclass(frozen=True)
class Taken:
    """What a run took, without compiling."""

    wall: float
    """[s]"""
    cpu: float
    """of all its threads [s]"""

    @property
    def own(self) -> float:
        """Wall time less what other work held it up by [s]."""
        return min(self.wall, self.cpu)


@dataclass(frozen=True)
class Outcome:
    """What became of one configuration."""

    status: Status
    reason: str = ""
    """why it is not done"""
    series: Series | None = None
    walls: tuple[float, ...] = ()
    """wall time of each timed run without compiling [s]"""
    cpu: float = 0.0
    """processor time of the median timed run [s]"""
    spent: float = 0.0
    """processor time of all runs, timed or not, without compiling [s]"""
    compiled: float = 0.0
    """spent on compiling kernels and reading compiled ones, over all runs [s]"""
    setup: float = 0.0
    """building the body and the tools, without compiling [s]"""
    simulated: float = 0.0
    """length of a run [s]"""
    steps: int = 0
    n_cells: int = 0
    n_nodes: int = 0
    estimate: float = 0.0
    """what the run itself estimated that forces and displacements are off by, 0 where it could not [1]"""

    @property
    def was_late(self) -> bool:
        """Whether there was no time for it, or not enough."""
        return self.status in ("left out", "stopped")

    @property
    def seconds(self) -> float:
        """Time of a run [s]: wall time of the median one, or its processor time; 0 where nothing was timed.

        A run only computes: where its wall time exceeds its processor time, other work held it up by the difference,
        and its processor time counts.
        """
        if not self.walls:
            return 0.0
        wall = statistics.median(self.walls)
        return min(wall, self.cpu) if self.cpu > 0.0 else wall

    @property
    def rtf(self) -> float:
        """Simulated seconds over those of a run; 0 where nothing was timed."""
        return self.simulated / self.seconds if self.walls else 0.0

    @property
    def spread(self) -> tuple[float, float]:
        """Least real-time factor of the timed runs by their wall time, and the greatest."""
        if not self.walls:
            return 0.0, 0.0
        return self.simulated / max(self.walls), max(self.rtf, self.simulated / min(self.walls))

    def as_json(self) -> dict[str, Any]:
        return vars(self) | {"walls": list(self.walls), "series": self.series and self.series.as_json()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Outcome:
        """Raises KeyError, TypeError or ValueError where the data are not an outcome."""
        if data["status"] not in get_args(Status):
            raise ValueError(f"no status is called {data['status']!r}")
        series = None if data["series"] is None else Series.from_json(data["series"])
        return cls(**dict(data) | {"walls": tuple(map(float, data["walls"])), "series": series})


def quantity_names(scene: Scene) -> tuple[str, ...]:
    """The quantities to compare: the scene's, and what it asks of its probes; not what a run says of its own errors,
    which is nothing in truth."""
    names = (*(name for name in scene.quantities if QUANTITIES[name].group != "error"), *probed(scene.probes))
    if not names:
        raise BadInput(
            f"the scene {scene.name!r} asks for no quantities to compare: add some, e.g. quantities: [grip_force, sag]"
        )
    return names


class _Watch:
    """Wall and processor time since it was made, what numba took for kernels left out."""

    def __init__(self, compiled: Clock) -> None:
        self._compiled = compiled
        self._began = self._now()

    def read(self) -> Taken:
        wall, cpu = self._now()
        return Taken(wall - self._began[0], cpu - self._began[1])

    def _now(self) -> tuple[float, float]:
        wall, cpu = self._compiled()
        return perf_counter() - wall, process_time() - cpu


class _Stopped(Exception):
    """A run was ended because of its cost."""


def measure(
    scene: Source,
    settings: Sequence[str],
    names: tuple[str, ...],
    *,
    runs: int = RUNS,
    limit: float = 600.0,
    length: float | None = None,
    left: Callable[[], float] = lambda: math.inf,
    report: Told | None = None,
    look: int = 0,
    worth: Callable[[Outcome], bool] = lambda _: True,
) -> Outcome:
    """Run a scene with these settings once for its series, then, where that is worth it, `runs` times for its speed,
    brief ones more often; never raises for a run.

    The first run warms caches up, and is timed only where it alone takes `ENOUGH`.

    limit   longest processor time of a run, without compiling [s]
    length  expected length of the motion [s]
    left    wall time until all runs have to end [s]
    look    fields, too, are looked at whenever this many steps were taken, 0 for when the scene does
    """
    began = perf_counter()
    try:
        with compile_clock() as clock, open_as_given(scene, settings=settings) as session:
            start = session.reset()
            setup = perf_counter() - began - clock()[0]
            first = _followed(session, start, names, clock, left, limit=limit, length=length, report=report, look=look)
            first = replace(first, setup=setup)
            return _timed(session, first, clock, left, runs if first.status == "done" and worth(first) else 0)
    except SceneRefused as error:
        return Outcome("refused", str(error))
    except SimulationFailed as error:
        return Outcome("failed", str(error))


def _followed(
    session: Session,
    start: Observation,
    names: tuple[str, ...],
    clock: Clock,
    left: Callable[[], float],
    *,
    limit: float,
    length: float | None,
    report: Told | None,
    look: int,
) -> Outcome:
    """Run a session that was just reset to its end, or to its limit, within a step where that takes so long."""
    builder = SeriesBuilder(names, session.scene.step)
    builder.add(start)
    watch, last = _Watch(clock), start

    def late() -> bool:
        return watch.read().own > limit or left() <= 0.0

    def collect(observation: Observation) -> None:
        nonlocal last
        last = observation
        builder.add(observation)
        if late():
            raise _Stopped
        if report is not None and length:
            report(min(1.0, observation.time / length))

    status: Status = "done"
    reason = ""
    interrupt = Interrupt("softseam time limit", late)
    try:
        with interrupt:
            if look:
                _looking(session, look, collect)
            else:
                session.run(collect)
    except SimulationFailed as error:
        status, reason = "failed", str(error)
    except _Stopped:
        status = "stopped"
    if status == "stopped" or interrupt.ended:
        ran = min(limit, watch.read().own)
        status, reason = "stopped", f"stopped at {last.time:.3g} s of motion, after {ran:.0f} s"
    series, taken = builder.build(), watch.read()
    if status == "done" and not series.finite():
        status, reason = "failed", "it diverged: a quantity is not a number"
    return Outcome(
        status,
        reason,
        series if status == "done" else None,
        (taken.wall,),
        taken.cpu if status == "done" else 0.0,
        taken.own,
        clock()[0],
        simulated=float(series.time[-1]),
        steps=len(series.time) - 1,
        n_cells=sum(part.n_cells for part in last.parts.values()),
        n_nodes=sum(part.n_nodes for part in last.parts.values()),
        estimate=0.0 if last.error_estimate is None else last.error_estimate.answer,
    )


def _timed(session: Session, first: Outcome, clock: Clock, left: Callable[[], float], runs: int) -> Outcome:
    """An outcome with the times of further runs of its open session, where there are any."""
    timed: list[Taken] = []
    spent = first.spent
    while (
        spent < ENOUGH
        and left() > max(first.walls)
        and (len(timed) < runs or (0 < len(timed) < MOST and spent - first.spent < BRIEF))
    ):
        session.reset()
        watch = _Watch(clock)
        session.run()
        timed.append(watch.read())
        spent += timed[-1].own
    if not timed:
        return first
    walls, cpu = tuple(one.wall for one in timed), statistics.median(one.cpu for one in timed)
    return replace(first, walls=walls, cpu=cpu, spent=spent, compiled=clock()[0])


def _looking(session: Session, every: int, collect: Callable[[Observation], None]) -> None:
    """Follow an open session's motion to its end, and look at its fields whenever `every` steps were taken."""
    taken, done = 0, False
    while not done:
        taken += 1
        observation = session.step(fields=taken % every == 0)
        collect(observation)
        done = observation.done


READING = 3.0
"""processor time that reading kernels may take, which were compiled before; more is compiling [s]"""


class Deadline:
    """Begins as it is made.

    seconds   that the search may take [s]
    compiled  wall and processor time that kernels took so far [s]
    """

    def __init__(self, seconds: float, compiled: Clock) -> None:
        self._compiled = compiled
        self._ends = perf_counter() + seconds
        self._busy = 1.0

    def before(self, seconds: float) -> Deadline:
        """One so much sooner [s]."""
        return Deadline(self._ends - perf_counter() - seconds, self._compiled)

    def left(self) -> float:
        """Until it [s]."""
        return self._ends - perf_counter() + max(0.0, self._compiled()[1] - READING)

    def fits(self, seconds: float, keep: float = 0.0) -> bool:
        """Whether a run whose processor is foreseen to take so long ends before it, and leaves `keep` [s]."""
        return self._busy * seconds <= self.left() - keep

    def learn(self, outcome: Outcome) -> None:
        """Take over from a run how much longer than its processor's time it took, for other work held it up."""
        if outcome.walls and outcome.cpu > 0.0:
            self._busy = max(1.0, max(outcome.walls) / outcome.cpu)
