"""A run whose steps get nowhere says so while they last, and ends in words; one that is slow but gets on does not."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
import time
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

import softseam
from softseam.errors import SimulationFailed
from softseam.observation import Observation
from softseam.running import Wishes, run
from softseam.step_watch import StepWatch, limit_for
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.session import Event

SCENE = """\
softseam: 1
name: cube
gravity: [0, 0, -9.81]
step: 0.01
duration: 0.05
body:
  shape: {kind: block, size: [0.04, 0.04, 0.04]}
  material: {young: 20.0e3, poisson: 0.45, density: 1050}
tools:
  ground: {kind: plane, friction: 0.5}
regions: {default: fem}
"""

SINKS = SCENE.replace("step: 0.01\nduration: 0.05", "step: 0.316\nduration: 1.58").replace("20.0e3", "20.0")
"""by twenty times its height under its own weight: its modulus is in kPa"""


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Observation:
    """After a step."""
    path = tmp_path_factory.mktemp("scene") / "cube.yaml"
    path.write_text(SCENE)
    with softseam.open(path) as session:
        session.reset()
        return session.step(fields=False)


def after(seen: Observation, step: int, *kinds: EventKind) -> Observation:
    return replace(seen, step=step, events=tuple(Event(seen.report.header, kind, "told") for kind in kinds))


def work(seconds: float) -> None:
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        time.sleep(0.01)


@pytest.mark.kernels
@pytest.mark.parametrize("limit", [0.3, 0.8, 1.3])
def test_a_step_that_is_not_solved_ends_the_run(limit: float, seen: Observation) -> None:
    began = time.perf_counter()
    with pytest.raises(SimulationFailed, match=f"step 8 was not solved within {limit:.0f} s: .*--step-limit"):
        with StepWatch(limit, lambda step, seconds: None) as watch:
            watch.taken(after(seen, 7))
            work(30.0)
    assert limit <= time.perf_counter() - began < 10.0


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("kinds", "words"),
    [
        ((EventKind.SOLVER,), "no step after step 3 was solved at once, for 1 s, and [0-9]+ had no solution:"),
        ((EventKind.STEP,), "no step after step 3 was solved at once, for 1 s:"),
        ((EventKind.MONITOR, EventKind.STEP), "no step after step 3 was solved at once, for 1 s:"),
    ],
)
def test_steps_that_get_nowhere_end_the_run(kinds: tuple[EventKind, ...], words: str, seen: Observation) -> None:
    """Each of them ends within the limit, but is slow, and was solved in parts or not at all."""
    with pytest.raises(SimulationFailed, match=words), StepWatch(1.0, lambda step, seconds: None) as watch:
        watch.taken(after(seen, 3))
        for step in range(4, 200):
            work(0.2)
            watch.taken(after(seen, step, *kinds))


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("seconds", "kinds"),
    [
        (0.6, ()),
        (0.6, (EventKind.REGIONS, EventKind.CELLS, EventKind.ENERGY)),
        (0.02, (EventKind.STEP, EventKind.MONITOR)),
    ],
)
def test_a_run_that_gets_on_is_let_be(seconds: float, kinds: tuple[EventKind, ...], seen: Observation) -> None:
    """Slow steps that are solved at once; hard ones that take a moment: in all, more than twice the limit."""
    with StepWatch(1.0, lambda step, taken: None) as watch:
        for step in range(1, 2 + round(2.4 / seconds)):
            work(seconds)
            watch.taken(after(seen, step, *kinds))


def test_without_a_limit_it_waits() -> None:
    with StepWatch(0.0, lambda step, seconds: None):
        work(1.5)


def test_another_thread_than_the_main_one_is_not_ended() -> None:
    """Where a program runs scenes in threads of its own, signals would reach another."""
    ended: list[bool] = []

    def watched() -> None:
        with StepWatch(0.3, lambda step, seconds: None):
            work(1.5)
        ended.append(True)

    thread = threading.Thread(target=watched)
    thread.start()
    thread.join(30.0)
    assert ended == [True]


def test_compiling_counts_for_nothing() -> None:
    began = time.perf_counter()
    with StepWatch(0.5, lambda step, seconds: None, lambda: time.perf_counter() - began):
        work(2.0)


def test_who_interrupts_is_not_told_of_a_limit() -> None:
    with pytest.raises(KeyboardInterrupt), StepWatch(5.0, lambda step, seconds: None):
        raise KeyboardInterrupt


@pytest.mark.kernels
def test_a_long_step_is_told_of(seen: Observation, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("softseam.step_watch.TELL", 0.5)
    told: list[tuple[int, float]] = []
    with StepWatch(0.0, lambda step, seconds: told.append((step, seconds))) as watch:
        watch.taken(after(seen, 11))
        work(2.7)
        watch.taken(after(seen, 12))
        work(0.3)
    assert [step for step, _ in told] == [12, 12, 12]
    assert all(low <= seconds < low + 0.9 for low, (_, seconds) in zip((0.5, 1.0, 2.0), told, strict=True))


def test_large_bodies_and_services_have_more_time() -> None:
    assert limit_for(300, False) < 30.0 < limit_for(10_000, False) < limit_for(10_000, True)


@pytest.mark.kernels
@pytest.mark.parametrize("young", [20.0, 40.0])
def test_a_scene_in_other_units_ends_in_words(young: float, tmp_path: Path) -> None:
    """It is warned of before the first step, and its steps are said to take long."""
    path, said = tmp_path / "cube.yaml", StringIO()
    path.write_text(SINKS.replace("20.0", str(young)))
    began = time.perf_counter()
    with pytest.raises(SimulationFailed, match=r"was (not )?solved"):
        run(Wishes(str(path), step_limit=1.0), Console(file=said, width=300))
    lines = said.getvalue().splitlines()
    setting_up = lines.index("cube: setting up")
    assert any(re.match(r"warning: .*cube.yaml:8:.*young: .*is the unit Pa", line) for line in lines[:setting_up])
    assert time.perf_counter() - began < 60.0


@pytest.mark.kernels
def test_a_sound_scene_runs_to_its_end(tmp_path: Path) -> None:
    path = tmp_path / "cube.yaml"
    path.write_text(SCENE)
    report = run(Wishes(str(path), step_limit=5.0), Console(file=StringIO()))
    assert report["verdict"]["outcome"] == "finished" and report["steps"] == 5


@pytest.mark.kernels
def test_it_ends_also_where_interrupts_are_ignored(tmp_path: Path) -> None:
    """As they are in what a script runs in the background."""
    path = tmp_path / "cube.yaml"
    path.write_text(SINKS)
    ignore = "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN)"
    code = f"{ignore}; from softseam.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", code, "run", str(path), "--step-limit", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1 and "--step-limit waits longer" in done.stderr
