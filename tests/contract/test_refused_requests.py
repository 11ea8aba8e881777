"""Every participant refuses a request that no kernel could read safely, says why, and stays where it was."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from fem_run import FemRun, block
from particle_run import ParticleRun, particle_scene
from pbd_run import PbdRun, block_scene

from softseam_protocol.messages.participant import Advance, ToolMotion
from softseam_protocol.participant.solver import Solver

pytestmark = pytest.mark.kernels

GROUND = {"ground": {"kind": "plane", "friction": 0.5}}
SHEET = {
    "kind": "sheet",
    "size": [0.1, 0.1],
    "divisions": [4, 4],
    "position": [0.0, 0.0, 0.05],
    "density": 0.2,
    "stretch": 100.0,
}
Case = tuple[Solver, Advance]


def _fem() -> Case:
    run = FemRun(block(tools=GROUND), seam=lambda body, cells: np.arange(3, dtype=np.int32))
    run.step()
    return run.solver, run.request()


def _pbd() -> Case:
    run = PbdRun(block_scene(tools=GROUND))
    run.step()
    return run.solver, run.request()


def _particles() -> Case:
    run = ParticleRun(particle_scene(SHEET, tools=GROUND))
    run.step()
    return run.solver, run.request()


def _tools(request: Advance, **changes: object) -> Advance:
    return replace(request, tools=replace(request.tools, **changes))  # type: ignore[arg-type]


def _more_tools(request: Advance) -> Advance:
    motion = request.tools
    poses = (motion.position, motion.orientation, motion.position_next, motion.orientation_next)
    first, turn, last, turn_last = (np.tile(pose, (2, 1)) for pose in poses)
    return replace(request, tools=ToolMotion(first, turn, last, turn_last))


BAD: dict[str, tuple[Callable[[Advance], Advance], str]] = {
    "dt is no number": (lambda r: replace(r, dt=float("nan")), "the time step is nan s: not finite"),
    "dt is zero": (lambda r: replace(r, dt=0.0), "the time step is 0.0 s: .*not positive"),
    "time runs backwards": (lambda r: replace(r, dt=-0.01), "the time step is -0.01 s"),
    "too much seam": (lambda r: replace(r, coupling_force=np.zeros((5, 3))), "the seam force has shape"),
    "flat seam": (lambda r: replace(r, coupling_force=np.zeros(3)), "the seam force has shape"),
    "too many tools": (_more_tools, "tool poses of 1 tools have shape"),
    "no tools": (lambda r: _tools(r, position_next=np.zeros((0, 3))), "tool poses of 1 tools have shape"),
    "a pose at infinity": (lambda r: _tools(r, position=np.full((1, 3), np.inf)), "tool poses are not finite"),
}


@pytest.mark.parametrize("build", [_fem, _pbd, _particles])
def test_what_no_kernel_could_read_is_refused_in_words_and_changes_nothing(build: Callable[[], Case]) -> None:
    solver, request = build()
    before = solver.snapshot()
    for name, (spoil, words) in BAD.items():
        reply = solver.advance(spoil(request))
        assert np.isfinite(reply.wrench).all() and np.isfinite(reply.momentum).all(), name
        assert re.search(words, reply.why), (name, reply.why)
        assert solver.snapshot() == before, name
    assert solver.advance(request).status == "converged"
