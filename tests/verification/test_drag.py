"""A body's damping, the drag -a M v: modes, free flight, the fall of least speed, and what does not go with it."""

from __future__ import annotations

import numpy as np
import pytest
from fem_run import FemRun, block
from pbd_run import PbdRun, block_scene
from test_viscosity import begun, clamped, lost, modes, swayed

from softseam_protocol.scene.kinds import IntegratorKind
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.calibration.measure import Bench, oscillation
from softseam_services.orchestrator.rollout import NotDifferentiable, check_differentiable
from softseam_studies.study.configurations import configurations
from softseam_studies.study.frame import Frame


def dragged(scene: Scene, drag: float) -> Scene:
    assert scene.body.kind == "cells"
    return scene.with_body(scene.body.model_copy(update={"damping": drag}))


def decay(integrator: IntegratorKind, drag: float, steps: int) -> float:
    """Of the slowest mode [1/s], from a period in so many steps."""
    frequencies, shapes = modes()
    mode = 1e-4 * shapes[0] / np.abs(shapes[0]).max()
    scene = dragged(clamped(0.0, integrator), drag)
    rest = FemRun(scene).body.x_rest
    run, dt, q = begun(scene, rest + mode, np.zeros_like(mode)), 2.0 * np.pi / frequencies[0] / steps, []
    for _ in range(steps + 4):
        run.step(dt=dt)
        q.append(float((run.parameters.mass[:, None] * mode * (run.x - rest)).sum()))
    return oscillation(np.array(q[2:]), dt)[1]


def test_a_mode_decays_with_half_of_the_drag() -> None:
    """exp(-a t/2): midpoint within 2e-3 and by second order, implicit Euler beside its own loss of omega^2 h/2."""
    omega = float(modes()[0][0])
    drag = 0.2 * omega
    errors = [abs(2.0 * decay("midpoint", drag, steps) / drag - 1.0) for steps in (20, 40, 80)]
    assert errors[2] < 2e-3 and -np.polyfit(np.arange(3), np.log2(errors), 1)[0] == pytest.approx(2.0, abs=0.2)
    added = decay("implicit_euler", drag, 320) - decay("implicit_euler", 0.0, 320)
    assert added == pytest.approx(0.5 * drag, rel=0.02)


@pytest.mark.parametrize("integrator", ["implicit_euler", "midpoint"])
def test_a_free_body_slows_down_and_falls_no_faster_than_g_over_a(integrator: IntegratorKind) -> None:
    """v1/v0 is 1/(1 + a h), or (1 - a h/2)/(1 + a h/2), and g/a the speed that a fall ends with, to rounding."""
    drag, dt = 30.0, 0.01
    for gravity, start in ((0.0, 2.0), (-9.81, 0.0)):
        body = {"velocity": (start, 0.0, 0.0), "damping": drag}
        scene = block(gravity=(0.0, 0.0, gravity), cell=0.05, body=body)
        fem = scene.models.fem.model_copy(update={"integrator": integrator})
        run = FemRun(scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})}))
        first = run.step(dt=dt)
        speed = np.array(first.momentum) / run.parameters.mass.sum()
        if start:
            half = 0.5 * drag * dt
            slowed = 1.0 / (1.0 + 2.0 * half) if integrator == "implicit_euler" else (1.0 - half) / (1.0 + half)
            assert speed[0] == pytest.approx(slowed * start, rel=1e-9)
        else:
            last = run.run(1.0, dt=dt)[-1]
            end = float(last.momentum[2]) / run.parameters.mass.sum()
            assert end == pytest.approx(gravity / drag, rel=1e-8)


def test_both_models_and_a_seam_lose_alike() -> None:
    """zeta of a bar's sway, omega 20.4 1/s, grows by a/(2 omega) = 0.1, in FEM, in PBD and where they share it."""
    drag, omega, step = 4.08, 20.4, 2e-3
    for model in ("fem", "pbd", "hybrid"):
        grown = lost(swayed(model, 0.0, step, drag)) - lost(swayed(model, 0.0, step))
        assert grown == pytest.approx(0.5 * drag / omega, rel=0.04), model


def test_pbd_takes_the_bodys_damping_for_its_own() -> None:
    """To the last bit what models.pbd.damping.mass gives, and calibration finds it."""
    ends = []
    for keys in ({"pbd": {"damping": {"mass": 5.0}}}, {}):
        scene = block_scene((0.05, 0.05, 0.025), 0.025, step=0.01, gravity=(0.0, 0.0, 0.0), **keys)  # type: ignore[arg-type]
        scene = scene if keys else dragged(scene, 5.0)
        rest = PbdRun(scene).body.x_rest
        run = PbdRun(scene, v=20.0 * rest)
        run.run(0.05)
        ends.append(run.solver.positions.copy())
    assert np.array_equal(ends[0], ends[1])
    wanted = Bench(scene, build_body(scene, {})).wanted
    zeta = 0.5 * 5.0 / (2.0 * np.pi * wanted.blocks)
    assert wanted.loss == pytest.approx(1.0 - np.exp(-2.0 * np.pi * zeta / np.sqrt(1.0 - zeta**2)))


def test_what_does_not_go_with_it_is_refused_by_name() -> None:
    scene = dragged(clamped(0.0), 1.0)
    given = scene.model_dump()
    with pytest.raises(ValueError, match=r"bdf2 does not know body\.damping"):
        Scene.model_validate({**given, "models": {"fem": {"integrator": "bdf2"}}, "regions": {"default": "fem"}})
    with pytest.raises(ValueError, match=r"body\.damping says the same for both models"):
        Scene.model_validate({**given, "models": {"pbd": {"damping": {"mass": 1.0}}}, "regions": {"default": "pbd"}})
    with pytest.raises(NotDifferentiable, match=r"body\.damping"):
        check_differentiable(scene, build_body(scene, {}))
    assert not any("bdf2" in one.key for one in configurations(Frame(scene, np.full(3, 0.05))))


def test_a_scene_without_it_says_nothing_of_it() -> None:
    """So that hashes of scenes, which name references, stay what they were."""
    assert "damping" not in clamped(0.0).model_dump()["body"]
    assert dragged(clamped(0.0), 1.5).model_dump()["body"]["damping"] == 1.5
