"""A run in a study ends at its limit, also within a step and within a kernel, and what comes after it is sound."""

from __future__ import annotations

import re
import signal
import threading
import time
from pathlib import Path

import pytest

import softseam
from softseam.embedded import halt
from softseam.errors import SimulationFailed
from softseam.interrupt import Ended, Interrupt
from softseam_studies.study.measure import measure

pytestmark = pytest.mark.kernels

SCENE = """\
softseam: 1
name: cube
step: {step}
duration: {duration}
body:
  shape: {{kind: block, size: [0.04, 0.04, 0.04]}}
  cell: {cell}
  material: {{young: {young}, poisson: 0.45, density: 1050}}
tools:
  ground: {{kind: plane, friction: 0.5}}
regions: {{default: fem}}
quantities: [sag]
"""

SOUND = {"step": 0.01, "duration": 0.05, "young": 20e3}
SINKS = {"step": 0.316, "duration": 1.58, "young": 20.0}
"""by twenty times its height under its own weight"""


@pytest.fixture(scope="module", autouse=True)
def loaded(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Kernels, so that no time goes into them."""
    path = tmp_path_factory.mktemp("scene") / "cube.yaml"
    path.write_text(SCENE.format(cell=0.02, **SOUND))
    assert measure(str(path), (), ("sag",), runs=0).status == "done"


@pytest.mark.parametrize(("cell", "limit"), [(0.02, 0.7), (0.01, 1.5), (0.0025, 3.0)])
def test_a_run_is_stopped_within_a_step(cell: float, limit: float, tmp_path: Path) -> None:
    """An iteration of the smallest cells takes a second or two, and one kernel does thirty of them."""
    path = tmp_path / "cube.yaml"
    path.write_text(SCENE.format(cell=cell, **SINKS))
    began = time.perf_counter()
    found = measure(str(path), (), ("sag",), limit=limit)
    assert found.status == "stopped" and found.series is None
    assert re.fullmatch(rf"stopped at 0(\.\d+)? s of motion, after {limit:.0f} s", found.reason)
    assert found.setup + limit <= time.perf_counter() - began
    assert found.cpu < found.setup + limit + 12.0  # of the processor: a busy machine takes longer
    sound = measure(
        str(path), ("step=0.01", "duration=0.05", "body.material.young=20e3", "body.cell=0.02"), ("sag",), runs=0
    )
    assert sound.status == "done" and sound.series is not None


def test_what_ends_in_time_is_let_be() -> None:
    before = signal.getsignal(signal.SIGUSR1)
    with Interrupt("test", lambda: False) as interrupt:
        time.sleep(1.2)
    assert not interrupt.ended and signal.getsignal(signal.SIGUSR1) is before


def test_another_thread_than_the_main_one_goes_on() -> None:
    """It would not hear of it: so solvers, which are the process's, are not halted for it either."""
    seen: list[bool] = []

    def watched() -> None:
        with Interrupt("test", lambda: True) as interrupt, softseam.open("tofu_grasp") as session:
            session.reset()
            for _ in range(3):
                session.step()
            time.sleep(1.2)
            session.step()
            seen.append(all(event.kind != "solver" for event in session.step().events))
        seen.append(interrupt.ended)

    thread = threading.Thread(target=watched)
    thread.start()
    thread.join(60.0)
    assert seen == [True, False]


def test_sessions_of_other_threads_are_not_halted() -> None:
    """While what the main thread does is ended, and before it is."""
    seen: list[bool] = []
    over = threading.Event()

    def beside() -> None:
        with softseam.open("tofu_grasp") as session:
            session.reset()
            while not over.is_set():
                seen.append(all(event.kind != "solver" for event in session.step().events))

    thread = threading.Thread(target=beside)
    thread.start()
    halt(True)
    try:
        while len(seen) < 5 and thread.is_alive():
            time.sleep(0.05)
    finally:
        halt(False)
        over.set()
        thread.join(60.0)
    assert len(seen) >= 5 and all(seen)


@pytest.mark.parametrize("error", [None, SimulationFailed("the step has no solution")])
def test_what_a_halted_solver_came_to_does_not_count(error: SimulationFailed | None) -> None:
    """It may come to its end, or fail, before the main thread hears that it is ended."""
    with Interrupt("test", lambda: True) as interrupt:
        try:
            time.sleep(30.0)
        except Ended:
            if error is not None:
                raise error from None
    assert interrupt.ended


def test_who_interrupts_what_is_ended_is_heard() -> None:
    with pytest.raises(KeyboardInterrupt), Interrupt("test", lambda: True) as interrupt:
        try:
            time.sleep(30.0)
        except Ended:
            raise KeyboardInterrupt from None
    assert not interrupt.ended
