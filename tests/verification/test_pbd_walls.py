"""A PBD block between tools: no energy from nowhere, and rest that stays rest."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from pbd_run import PbdRun, Vector, block_scene

from softseam_protocol.messages.participant import Advanced

EDGE = 0.02
N_RAMP = 20


def _walls(axes: str, friction: float = 0.0) -> dict[str, Any]:
    """Planes on both sides of a cube that stands on z = 0 at the origin, along the axes named."""
    tools = {}
    for axis in axes:
        for side in (-1, 1):
            normal, point = [0.0, 0.0, 0.0], [0.0, 0.0, EDGE / 2]
            normal["xyz".index(axis)] = -float(side)
            point["xyz".index(axis)] += 0.5 * EDGE * side
            tools[f"{axis}{'ab'[side > 0]}"] = {
                "kind": "plane",
                "normal": normal,
                "point": point,
                "friction": friction,
            }
    return tools


def _cube(
    cells: int, axes: str, friction: float, poisson: float, substeps: int | str = "auto", time: float = 0.0
) -> PbdRun:
    """A cube of soft rubber, E 20 kPa, between walls; time: of its damping in proportion to stiffness [s]."""
    tools = _walls(axes, friction)
    spec = {"substeps": substeps, "damping": {"stiffness": time}}
    return PbdRun(block_scene((EDGE,) * 3, EDGE / cells, poisson=poisson, density=1000.0, tools=tools, pbd=spec))


def _squeeze(run: PbdRun, share: float) -> list[Advanced]:
    """Close the walls across x by this share of the edge within 0.1 s."""
    run.velocity[0, 0], run.velocity[1, 0] = 0.5 * share * EDGE / 0.1, -0.5 * share * EDGE / 0.1
    replies = [run.step() for _ in range(N_RAMP)]
    run.velocity[:] = 0.0
    return replies


def _spectral_radius(run: PbdRun, turn: float) -> float:
    """Of one substep h = turn / omega_max about the state that the run has settled into: its Jacobian, by differences.

    Eigenvalues about 1 are left out: rigid motions along smooth walls.
    """
    solver, work = run.solver, run.work
    h = turn / solver.parameters.frequency
    request = dataclasses.replace(run.request(), dt=h)
    run.scratch.dt, run.scratch.planned = h, 1
    state = run.committed
    buffer = state.buffer
    force = np.abs(state.force) > 1e-6 * np.abs(state.force).max()
    edge = EDGE / 4.0
    filled = solver.parameters.blocks.volume > 0.0
    stress = np.broadcast_to(filled[:, None, :], (len(filled), 21, 4)).reshape(state.stress.shape)
    sizes = {"x": 1e-5 * edge, "v": 1e-5 * edge / h, "stress": 0.2 * edge**3, "force": 0.2 * edge**2}
    size = np.zeros_like(buffer)
    begin = 0
    for name in ("x", "v", "a", "stress", "force", "slip", "force_mean", "monitor"):
        values = getattr(state, name)
        changed = {"stress": stress, "force": force}.get(name, np.ones_like(values, dtype=bool))
        size[begin : begin + values.size] = sizes.get(name, 0.0) * changed.ravel()
        begin += values.size
    at = np.flatnonzero(size)
    start = buffer.copy()
    columns = []
    for i in at:
        ends = []
        for sign in (1.0, -1.0):
            buffer[:] = start
            buffer[i] += sign * size[i]
            run.attempt(request)
            ends.append(work.buffer[at].copy())
        columns.append(0.5 * (ends[0] - ends[1]) / size[at])
    buffer[:] = start
    values = np.linalg.eigvals(np.array(columns).T)
    return float(np.abs(values[np.abs(values - 1.0) > 3e-3]).max())


@pytest.mark.parametrize(
    ("axes", "friction", "poisson", "turn"),
    [
        ("x", 0.0, 0.2, 1.2),
        ("x", 0.0, 0.3, 1.5),
        ("x", 0.0, 0.45, 2.9),
        ("x", 2.0, 0.3, 3.0),
        ("x", 2.0, 0.45, 3.0),
        ("xyz", 0.0, 0.3, 2.2),
    ],
)
def test_no_mode_of_a_substep_grows_between_walls(axes: str, friction: float, poisson: float, turn: float) -> None:
    """A substep of turn / omega_max, longer than the automatic one, on one cell, eight blocks.

    Where held nodes count in full these are 1.007, 1.010, 1.010, 1.065, 1.015 and 1.028: a hundred substeps are enough.
    """
    run = _cube(1, axes, friction, poisson)
    _squeeze(run, 0.1)
    for _ in range(40):
        run.step()
    assert _spectral_radius(run, turn) < 1.0


@pytest.mark.parametrize(("axes", "friction"), [("x", 0.0), ("x", 2.0), ("xyz", 0.0)])
@pytest.mark.parametrize("substeps", [2.0, 20.0])
def test_no_mode_of_a_viscous_substep_grows_between_walls(axes: str, friction: float, substeps: float) -> None:
    """A third longer than half of the longest without damping, with a time of so many of these.

    With the local compliance that undamped blocks count with they grow between smooth walls at 20, see
    `kernels.damping`, eq. (4).
    """
    longest = 1.3 / _cube(1, axes, friction, 0.3).solver.parameters.frequency
    run = _cube(1, axes, friction, 0.3, time=substeps * longest)
    _squeeze(run, 0.1)
    for _ in range(40):
        run.step()
    assert _spectral_radius(run, 1.3 * 1.3 / 2.0) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("axes", "squeeze"), [("xyz", 0.3), ("x", 0.3)])
def test_a_squeezed_cube_comes_to_rest_and_stays_there(axes: str, squeeze: float) -> None:
    """10^4 steps: its kinetic energy falls to rounding, its force stays, and no step gains energy."""
    run = _cube(2, axes, 0.0, 0.3)
    _squeeze(run, squeeze)
    replies = [run.step() for _ in range(10_000)]
    early, last = replies[400], replies[-1]
    assert all(reply.status == "converged" and not reply.alarms for reply in replies)
    assert max(reply.kinetic for reply in replies[400:]) < 1e-16 * last.strain
    np.testing.assert_allclose(last.wrench, early.wrench, atol=1e-8 * np.abs(last.wrench).max())


def test_a_body_that_gains_energy_takes_shorter_substeps() -> None:
    """Half the substeps of `auto`, in which a box is unstable: the monitor says so, and the body comes to rest."""
    run = _cube(2, "xyz", 0.0, 0.3, substeps=6)
    replies = _squeeze(run, 0.1)
    assert sum("shorter substeps" in "".join(reply.alarms.values()) for reply in replies) == 1
    replies = [run.step() for _ in range(600)]
    last = replies[-1]
    assert {reply.extras["n_substeps"] for reply in replies} == {12}
    assert last.kinetic < 1e-15 * last.strain
    assert max(reply.kinetic + reply.strain for reply in replies) < 1.001 * last.strain


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("poisson", [0.2, 0.3, 0.45])
def test_a_flat_landing_gains_nothing(poisson: float, friction: float) -> None:
    """At 0.05 to 1 m/s, in steps of 2 and 10 ms and wherever within a step: up to 40 % of the energy of the fall
    appeared with the longer substeps that tools without friction had."""
    for speed in (0.05, 0.3, 1.0):
        for step, height in ((0.002, 0.0017), (0.002, 0.0026), (0.01, 0.001), (0.01, 0.0035)):
            assert _gain(poisson, friction, speed, step, height * speed) < 0.01


def _gain(poisson: float, friction: float, speed: float, step: float, height: float) -> float:
    """Highest rise of the energy after any moment of a fall, relative to the energy of the fall."""
    size: Vector = (EDGE, EDGE, EDGE)
    floor = {"kind": "plane", "point": (0.0, 0.0, 0.0), "normal": (0.0, 0.0, 1.0), "friction": friction}
    run = PbdRun(
        block_scene(
            *(size, EDGE / 2),
            poisson=poisson,
            density=1000.0,
            gravity=(0.0, 0.0, -9.81),
            step=step,
            position=(0.0, 0.0, height),
            tools={"floor": floor},
            body={"velocity": (0.0, 0.0, -speed)},
        )
    )
    energy = 0.5 * float(run.region.mass.sum()) * speed**2
    values = [energy]
    for reply in run.run(0.05):
        values.append(reply.kinetic + reply.strain + reply.gravity)
    return float(np.max(values - np.minimum.accumulate(values)) / energy)
