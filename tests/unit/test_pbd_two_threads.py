"""Two threads at a PBD step: the same bits as one, with a second thread that is punctual, late, or never comes."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest
from pbd_run import PbdRun, block_scene

from softseam_services.pbd import compliance, two_threads
from softseam_services.pbd.kernels.thread_team import first_range, new_team, next_range
from softseam_services.pbd.two_threads import TwoThreads, share_out

PLATE = {"kind": "box", "size": (0.01, 0.2, 0.2), "friction": 0.6}


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Every step by two threads."""
    monkeypatch.setattr(two_threads, "WORTH_TWO", 1)
    monkeypatch.setattr(two_threads, "cores", lambda: 2)
    monkeypatch.setattr(TwoThreads, "pays", lambda self: self.possible)
    yield


def held_up(free: threading.Event) -> threading.Thread:
    """Somebody whose work the second thread is at, until it is free."""
    at_work = threading.Event()

    def work(share: int) -> None:
        if share == 0:
            assert at_work.wait(10.0)
        else:
            at_work.set()
            free.wait(60.0)

    other = threading.Thread(target=share_out, args=(work,))
    other.start()
    assert at_work.wait(10.0)
    return other


def squeeze(steps: int) -> PbdRun:
    """An odd box of 8 x 6 x 10 blocks on the ground, squeezed and sheared by plates, of a general material."""
    tools = {
        "ground": {"kind": "plane", "friction": 0.6},
        "left": {**PLATE, "position": (-0.0551, 0.0, 0.06)},
        "right": {**PLATE, "position": (0.0551, 0.0, 0.06)},
    }
    scene = block_scene(
        (0.1, 0.075, 0.125),
        0.025,
        gravity=(0.0, 0.0, -9.81),
        tools=tools,
        moved=("left", "right"),
        pbd={"substeps": 12, "sweeps": 2},
    )
    run = PbdRun(scene)
    run.velocity[1:, 0] = 0.05, -0.05
    run.velocity[1, 2] = 0.02
    for _ in range(steps):
        run.step()
    return run


@pytest.mark.kernels
def test_two_threads_make_the_bits_of_one(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    one = squeeze(8)
    assert not one.scratch.pair.possible
    request.getfixturevalue("two")
    both = squeeze(8)
    assert both.scratch.pair.possible
    assert both.solver.snapshot() == one.solver.snapshot()
    np.testing.assert_array_equal(both.figures, one.figures)


@pytest.mark.kernels
@pytest.mark.parametrize("residual", [None, 2e-2])
def test_two_threads_damp_and_stop_as_one(residual: float | None, request: pytest.FixtureRequest) -> None:
    def swing() -> tuple[PbdRun, list[int]]:
        pbd = {"sweeps": 5, "residual": residual, "damping": {"mass": 1.0, "stiffness": 0.01}}
        scene = block_scene((0.1, 0.075, 0.125), 0.025, pbd=pbd)
        rest = PbdRun(scene).body.x_rest
        run = PbdRun(scene, x=rest + 0.3 * rest[:, [1, 2, 0]])
        return run, [int(run.step().extras["iterations"]) for _ in range(6)]

    one, sweeps = swing()
    request.getfixturevalue("two")
    both, sweeps_of_two = swing()
    assert sweeps == sweeps_of_two and (len(set(sweeps)) > 1) == (residual is not None)
    assert both.solver.snapshot() == one.solver.snapshot()


@pytest.mark.kernels
def test_two_threads_leap_as_one(request: pytest.FixtureRequest) -> None:
    def leap() -> PbdRun:
        scene = block_scene((0.1, 0.075, 0.125), 0.025, gravity=(0.0, 0.0, -9.81), pbd={"method": "leapfrog"})
        rest = PbdRun(scene).body.x_rest
        run = PbdRun(scene, x=rest + 0.03 * rest[:, [1, 2, 0]])
        run.run(0.03)
        return run

    one = leap()
    request.getfixturevalue("two")
    both = leap()
    assert both.scratch.pair.possible
    assert both.solver.snapshot() == one.solver.snapshot()
    np.testing.assert_array_equal(both.figures, one.figures)


@pytest.mark.kernels
@pytest.mark.usefixtures("two")
def test_nothing_waits_for_a_second_thread_that_does_not_come() -> None:
    """Held up by something else it is not missed: the steps are taken alone."""
    free = threading.Event()
    blocked = held_up(free)
    late = squeeze(3).solver.snapshot()
    assert blocked.is_alive()
    free.set()
    blocked.join(10.0)
    assert squeeze(3).solver.snapshot() == late


@pytest.mark.kernels
def test_a_stretch_is_shared_out_once() -> None:
    """Halves from both ends until nothing is left; a thread that is behind finds nothing in an older stretch."""
    team = new_team(alone=False)
    taken = np.zeros(100, dtype=int)
    worker, n_done = 0, [0, 0]
    first, end = first_range(team, 0, 0, 100, worker, 4)
    while first < end:
        taken[first:end] += 1
        n_done[worker] = end - first
        worker = 1 - worker
        first, end = next_range(team, 0, worker, n_done[worker], 4)
    assert (taken == 1).all()
    assert next_range(team, 0, 1 - worker, n_done[1 - worker], 4) == (0, 0)
    assert first_range(team, 100, 1, 10, 1, 4) == (5, 10)
    assert first_range(team, 0, 0, 100, 0, 4) == (0, 0)


def test_the_faster_way_is_taken_and_the_other_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(two_threads, "WORTH_TWO", 1)
    monkeypatch.setattr(two_threads, "cores", lambda: 2)
    chooser = TwoThreads(np.zeros(1), np.array([0, 10], dtype=np.int32), 10)
    chooser.seconds = [1.0, 0.6]
    chosen = [chooser.pays()]
    for chooser.n_runs in range(1, two_threads.TRIAL):
        chosen.append(chooser.pays())
    assert chosen == [True] * (two_threads.TRIAL - 1) + [False]
    chooser.seconds = [1.0, 1.1]
    chooser.n_runs = 0
    assert not chooser.pays()
    small = TwoThreads(np.zeros(1), np.array([0, 0], dtype=np.int32), 10)
    assert not small.pays()


@pytest.mark.kernels
def test_a_probe_that_two_threads_share_finds_the_bits_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the second thread is held up by something else, and in contact with a tool."""
    scene = block_scene(
        (0.075, 0.05, 0.05), 0.025, tools={"ground": {"kind": "plane", "friction": 0.5}}, gravity=(0.0, 0.0, -9.81)
    )
    x = PbdRun(scene).body.x_rest
    end, free = np.flatnonzero(x[:, 0] > x[:, 0].max() - 1e-9).astype(np.int32), threading.Event()

    def probed(threads: int, longer: int, late: bool = False) -> tuple[np.ndarray, np.ndarray]:
        monkeypatch.setattr(compliance, "cores", lambda: threads)
        monkeypatch.setattr(compliance, "WORTH_TWO", longer)
        run = PbdRun(scene, seam=end)
        for _ in range(4):
            run.step()
        blocked = held_up(free) if late else None
        told = run.solver.advance(run.request(compliance=True)).coupling.compliance
        assert len(run.solver._probe._benches) == (2 if threads == 2 and longer == 1 else 1)  # type: ignore[union-attr]
        assert blocked is None or blocked.is_alive()
        free.set()
        return told, run.solver._ways

    alone = probed(1, 1)
    assert alone[0].any() and alone[1].any()
    for threads, longer, late in ((2, 1, False), (2, 1, True), (2, 10**9, False)):
        free.clear()
        for one, other in zip(alone, probed(threads, longer, late), strict=True):
            np.testing.assert_array_equal(one, other)
