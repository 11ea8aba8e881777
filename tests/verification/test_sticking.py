"""What sticks stays where it stuck: under loads that are held, that come and go, that last; and it gives no energy."""

from __future__ import annotations

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block, tofu
from numpy.typing import NDArray

from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Ints
from softseam_services.fem.face_forces import point_positions

Floats = NDArray[np.float64]


def _middle(body: Body, cells: Ints) -> Ints:
    return np.flatnonzero(np.abs(body.x_rest[:, 0]) < 1e-9).astype(np.int32)


def _pressed(friction: float = 0.6, step: float = 0.005) -> tuple[FemRun, float]:
    """A cube between two plates, forces on its middle nodes to come; and the force that presses it [N]."""
    run = FemRun(tofu(friction=friction, gravity=0.0, step=step, poisson=0.3), seam=_middle)
    run.run(0.1, CLOSE)
    return run, float(run.run(0.2)[-1].wrench[2, 0])


def _upwards(run: FemRun, total: float) -> Floats:
    force = np.zeros((len(run.region.seam), 3))
    force[:, 2] = total / len(force)
    return force


def _at_plates(run: FemRun) -> Ints:
    """Points that one plate and nothing else holds."""
    carried = np.abs(run.solver.state.contact[:, :, :3]).sum(axis=2) > 0.0
    return np.flatnonzero(carried[:, 1:].any(axis=1) & (carried.sum(axis=1) == 1)).astype(np.int32)


def test_what_sticks_gives_way_to_no_load_that_is_held() -> None:
    """Far below the cone. A penalty alone would let every point go by what its tau changes by over r, 4.7 um here."""
    run, press = _pressed()
    points = _at_plates(run)
    model, parameters = run.model, run.parameters
    before = point_positions(model, parameters, run.x)[points]
    run.run(0.2, force=_upwards(run, 0.2 * press))
    traction = run.solver.state.contact[points, 1:, 2].sum(axis=1)
    assert len(points) >= 30
    assert np.abs(traction / parameters.point_stiffness[points]).max() > 1e-5
    assert np.abs(point_positions(model, parameters, run.x)[points] - before)[:, 2].max() < 1e-8


def test_a_load_that_comes_and_goes_carries_nothing_away() -> None:
    """42 % of what friction can bear, so that points at the rim slip in the first cycles."""
    run, press = _pressed()
    points, model, parameters = _at_plates(run), run.model, run.parameters
    middles = []
    for _ in range(50):
        for k in range(1, 17):
            run.step(force=_upwards(run, 0.5 * press * np.sin(2.0 * np.pi * k / 16.0)))
        middles.append(point_positions(model, parameters, run.x)[points, 2].mean())
    assert abs(middles[-1] - middles[9]) < 2e-7


def test_a_block_on_a_slope_does_not_creep() -> None:
    """Half a degree below atan(mu), 1000 steps."""
    slope = np.arctan(0.5) - np.radians(0.5)
    tools = {"ground": {"kind": "plane", "friction": 0.5}}
    tilted = (9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope))
    run = FemRun(block((0.06, 0.04, 0.02), 0.02, tools=tools, gravity=tilted, step=0.005))
    run.run(1.0)
    before = run.x.copy()
    run.run(5.0)
    assert np.abs(run.x - before).max() < 1e-9


@pytest.mark.parametrize("edged", [False, True], ids=["whole", "edged"])
@pytest.mark.parametrize("friction", [0.6, 5.0])
def test_tools_that_hold_the_same_nodes_do_not_work_against_each_other(friction: float, edged: bool) -> None:
    """The cube's lower edges touch the ground and a plate, or, where a plate ends on a face, points inside that hang on
    the edge's nodes do; nothing moves, so no force may grow."""
    scene = tofu(friction=friction).model_dump()
    if edged:
        for name, x in (("left", -0.0305), ("right", 0.0305)):
            scene["tools"][name] |= {"size": (0.01, 0.08, 0.04), "position": (x, 0.0, 0.02)}
    run = FemRun(Scene.model_validate(scene))
    assert bool(run.model.at_faces.any()) == edged
    run.run(0.1, CLOSE)
    before = run.run(0.3)[-1].wrench
    after = run.run(1.0)[-1].wrench
    np.testing.assert_allclose(after, before, atol=1e-3 * np.abs(before).max())


def test_a_cube_that_pads_turn_is_held_as_it_was() -> None:
    """Half a turn about the axis along which two pads close, without weight, from rest to rest: in the pads' frame
    points of the body are where they were; of what holds them a twentieth slips at the pads' edges."""
    scene = tofu(friction=2.0, gravity=0.0).model_dump()
    del scene["tools"]["ground"]
    for name, x in (("left", -0.0305), ("right", 0.0305)):
        scene["tools"][name] |= {"size": (0.01, 0.03, 0.03), "position": (x, 0.0, 0.025)}
    run = FemRun(Scene.model_validate(scene))
    assert run.model.at_faces.all()
    run.run(0.1, CLOSE)
    run.run(0.3)
    sideways = run.solver.state.contact[:, :, 1:3]
    before, held = run.x.copy(), float(np.abs(sideways).sum())
    for angle in 0.5 * np.pi * (1.0 - np.cos(np.linspace(0.0, np.pi, 201)[1:])):
        turned = np.tile([np.cos(0.5 * angle), np.sin(0.5 * angle), 0.0, 0.0], (2, 1))
        run.step(turned=turned)
    run.run(0.5)
    away = (run.x - [0.0, 0.0, 0.025]) * [1.0, -1.0, -1.0] + [0.0, 0.0, 0.025] - before
    assert np.abs(away).max() < 5e-6
    assert np.abs(run.solver.state.contact[:, :, 1:3]).sum() == pytest.approx(held, rel=0.08)


@pytest.mark.parametrize("step", [0.02, 0.005, 0.00125])
@pytest.mark.parametrize("friction", [0.3, 5.0])
def test_no_step_of_a_kicked_body_gains_energy(friction: float, step: float) -> None:
    """Sheared at up to 10 cm/s while it is held: what tools that stand still do to it is to slow it down."""
    run = FemRun(tofu(friction=friction, step=step))
    run.run(0.125, CLOSE, dt=0.005)
    rest = run.run(0.3, dt=0.005)[-1]
    run.solver.commit()
    state = run.committed
    state.v[:] = 0.0
    state.v[:, 1] = 2.0 * state.x[:, 2]
    kick = 0.5 * float(run.parameters.mass @ (state.v**2).sum(axis=1))
    energy = np.array([reply.kinetic + reply.strain + reply.gravity for reply in [rest, *run.run(60 * step)]])
    energy[0] += kick
    assert np.diff(energy).max() < 1e-6 * kick
    assert energy[0] - energy[-1] > 0.5 * kick
