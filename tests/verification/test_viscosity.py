"""A material's retardation time: damping ratios of modes in FEM, PBD and across a seam, spin, moments, refusals."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray
from pbd_run import PbdRun, block_scene

import softseam
from softseam_protocol.messages.participant import Advanced, BodyState
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.kinds import ElementKind, IntegratorKind
from softseam_protocol.scene.models import FemSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.calibration.measure import Bench, oscillation
from softseam_services.fem.kernels.elements import subtract_forces
from softseam_studies.study.configurations import configurations
from softseam_studies.study.frame import Frame
from softseam_studies.study.levels import Levels

Floats = NDArray[np.float64]
CLAMPED = [{"min": (-1.0, -1.0, -1e-6), "max": (1.0, 1.0, 1e-6)}]


def viscous(
    time: float, integrator: IntegratorKind = "implicit_euler", element: ElementKind = "hex27", **keys: Any
) -> Scene:
    """A weightless block, solved tightly, of a material with that retardation time [s]."""
    scene = block(gravity=(0.0, 0.0, 0.0), **keys)
    assert isinstance(scene.body, BodySpec)
    material = scene.body.material.model_copy(update={"retardation_time": time})
    fem = FemSpec(integrator=integrator, element=element, tolerance=1e-9)
    return scene.with_body(scene.body.model_copy(update={"material": material})).model_copy(
        update={
            "models": scene.models.model_copy(update={"fem": fem}),
        }
    )


def begun(scene: Scene, x: Floats, v: Floats) -> FemRun:
    n_points = len(build_body(scene, {}).surface.cell)
    state = BodyState(x, v, np.zeros((n_points, 3)), np.full(n_points, -1, dtype=np.int32))
    return FemRun(scene, state=state)


def clamped(time: float, integrator: IntegratorKind = "implicit_euler") -> Scene:
    return viscous(time, integrator, cell=0.05, poisson=0.3, body={"fixed": CLAMPED})


@cache
def modes() -> tuple[Floats, Floats]:
    """Frequencies [rad/s], ascending, and modes (k, n, 3) of the clamped cube of one cell, by differences of forces."""
    run = FemRun(clamped(0.0))
    model, parameters = run.model, run.parameters
    work, h = run.work, 1e-7
    free = np.flatnonzero(model.order >= 0)
    places = (3 * model.order[free][:, None] + np.arange(3)).ravel()
    K = np.zeros((len(places), len(places)))
    for node in free:
        for i in range(3):
            for sign in (1.0, -1.0):
                x = parameters.x_rest.copy()
                x[node, i] += sign * h
                r = np.zeros(len(places))
                subtract_forces(x, model, parameters, work, r)
                K[:, 3 * model.order[node] + i] -= sign * r / (2.0 * h)
    root = np.zeros(len(places))
    root[places] = 1.0 / np.sqrt(np.repeat(parameters.mass[free], 3))
    squares, vectors = np.linalg.eigh(root[:, None] * 0.5 * (K + K.T) * root)
    shapes = np.zeros((len(places), len(parameters.mass), 3))
    shapes[:, free] = (root[:, None] * vectors)[places].T.reshape(len(places), -1, 3)
    return np.sqrt(squares), shapes


def ratio(integrator: IntegratorKind, time: float, which: int, steps: int) -> float:
    """zeta of a mode from a period in so many steps."""
    frequencies, shapes = modes()
    mode = 1e-4 * shapes[which] / np.abs(shapes[which]).max()
    scene = clamped(time, integrator)
    rest = FemRun(scene).body.x_rest
    run, dt, q = begun(scene, rest + mode, np.zeros_like(mode)), 2.0 * np.pi / frequencies[which] / steps, []
    for _ in range(steps + 4):
        run.step(dt=dt)
        q.append(float((run.parameters.mass[:, None] * mode * (run.x - rest)).sum()))
    swing, decay = oscillation(np.array(q[2:]), dt)
    return decay / float(np.hypot(swing, decay))


@pytest.mark.parametrize("integrator", ["implicit_euler", "midpoint"])
@pytest.mark.parametrize("which", [0, 2, 5])
def test_a_mode_is_damped_by_half_of_omega_and_the_time(integrator: IntegratorKind, which: int) -> None:
    """zeta = tau omega/2, of bending, torsion and a middling mode; implicit Euler's own loss counts."""
    omega = float(modes()[0][which])
    for wanted in (0.05, 0.2):
        found = ratio(integrator, 2.0 * wanted / omega, which, 80)
        assert found == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize(("integrator", "order"), [("implicit_euler", 1.0), ("midpoint", 2.0)])
def test_the_ratio_converges(integrator: IntegratorKind, order: float) -> None:
    """zeta = 0.2 in 20, 40 and 80 steps a period: with the integrator's order."""
    time = 0.4 / float(modes()[0][0])
    errors = [abs(ratio(integrator, time, 0, steps) - 0.2) for steps in (20, 40, 80)]
    assert -np.polyfit(np.arange(3), np.log2(errors), 1)[0] == pytest.approx(order, abs=0.15)


def test_what_implicit_euler_loses_anyway_is_not_added_to() -> None:
    """A time below the step changes nothing, to the last bit; one above it does."""
    rest = FemRun(clamped(0.0)).body.x_rest
    ends = []
    for time in (0.0, 1.9e-3, 3e-3):
        run = begun(clamped(time), rest, 20.0 * rest)
        run.run(0.02, dt=2e-3)
        ends.append(run.x.copy())
    assert np.array_equal(ends[0], ends[1]) and np.abs(ends[0] - ends[2]).max() > 1e-5


def thrown(time: float, spin: tuple[float, float, float], bend: float = 0.0, **keys: Any) -> FemRun:
    """A free bar of two cells that tumbles, and bends where asked for [m/s]."""
    keys = {"size": (0.05, 0.03, 0.03), "cell": (0.025, 0.03, 0.03), **keys}
    scene = viscous(time, body={"spin": spin}, **keys)
    body = build_body(scene, {})
    v, along = body.v_initial.copy(), np.pi * body.x_rest[:, 0] / 0.05
    v[:, 2] += bend * np.sin(along) ** 2
    v[:, 1] += bend * np.cos(2.0 * along)
    return begun(scene, body.x_rest.copy(), v)


def left(replies: list[Advanced]) -> tuple[float, float]:
    """Change of the angular momentum over it, and the largest growth of energy in a step over it."""
    moment = [reply.angular_momentum for reply in replies]
    energy = np.array([reply.kinetic + reply.strain for reply in replies])
    change = float(np.linalg.norm(moment[-1] - moment[0]) / np.linalg.norm(moment[0]))
    return change, float((energy[1:] / energy[:-1]).max()) - 1.0


@pytest.mark.parametrize("spin", [(0.0, 15.0, 0.0), (8.0, 10.0, 6.0)])
def test_a_spin_is_not_damped(spin: tuple[float, float, float]) -> None:
    """A body that spins is under stress; forces that were not turned along would stop it at tau w^2 = 4.5 a second."""
    kept = [left(thrown(time, spin).run(0.3, dt=2e-3))[0] for time in (0.0, 0.02)]
    assert kept[1] == pytest.approx(kept[0], abs=1e-3) and kept[0] < 0.12


def test_moments_balance() -> None:
    """Tumbling and bending: momentum and angular momentum to rounding, energy falls."""
    for dt in (2e-3, 1e-3, 5e-4):
        replies = thrown(0.01, (8.0, 10.0, 6.0), bend=0.6).run(0.1, dt=dt)
        np.testing.assert_allclose(replies[-1].momentum, replies[0].momentum, atol=1e-12)
        change, growth = left(replies)
        assert growth < 0.0 and change < 1e-9


KINDS: list[tuple[str, ElementKind]] = [
    ("neo_hookean", "hex27"),
    ("neo_hookean", "hex8"),
    ("neo_hookean", "hex8_bbar"),
    ("neo_hookean", "tet10"),
    ("corotated", "hex27"),
    ("st_venant_kirchhoff", "hex27"),
    ("linear", "hex27"),
]


@pytest.mark.parametrize(("kind", "element"), KINDS)
@pytest.mark.parametrize("time", [2e-3, 0.02])
def test_no_step_gains_energy(kind: str, element: ElementKind, time: float) -> None:
    """Random kicks of 1 m/s: every step loses, with every element and law, at times near the step and far above."""
    run = thrown(time, (0.0, 0.0, 0.0), kind=kind, element=element, cell=(0.025, 0.03, 0.03))
    kick = np.random.default_rng(1).standard_normal(run.x.shape)
    replies = begun(run.scene, run.x.copy(), kick).run(0.02, dt=1e-3)
    assert left(replies)[1] < 0.0


# ---- both models ---------------------------------------------------------------------------------------------


def swayed(model: str, time: float, step: float, damping: float = 0.0) -> Floats:
    """Displacement of a clamped bar's tip that its weight sets swinging, half FEM and half PBD where hybrid [m]."""
    regions: dict[str, Any] = {"default": "pbd" if model == "hybrid" else model}
    if model == "hybrid":
        regions["near"] = {"model": "fem", "split": "always", "boxes": [{"min": (-1, -1, -1), "max": (0.0, 1, 1)}]}
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "sway",
            "step": step,
            "duration": 1.0,
            "gravity": (0.0, 0.0, -1.0),
            "body": {
                "shape": {"kind": "block", "size": (0.12, 0.03, 0.03)},
                "cell": 0.03,
                "material": {"young": 1e5, "poisson": 0.3, "density": 1000.0, "retardation_time": time},
                "fixed": [{"min": (-0.0601, -1.0, -1.0), "max": (-0.0599, 1.0, 1.0)}],
                "damping": damping,
            },
            "probes": {"tip": (0.06, 0.0, 0.015)},
            "regions": regions,
        }
    )
    with softseam.open(scene) as sim:
        sim.reset()
        return np.array([sim.step().quantities["tip.displacement"] for _ in range(round(0.5 / step))])


def lost(way: Floats) -> float:
    """zeta from the way there and the way back: the second is exp(-pi zeta/sqrt(1 - zeta^2)) of the first."""
    turn = next(i for i in range(1, len(way) - 1) if way[i] >= way[i + 1])
    back = turn + int(np.argmin(way[turn : turn + turn + turn // 2]))
    log = np.log(way[turn] / (way[turn] - way[back])) / np.pi
    return float(log / np.hypot(1.0, log))


def test_both_models_and_a_seam_damp_alike() -> None:
    """zeta = tau omega/2 of a bar's sway, omega 20.4 1/s: 0.143 at 14 ms, and 0.1417 where higher modes ride on it.

    The mass beyond a seam feels half of what implicit Euler loses: there it converges with the step.
    """
    fem, pbd = lost(swayed("fem", 0.014, 2e-3)), lost(swayed("pbd", 0.014, 2e-3))
    assert fem == pytest.approx(0.1405, abs=3e-3) and pbd == pytest.approx(fem, rel=0.015)
    short = [lost(swayed("fem", 0.014, step)) - lost(swayed("hybrid", 0.014, step)) for step in (4e-3, 2e-3, 1e-3)]
    assert 0.0 < short[2] < 0.03 * fem
    assert -np.polyfit(np.arange(3), np.log2(short), 1)[0] == pytest.approx(1.0, abs=0.25)


def test_pbd_takes_the_materials_time_for_its_own() -> None:
    """To the last bit what models.pbd.damping.stiffness gives, and calibration finds it."""
    ends = []
    for keys in ({"pbd": {"damping": {"stiffness": 2e-3}}}, {}):
        scene = block_scene((0.05, 0.05, 0.025), 0.025, step=0.01, gravity=(0.0, 0.0, 0.0), **keys)  # type: ignore[arg-type]
        if not keys:
            assert isinstance(scene.body, BodySpec)
            material = scene.body.material.model_copy(update={"retardation_time": 2e-3})
            scene = scene.with_body(scene.body.model_copy(update={"material": material}))
        rest = PbdRun(scene).body.x_rest
        run = PbdRun(scene, v=20.0 * rest)
        run.run(0.05)
        ends.append(run.solver.positions.copy())
    assert np.array_equal(ends[0], ends[1])
    bench = Bench(scene, build_body(scene, {}))
    zeta = 1e-3 * 2.0 * np.pi * bench.wanted.blocks
    assert bench.wanted.loss == pytest.approx(1.0 - np.exp(-2.0 * np.pi * zeta / np.sqrt(1.0 - zeta**2)))
    assert bench.show(20, 2).loss == pytest.approx(bench.wanted.loss, abs=5e-3)


def test_what_does_not_go_with_it_is_refused_by_name() -> None:
    given = clamped(1e-3).model_dump()
    with pytest.raises(ValueError, match="bdf2 does not know body"):
        Scene.model_validate({**given, "models": {"fem": {"integrator": "bdf2"}}, "regions": {"default": "fem"}})
    pbd = {**given, "regions": {"default": "pbd"}}
    with pytest.raises(ValueError, match="substep would shrink with body"):
        Scene.model_validate({**pbd, "models": {"pbd": {"method": "leapfrog"}}})
    with pytest.raises(ValueError, match="says the same for both models"):
        Scene.model_validate({**pbd, "models": {"pbd": {"damping": {"stiffness": 1e-3}}}})


def test_charts_and_plans_leave_out_what_refuses_it() -> None:
    for time, least in ((0.0, "bdf2"), (1e-3, "midpoint")):
        frame = Frame(clamped(time), np.full(3, 0.05))
        assert Levels("free", (), frame, ()).integrator == least
        assert any("bdf2" in one.key for one in configurations(frame)) == (time == 0.0)
