"""One configuration, run and timed in this process: compiling and setting up are measured, and left out."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Literal, get_args

from softseam.chart.series import Series, SeriesBuilder
from softseam.embedded import compile_clock
from softseam.errors import SceneRefused, SimulationFailed
from softseam.observation import Observation
from softseam.session import Session, open_as_given
from softseam_protocol.scene import Scene

RUNS = 3
"""timed runs of a configuration"""
ENOUGH = 12.0
"""no further run begins once those before took this much wall time together [s]"""

Status = Literal["done", "refused", "failed", "stopped", "left out"]
Told = Callable[[float], None]
"""told now and then how much of a run is done, 0 to 1"""


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
    """least processor time of a timed run [s]"""
    spent: float = 0.0
    """wall time of all runs, timed or not, without compiling [s]"""
    compiled: float = 0.0
    """spent on compiling kernels and reading compiled ones, over all runs [s]"""
    setup: float = 0.0
    """building the body and the tools, without compiling [s]"""
    simulated: float = 0.0
    """length of a run [s]"""
    steps: int = 0
    n_cells: int = 0
    n_nodes: int = 0

    @property
    def rtf(self) -> float:
        """Simulated over wall seconds, of the median run; 0 where nothing was timed.

        A run only computes: where its wall time exceeds its processor time, other work held it up by the difference,
        and its processor time counts.
        """
        if not self.walls:
            return 0.0
        wall = statistics.median(self.walls)
        return self.simulated / (min(wall, self.cpu) if self.cpu > 0.0 else wall)

    @property
    def spread(self) -> tuple[float, float]:
        """Least real-time factor of the timed runs by their wall time, and the greatest."""
        if not self.walls:
            return 0.0, 0.0
        return self.simulated / max(self.walls), max(self.rtf, self.simulated / min(self.walls))

    def as_json(self) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in _PLAIN}
        return plain | {"walls": list(self.walls), "series": None if self.series is None else self.series.as_json()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Outcome:
        """Raises KeyError, TypeError or ValueError where the data are not an outcome."""
        if data["status"] not in get_args(Status):
            raise ValueError(f"no status is called {data['status']!r}")
        series = None if data["series"] is None else Series.from_json(data["series"])
        walls = tuple(float(wall) for wall in data["walls"])
        return cls(**{name: data[name] for name in _PLAIN}, walls=walls, series=series)


_PLAIN = ("status", "reason", "cpu", "spent", "compiled", "setup", "simulated", "steps", "n_cells", "n_nodes")


@dataclass
class _Limit:
    """Ends a run that takes longer than it may."""

    seconds: float
    began: float = field(default_factory=perf_counter)

    def check(self, observation: Observation, compiled: float) -> None:
        if perf_counter() - self.began - compiled > self.seconds:
            raise _Stopped(f"stopped at {observation.time:.3g} s of motion, after {self.seconds:.0f} s")


class _Stopped(Exception):
    """A run was ended because of its cost."""


def measure(
    scene: str | Path | Scene,
    settings: Sequence[str],
    names: tuple[str, ...],
    *,
    runs: int = RUNS,
    limit: float = 600.0,
    length: float | None = None,
    told: Told | None = None,
) -> Outcome:
    """Run a scene with these settings once for its series, then `runs` times for its speed; never raises for a run.

    The first run warms caches up, and is timed only where it alone takes `ENOUGH`.

    limit   longest wall time of a run, without compiling [s]
    length  expected length of the motion [s]
    """
    began = perf_counter()
    try:
        with compile_clock() as clock, open_as_given(scene, settings=settings) as session:
            start = session.reset()
            setup = perf_counter() - began - clock()
            return _timed(session, start, names, setup, clock, runs=runs, limit=limit, length=length, told=told)
    except SceneRefused as error:
        return Outcome("refused", str(error))
    except SimulationFailed as error:
        return Outcome("failed", str(error))


def _timed(
    session: Session,
    start: Observation,
    names: tuple[str, ...],
    setup: float,
    clock: Callable[[], float],
    *,
    runs: int,
    limit: float,
    length: float | None,
    told: Told | None,
) -> Outcome:
    """The series of a session that was just reset, and the times of the runs after this one."""
    builder = SeriesBuilder(names, session.scene.step)
    builder.add(start)
    stop = _Limit(limit)
    before = clock()

    def collect(observation: Observation) -> None:
        builder.add(observation)
        stop.check(observation, clock() - before)
        if told is not None and length:
            told(min(1.0, observation.time / length) / (1 + runs))

    wall, cpu = perf_counter(), process_time()
    try:
        last = session.run(collect)
    except (_Stopped, SimulationFailed) as error:
        status: Status = "stopped" if isinstance(error, _Stopped) else "failed"
        series = builder.build()
        spent = perf_counter() - wall - (clock() - before)
        reached, n_steps = float(series.time[-1]), len(series.time) - 1
        return Outcome(status, str(error), None, (spent,), 0.0, spent, clock(), setup, reached, n_steps)
    compiled = clock() - before
    first = (perf_counter() - wall - compiled, process_time() - cpu - compiled)
    regions = last.regions.values()
    outcome = Outcome(
        status="done",
        series=builder.build(),
        setup=setup,
        simulated=last.time,
        steps=last.step,
        n_cells=sum(region.n_cells for region in regions),
        n_nodes=sum(region.n_nodes for region in regions),
    )
    assert outcome.series is not None
    if not outcome.series.finite():
        outcome = replace(outcome, status="failed", reason="it diverged: a quantity is not a number", series=None)
    timed = _repeat(session, runs if outcome.status == "done" else 0, first[0], clock, told) or [first]
    walls = tuple(wall for wall, _ in timed)
    spent = sum(walls) + (first[0] if timed[0] is not first else 0.0)
    return replace(outcome, walls=walls, cpu=min(cpu for _, cpu in timed), spent=spent, compiled=clock())


def _repeat(
    session: Session, runs: int, spent: float, clock: Callable[[], float], told: Told | None
) -> list[tuple[float, float]]:
    """Wall and processor time of further runs of an open session [s]; `spent` is the wall time of those before."""
    timed: list[tuple[float, float]] = []
    while len(timed) < runs and spent < ENOUGH:
        session.reset()
        before, wall, cpu = clock(), perf_counter(), process_time()
        session.run()
        compiled = clock() - before
        timed.append((perf_counter() - wall - compiled, process_time() - cpu - compiled))
        spent += timed[-1][0]
        if told is not None:
            told((1 + len(timed)) / (1 + runs))
    return timed
