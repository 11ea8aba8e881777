"""Rayleigh's damping of blocks against the ratio of a mode, free fall and spin; and sweeps that end on a residual."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pbd_run import Energy, PbdRun, Vector, cantilever, static_solution
from test_pbd_dynamics import BODIES
from test_pbd_leapfrog import kicked, modes, scene_of

from softseam_protocol.messages.participant import Advanced
from softseam_protocol.scene.file import load_scene
from softseam_protocol.scene.models import PbdSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.region import build_region
from softseam_services.calibration.measure import Bench, oscillation
from softseam_services.pbd.model import build_model
from softseam_services.pbd.parameters import build_parameters
from softseam_services.server import build_setup

Floats = NDArray[np.float64]
SCENES = Path(__file__).parents[2] / "scenes"
SIZE = (0.05, 0.05, 0.05)


@cache
def slowest() -> tuple[float, Floats]:
    """omega [rad/s] and the mode, largest displacement 0.1 mm, of the clamped block."""
    frequencies, shapes = modes(PbdRun(scene_of()))
    which = np.flatnonzero(frequencies > 1e-3 * frequencies[-1])[0]
    return float(frequencies[which]), 1e-4 * shapes[which] / np.abs(shapes[which]).max()


def damping_ratio(method: str, kind: str, mass: float, stiffness: float, substeps: int, sweeps: int = 1) -> float:
    """zeta of the slowest mode, from a period in 40 steps of so many substeps."""
    omega, mode = slowest()
    step = 2.0 * np.pi / omega / 40
    damping = {"mass": mass, "stiffness": stiffness}
    pbd = {"method": method, "substeps": substeps, "sweeps": sweeps, "damping": damping}
    scene = scene_of(step=step, kind=kind, pbd=pbd)
    run = PbdRun(scene, x=PbdRun(scene).body.x_rest + mode)
    q = []
    for _ in range(44):
        run.step()
        q.append(float((run.region.mass[:, None] * mode * (run.solver.positions - run.body.x_rest)).sum()))
    swing, decay = oscillation(np.array(q[2:]), step)
    return decay / float(np.hypot(swing, decay))


@pytest.mark.parametrize("kind", ["linear", "neo_hookean", "st_venant_kirchhoff"])
@pytest.mark.parametrize(("mass", "stiffness"), [(0.0, 0.1), (0.1, 0.1), (0.0, 0.6)])
def test_a_mode_is_damped_by_half_of_a_over_omega_and_b_omega(kind: str, mass: float, stiffness: float) -> None:
    """zeta = (a/omega + b omega)/2, implicit Euler's own included, since the substep is shorter than b."""
    omega = slowest()[0]
    found = damping_ratio("xpbd", kind, mass * omega, stiffness / omega, 10, sweeps=4)
    assert found == pytest.approx(0.5 * (mass + stiffness), abs=2e-4 + 5e-3 * stiffness)
    assert damping_ratio("xpbd", kind, mass * omega, stiffness / omega, 40) == pytest.approx(found, abs=5e-3)


def test_what_implicit_euler_damps_anyway_is_not_taken_away() -> None:
    """b shorter than the substep: omega h/2 is left, as without any."""
    omega = slowest()[0]
    h = 2.0 * np.pi / omega / 400
    for stiffness in (0.0, 0.5 * h, h):
        assert damping_ratio("xpbd", "linear", 0.0, stiffness, 10, sweeps=4) == pytest.approx(0.5 * omega * h, rel=1e-3)
    assert damping_ratio("xpbd", "linear", 0.0, 3.0 * h, 10, sweeps=4) == pytest.approx(1.5 * omega * h, rel=2e-3)


def test_leapfrog_takes_what_is_proportional_to_mass() -> None:
    omega = slowest()[0]
    assert damping_ratio("leapfrog", "linear", 0.0, 0.0, 10) == pytest.approx(0.0, abs=1e-6)
    assert damping_ratio("leapfrog", "neo_hookean", 0.3 * omega, 0.0, 10) == pytest.approx(0.15, abs=1e-4)


@pytest.mark.parametrize(("method", "error"), [("xpbd", 3e-3), ("leapfrog", 1e-6)])
def test_a_body_falls_as_in_air(method: str, error: float) -> None:
    """v = g/r (1 - exp(-r t)): no strain, whatever the substep; XPBD's is of first order, leapfrog's of second."""
    pbd = {"method": method, "damping": {"mass": 8.0}, "substeps": 20}
    run = PbdRun(scene_of(fixed=(), gravity=(0.0, 0.0, -9.81), pbd=pbd))
    last = run.run(0.25)[-1]
    wanted = -9.81 / 8.0 * (1.0 - np.exp(-8.0 * 0.25)) * run.region.mass.sum()
    assert last.momentum[2] == pytest.approx(wanted, rel=error)
    assert abs(last.strain) < 1e-12


def test_a_spin_is_not_damped_by_stiffness() -> None:
    """A free body spins at 15 rad/s and so is under stress: P_n not turned along would take b w^2 = 4.5 a second."""
    spin = []
    for stiffness in (0.0, 0.02):
        pbd = {"substeps": 80, "sweeps": 2, "damping": {"stiffness": stiffness}}
        scene = scene_of(step=0.01, kind="neo_hookean", fixed=(), body={"spin": (0.0, 15.0, 0.0)}, pbd=pbd)
        replies = PbdRun(scene).run(0.5)
        spin.append(replies[-1].angular_momentum[1] / replies[0].angular_momentum[1])
    assert 0.97 < spin[0] < 1.0 and spin[1] == pytest.approx(spin[0], abs=0.02)


def test_statics_stay_exact() -> None:
    """Where the blocks balance the load nothing moves, whatever the damping."""
    pbd = {"damping": {"mass": 5.0, "stiffness": 0.02}}
    run = PbdRun(cantilever((0.1, 0.05, 0.05), 0.05, 1e5, 0.3, pbd=pbd))
    x = static_solution(run, run.region.mass[:, None] * run.body.gravity)
    rested = PbdRun(run.scene, x=x)
    last = rested.run(0.5)[-1]
    assert last.extras["residual"] < 1e-9  # damping's own stress is no lag
    np.testing.assert_allclose(rested.x, x, atol=1e-10)
    assert np.abs(Energy(rested).force(x)).max() > 0.1


def kicks(body: tuple[Vector, float | Vector, float, bool], stiffness: float, kind: str) -> list[Advanced]:
    """The steps, of 50 substeps of the automatic length, of a body kicked at random with 5 % of c_p."""
    size, cell, poisson, clamped = body
    fixed = ({"min": (-1.0, -1.0, -1.0), "max": (-size[0] / 2, 1.0, 1.0)},) if clamped else ()
    law: dict[str, Any] = {"size": size, "cell": cell, "poisson": poisson, "fixed": fixed, "kind": kind}
    law["pbd"] = {"damping": {"stiffness": stiffness}}
    substeps = PbdRun(scene_of(**law)).solver.substeps
    law["pbd"]["substeps"] = 50
    run = kicked(scene_of(step=50 * 0.005 / substeps, **law))
    return [run.step() for _ in range(40)]


def gain(replies: list[Advanced]) -> float:
    """By how much a step's energy exceeded that before it, at most [1]."""
    energy = np.array([reply.kinetic + reply.strain for reply in replies])
    return float((energy[1:] / energy[:-1])[energy[1:] > 1e-5 * energy[0]].max()) - 1.0


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("stiffness", [5e-4, 1e-3, 1e-2, 0.1])
@pytest.mark.parametrize("kind", ["neo_hookean", "linear"])
def test_planned_substeps_are_stable_with_damping(
    body: tuple[Vector, float | Vector, float, bool], stiffness: float, kind: str
) -> None:
    """No step gains energy, and none is repeated but at the kick."""
    replies = kicks(body, stiffness, kind)
    assert not any(reply.alarms for reply in replies[1:])
    assert gain(replies) < 1e-5


@pytest.mark.parametrize("body", [BODIES[1], BODIES[5]])
def test_a_viscous_body_that_tumbles_gains_nothing(body: tuple[Vector, float | Vector, float, bool]) -> None:
    """Cubes and flat blocks, times of 210 and 370 substeps.

    Where what lags does not turn along (eq. (1) of `kernels.damping`) a step gains 0.2 %. Flat blocks that count with
    each axis for itself gain 21 %: the sweep's stress has a moment.
    """
    assert gain(kicks(body, 0.3, "neo_hookean")) < 1e-5


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45])
@pytest.mark.parametrize(
    ("size", "cell"),
    [(SIZE, 0.05), (SIZE, 0.025), ((0.05, 0.01, 0.01), 0.01), ((0.08, 0.02, 0.02), (0.005, 0.02, 0.02))],
)
def test_viscous_bodies_show_their_damping_in_twice_the_substeps(
    size: Vector, cell: float | Vector, poisson: float
) -> None:
    """A clamped block's slowest mode, to 7 %; without eq. (3) it is up to 22 % less, and of slices half."""
    fixed = ({"min": (-1.0, -1.0, -1.0), "max": (-size[0] / 2, 1.0, 1.0)},)
    counts = []
    for stiffness in (0.0, 4e-3):
        pbd = {"damping": {"stiffness": stiffness}}
        scene = scene_of(size=size, cell=cell, poisson=poisson, fixed=fixed, kind="neo_hookean", step=0.01, pbd=pbd)
        bench = Bench(scene, build_body(scene, {}))
        counts.append(bench.auto(1))
    assert counts[1] <= 2 * counts[0]
    shown, wanted = (np.log(1.0 - loss) for loss in (bench.show(counts[1], 1).loss, bench.wanted.loss))
    assert shown / wanted == pytest.approx(1.0, abs=0.07)


@pytest.mark.parametrize("name", ["sausage", "heavy_on_soft", "silken_tofu", "dumpling", "tofu_drop"])
def test_scenes_that_are_viscous_take_twice_the_substeps(name: str) -> None:
    """Of those that they would take without, at most; by omega_max sqrt(b h) the sausage took 12.7 times as many."""
    setup = build_setup(load_scene(SCENES / f"{name}.yaml").bundle)
    assert isinstance(setup.body, Body)
    region = build_region(setup.body, np.arange(setup.body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
    spec, body, tools = setup.scene.models.pbd, setup.body, setup.tools
    viscous = build_parameters(build_model(body, region, tools, spec), body, region, tools, spec)
    plain = replace(viscous, spec=viscous.spec.model_copy(update={"damping": PbdSpec().damping}))
    assert viscous.spec.damping.stiffness > 0.0
    assert viscous.substeps(setup.scene.step) <= 2 * plain.substeps(setup.scene.step)


def test_what_damping_cannot_do_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="substep would shrink with it"):
        scene_of(pbd={"method": "leapfrog", "damping": {"stiffness": 1e-3}})
    sheet = {"kind": "sheet", "size": (0.1, 0.1), "divisions": (2, 2), "density": 0.3, "stretch": 100.0, "bending": 0.0}
    scene = {**scene_of(pbd={}).model_dump(), "body": sheet}
    with pytest.raises(ValueError, match=r"say body\.damping"):
        Scene.model_validate({**scene, "models": {"pbd": {"damping": {"mass": 1.0}}}})
    with pytest.raises(ValueError, match="only blocks have a residual"):
        Scene.model_validate({**scene, "models": {"pbd": {"residual": 0.1, "sweeps": 4}}})
    with pytest.raises(ValueError, match="allow several"):
        scene_of(pbd={"residual": 0.1})


def swing(residual: float | None, sweeps: int) -> tuple[PbdRun, list[int], list[float], list[str]]:
    """A block kicked hard, 20 substeps a step near the limit: sweeps, residual and alarm of each of 20 steps."""
    plan = PbdRun(scene_of(kind="neo_hookean", pbd={}))
    pbd = {"substeps": 20, "sweeps": sweeps, "residual": residual}
    run = kicked(scene_of(step=20 * 2.0 / plan.solver.parameters.frequency, kind="neo_hookean", pbd=pbd))
    replies = [run.step() for _ in range(20)]
    return (
        run,
        [int(reply.extras["iterations"]) for reply in replies],
        [reply.extras["residual"] for reply in replies],
        ["; ".join(reply.alarms.values()) for reply in replies],
    )


def test_sweeps_end_on_the_residual_and_no_sooner() -> None:
    """Every step ends within the residual; a looser one takes fewer sweeps; all are far from the most."""
    counts = {}
    for residual in (0.1, 0.01):
        _, used, left, told = swing(residual, 40)
        assert max(left) <= residual and not any(told)
        assert all(20 <= n < 20 * 40 for n in used)
        counts[residual] = sum(used)
    fixed = swing(None, 40)
    assert set(fixed[1]) == {20 * 40}
    assert counts[0.1] < 0.8 * counts[0.01] < 0.8 * sum(fixed[1])
    one = swing(None, 1)
    assert max(one[2]) > 0.1


def test_sweeps_that_do_not_reach_the_residual_are_told() -> None:
    _, used, left, told = swing(1e-6, 3)
    assert set(used) == {60} and max(left) > 1e-6
    assert told[5] == "residual not reached in 20 of 20 substeps with 3 sweeps"
