"""Contact and friction of the FEM: scene B of the docs, an incline, a grip that holds or slips."""

from __future__ import annotations

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block, tofu

from softseam_protocol.messages.participant import Advanced
from softseam_protocol.scene.models import ModelsSpec
from softseam_protocol.scene.scene import Scene

UP = {"left": (0.0, 0.0, 0.05), "right": (0.0, 0.0, 0.05)}


def _squeezed(scene: Scene) -> tuple[FemRun, list[Advanced], list[Advanced]]:
    """Settled on the ground with the plates clear, then closed to 15 %; the replies while closing and holding."""
    run = FemRun(scene)
    run.run(0.3)
    run.run(0.025, CLOSE)
    replies = run.run(0.1875, CLOSE)
    return run, replies, run.run(0.3)


@pytest.mark.slow
@pytest.mark.parametrize(("cell", "limit"), [(0.025, 0.03), ((0.05 / 3, 0.025, 0.025), 0.025)])
def test_hold_force_of_scene_b(cell: float | tuple[float, float, float], limit: float) -> None:
    """13.1 +- 0.1 N a plate with gravity and friction 0.6 (three independent codes); here also 5 % and 10 %."""
    _, closing, holding = _squeezed(tofu(cell=cell))
    times = 0.005 * np.arange(1, len(closing) + 1)
    forces = np.interp([0.0625, 0.125], times, [-r.wrench[1, 0] for r in closing])
    np.testing.assert_allclose(forces, [4.51, 8.65], rtol=0.03)
    assert abs(-holding[-1].wrench[1, 0] / 13.1 - 1.0) < limit
    assert abs(holding[-1].wrench[1, 0] + holding[-1].wrench[2, 0]) < 1e-3
    assert max(r.extras["penetration"] for r in closing) < 1e-4
    assert holding[-1].extras["penetration"] < 2e-5
    assert holding[-1].extras["slip"] < 2e-4


@pytest.mark.slow
def test_a_rough_grip_lifts_and_holds() -> None:
    """Lifted by 50 mm: the cube follows, weighs what it weighs, and does not creep in the hold."""
    run, _, _ = _squeezed(tofu())
    before = run.x[:, 2].mean()
    run.run(1.0, UP)
    held = run.run(0.3)
    assert abs(run.x[:, 2].mean() - before - 0.05) < 0.002
    assert held[-1].extras["slip"] < 2e-3
    assert abs(held[-1].extras["slip"] - held[len(held) // 2].extras["slip"]) < 1e-6
    weight = run.body.total_mass * 9.81
    np.testing.assert_allclose(held[-1].wrench[1:, 2].sum(), -weight, rtol=1e-3)
    assert -held[-1].wrench[1, 0] == pytest.approx(10.15, rel=0.05)
    assert held[-1].extras["n_contacts"] > 40


def test_plates_that_change_their_motion_do_not_shake_the_solver() -> None:
    """The guess that the cube flies on has its points slip or let go, and is dropped: a lift that is under way and one
    that ends, in steps of 40 ms, took 23 and 9 iterations with it."""
    run = FemRun(tofu(step=0.04))
    run.run(0.2, CLOSE)
    run.run(0.2)
    lift, stop = run.run(0.2, UP), run.run(0.2)
    assert lift[1].extras["iterations"] <= 12
    assert stop[0].extras["iterations"] <= 6
    assert stop[-1].extras["n_contacts"] == 50


def test_points_that_creep_do_not_wear_out_the_solver() -> None:
    """On thin cells many points open and close by turns, and slip: this took 335 iterations, 156 of them in one step,
    and 193 factors, when each that came to touch asked for one and what slips was known by symmetric tangents only."""
    shape = {"kind": "block", "size": (0.05, 0.05, 0.05), "grading": 8.0}
    run = FemRun(tofu(cell=0.0125, step=0.02, body={"shape": shape}))
    steps = run.run(0.2, CLOSE)
    assert max(step.extras["iterations"] for step in steps) <= 50
    assert sum(step.extras["iterations"] for step in steps) <= 200
    assert run.solver.factorisations <= 60


def test_points_that_slip_in_a_lift_do_not_wear_out_the_solver() -> None:
    """Steps that solve for what changed at contacts are halved where they lead astray: when the first that did was the
    last that was tried, the lift took 271 iterations, 170 of them in one step, and 212 factors."""
    shape = {"kind": "block", "size": (0.05, 0.05, 0.05), "grading": 8.0}
    run = FemRun(tofu(cell=0.0125, step=0.02, friction=0.35, body={"shape": shape}))
    run.run(0.2, CLOSE)
    before = run.solver.factorisations
    steps = run.run(0.3, UP)
    assert max(step.extras["iterations"] for step in steps) <= 60
    assert sum(step.extras["iterations"] for step in steps) <= 200
    assert run.solver.factorisations - before <= 80


def test_a_solution_that_loses_its_contacts_is_kept() -> None:
    """Plates let go at once, and most points with them: the step's second exchange begins with what the first found."""
    run = FemRun(tofu(step=0.02))
    run.run(0.2, CLOSE)
    away = {"left": (-0.2, 0.0, 0.0), "right": (0.2, 0.0, 0.0)}
    first = run.solver.advance(run.request(away))
    again = run.solver.advance(run.request(away, exchange=1))
    assert first.extras["n_contacts"] < 35 and first.extras["iterations"] > 3
    assert again.extras["iterations"] <= 3
    np.testing.assert_allclose(again.wrench, first.wrench, atol=1e-4)


@pytest.mark.slow
def test_a_slippery_grip_drops() -> None:
    run, _, _ = _squeezed(tofu(friction=0.02))
    replies = run.run(0.6, UP)
    assert run.x[:, 2].min() < 0.002
    assert replies[-1].extras["slip"] > 0.02


@pytest.mark.parametrize(("friction", "slides"), [(0.45, False), (0.30, True)])
def test_block_on_an_incline(friction: float, slides: bool) -> None:
    """tan = 0.4: sticks above, below it slides with g (sin - mu cos), to the integrator's first order.

    Gravity is tilted instead of the plane. The block is stiff and flat, so that it neither sways nor tips.
    """
    angle = np.arctan(0.4)
    gravity = (9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle))
    plane = {"ground": {"kind": "plane", "friction": friction}}
    scene = block((0.08, 0.04, 0.02), 0.04, 1e6, 0.3, 1000.0, gravity=gravity, tools=plane, step=0.005)
    run = FemRun(scene)
    run.run(0.1)
    start, speed = run.x[:, 0].mean(), run.solver.state.v[:, 0].mean()
    replies = run.run(0.2)
    moved = run.x[:, 0].mean() - start
    if slides:
        acceleration = 9.81 * (np.sin(angle) - friction * np.cos(angle))
        np.testing.assert_allclose(moved, speed * 0.2 + 0.5 * acceleration * 0.2**2, rtol=0.04)
        np.testing.assert_allclose(replies[-1].wrench[0, 0], friction * -replies[-1].wrench[0, 2], rtol=1e-3)
    else:
        assert abs(moved) < 1e-6
        np.testing.assert_allclose(replies[-1].wrench[0, 0], 1000 * 6.4e-5 * gravity[0], rtol=1e-2)


def test_drop_on_the_ground_pays_its_energy() -> None:
    """Tools do no work on a body that falls on a smooth plane at rest, and energy never grows."""
    plane = {"ground": {"kind": "plane", "friction": 0.0}}
    run = FemRun(block(cell=0.025, tools=plane, body={"position": (0.0, 0.0, 0.01)}, step=0.002))
    energy = [np.inf]
    for reply in run.run(0.4):
        energy.append(reply.kinetic + reply.strain + reply.gravity)
        assert energy[-1] <= energy[-2] + reply.tool_work + 1e-9
    assert reply.wrench[0, 2] == pytest.approx(-1050 * 0.05**3 * 9.81, rel=0.02)


def test_a_body_that_bounces_off_is_free() -> None:
    """Momentum changes by the impulse of weight and contact, in steps far shorter than a wave takes through a cell.

    A factor that kept the stiffness of contacts that had let go held the cube back by half its weight for 4 ms.
    """
    plane = {"ground": {"kind": "plane", "friction": 0.6}}
    scene = block(cell=0.0125, tools=plane, body={"position": (0.0, 0.0, 0.002)}, step=1.5e-4)
    run = FemRun(scene.model_copy(update={"models": ModelsSpec()}))
    weight, before, bounced = 1050 * 0.05**3 * 9.81, 0.0, False
    for reply in run.run(0.06):
        gained = (reply.momentum[2] - before) / scene.step
        assert gained == pytest.approx(-weight - reply.wrench[0, 2], abs=1e-3 * weight)
        before = reply.momentum[2]
        bounced = bounced or (before > 0.0 and reply.extras["n_contacts"] == 0)
    assert bounced


def test_a_ball_that_presses_is_felt_where_it_is() -> None:
    """A sphere into the top of a clamped block: the wrench's force is along its way, its torque about itself nil."""
    ball = {"ball": {"kind": "sphere", "radius": 0.02, "position": (0.0, 0.0, 0.071), "friction": 0.0}}
    clamp = {"min": (-1.0, -1.0, -1e-6), "max": (1.0, 1.0, 1e-6)}
    run = FemRun(block(cell=0.0125, tools=ball, gravity=(0.0, 0.0, 0.0), body={"fixed": [clamp]}, step=0.002))
    replies = run.run(0.1, {"ball": (0.0, 0.0, -0.03)})
    force, torque = replies[-1].wrench[0, :3], replies[-1].wrench[0, 3:]
    assert force[2] > 0.1
    assert np.abs(force[:2]).max() < 1e-6 * force[2]
    assert np.abs(torque).max() < 1e-6 * force[2]
    assert replies[-1].extras["penetration"] < 2e-4
    # forces of the steps' ends do the work, so it exceeds the energy by the order of the step
    assert sum(r.tool_work for r in replies) == pytest.approx(replies[-1].strain, rel=0.1)


@pytest.mark.parametrize("step", [0.02, 0.05, 0.08])
def test_plates_that_reach_just_below_the_cube_keep_it_in_long_steps(step: float) -> None:
    """Lifted by as much a step as their edge is below the cube's, or more: its lowest points pass the edge on the way
    to the step's end, where the plate's lower side is the nearer one, and were pressed inward under the plate.
    Where the plates come by as much a step they pinched these points against the ground, with six times the force."""
    plate = {"kind": "box", "size": (0.01, 0.06, 0.06), "friction": 0.6}
    tools = {
        "ground": {"kind": "plane", "friction": 0.6},
        "left": {**plate, "position": (-0.0301, 0.0, 0.029)},
        "right": {**plate, "position": (0.0301, 0.0, 0.029)},
    }
    run = FemRun(block(tools=tools, step=step))
    run.run(0.3)
    run.run(0.19, CLOSE)
    held = run.run(0.2)[-1].wrench[2, 0]
    for reply in (run.run(0.2, UP)[-1], run.run(0.2)[-1]):
        # 0.781 with steps of 10 ms and shorter, 0.794 with 50 ms
        assert reply.wrench[2, 0] == pytest.approx(0.785 * held, rel=0.02)
        assert reply.extras["slip"] < 0.2e-3
