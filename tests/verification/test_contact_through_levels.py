"""A body that touches is handed to cells of one block: its contact forces go to the points that still meet tools."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from pbd_run import PbdRun, block_scene

from softseam_protocol.messages.participant import BodyState, Bundle, Correct
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Floats
from softseam_services.body.region import shared_nodes
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.kernels.summary import BOUNDS
from softseam_services.pbd.points import hand_on
from softseam_services.pbd.step import share_out

G = 9.81
ALL = {"coarse": {"beyond": 0.0}, "damping": {"mass": 60.0}}
GROUND: dict[str, Any] = {"kind": "plane", "friction": 0.5}


def standing(pbd: dict[str, Any], state: BodyState | None = None, **other: Any) -> PbdRun:
    """4 x 2 x 2 cm of 2 cells on the ground."""
    tools = {"ground": GROUND, **other}
    scene = block_scene((0.04, 0.02, 0.02), 0.02, gravity=(0.0, 0.0, -G), step=2e-3, tools=tools, pbd=pbd)
    return PbdRun(scene, state=state)


def at_rest() -> PbdRun:
    fine = standing({"damping": {"mass": 60.0}})
    fine.run(0.18)
    return fine


def test_at_rest_the_ground_carries_it_and_lifted_off_nothing_does() -> None:
    """In all steps the momentum changes by gravity and by what the ground feels; no point keeps a force for itself."""
    fine = at_rest()
    handed, weight = fine.handed(), fine.body.total_mass * G
    assert handed.contact_force.sum(axis=0)[2] == pytest.approx(weight, rel=0.02)
    run = standing({"coarse": {"beyond": 0.0}}, handed)
    model, dt = run.solver.model, run.scene.step
    assert 0 < model.touches.sum() < len(model.touches)
    np.testing.assert_allclose(run.committed.force.sum(axis=(0, 1)), handed.contact_force.sum(axis=0), atol=1e-15)
    replies = run.run(0.1)
    forces = -np.array([reply.wrench[0, :3] for reply in replies])
    assert forces[:, 2].mean() == pytest.approx(weight, rel=0.05)
    for before, after, force in zip(replies, replies[1:], forces[1:], strict=False):
        push = force - np.array([0.0, 0.0, weight])
        np.testing.assert_allclose(after.momentum - before.momentum, dt * push, atol=1e-9 * weight * dt)
    run.velocity[0, 2] = -1.0
    run.run(0.02)
    falling = run.run(0.02)
    assert not run.committed.force.any()
    for before, after in itertools.pairwise(falling):
        np.testing.assert_allclose(after.momentum - before.momentum, [0, 0, -weight * dt], atol=1e-9 * weight * dt)


@pytest.mark.parametrize("near", ["none", "one end"])
def test_a_switch_from_fem_on_a_table(near: str) -> None:
    """FEM at rest; then all of it, or all but one end, is of coarse blocks: momentum by gravity and the table alone."""
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "rest",
            "gravity": [0.0, 0.0, -G],
            "step": 0.005,
            "duration": 1.0,
            "body": {
                "shape": {"kind": "block", "size": [0.06, 0.04, 0.04]},
                "cell": 0.02,
                "material": {"young": 20e3, "poisson": 0.4, "density": 1000.0},
            },
            "tools": {"table": {"kind": "plane", "friction": 0.5}},
            "regions": {
                "default": "pbd",
                "near": {"model": "fem", "boxes": [{"min": [-1, -1, -1], "max": [1, 1, 1]}]},
            },
            "models": {"pbd": {"coarse": {"beyond": 0.0}}, "fem": {"tolerance": 1e-8}},
            "seam": {"tolerance": 1e-9, "exchanges": 12},
        }
    )
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    for _ in range(60):
        before = simulation.step()
    weight, dt = simulation.body.total_mass * G, scene.step
    assert -before.wrench[0, 2] == pytest.approx(weight, rel=0.02)
    grid = simulation.body.cell_grid  # type: ignore[union-attr]
    simulation.set_near(grid[:, 0] == 0 if near == "one end" else np.zeros(len(grid), dtype=bool))
    assert simulation.regions.parts.models["body.far"] == "pbd"
    felt = []
    for _ in range(20):
        after = simulation.step()
        push = -after.wrench[0, :3] - np.array([0.0, 0.0, weight])
        np.testing.assert_allclose(after.momentum - before.momentum, dt * push, atol=1e-3 * weight * dt)
        felt.append(-after.wrench[0, 2])
        before = after
    assert np.mean(felt) == pytest.approx(weight, rel=0.05)
    simulation.close()


@pytest.mark.parametrize("method", ["xpbd", "leapfrog"])
def test_bounds_are_of_nodes_where_they_are(method: str) -> None:
    """Thrown by 2 cm a step: those that hang are not left where the step before had them."""
    scene = block_scene((0.04, 0.02, 0.02), 0.02, step=0.01, pbd={"coarse": ALL["coarse"], "method": method})
    run = PbdRun(scene, v=np.full((len(PbdRun(scene).body.x_rest), 3), 2.0))
    for _ in range(2):
        np.testing.assert_array_equal(run.step().bounds, [run.x.min(axis=0), run.x.max(axis=0)])


def test_bounds_of_a_step_that_is_corrected() -> None:
    """The seam's middle is pushed inwards by 5 mm and more: so are the nodes that hang there."""
    scene = block_scene((0.06, 0.04, 0.04), 0.02, step=0.01, pbd={"coarse": ALL["coarse"]})
    whole = PbdRun(scene).body
    near, far = (
        np.flatnonzero(here).astype(np.int32) for here in (whole.cell_grid[:, 0] == 0, whole.cell_grid[:, 0] > 0)
    )
    run = PbdRun(scene, cells=far, seam=shared_nodes(whole, near, far))
    run.solver.advance(run.request(compliance=True))
    push = np.tile([0.3, 0.0, 0.0], (len(run.region.seam), 1))
    run.solver.correct(Correct(run.request(exchange=1).header, push, push))
    bounds = run.figures[BOUNDS : BOUNDS + 6].reshape(2, 3)
    run.solver.commit()
    x = run.solver.positions
    assert x[run.region.seam, 0].min() > whole.x_rest[run.region.nodes, 0].min() + 5e-3
    np.testing.assert_array_equal(bounds, [x.min(axis=0), x.max(axis=0)])


def test_forces_move_tool_by_tool_with_their_sum_and_torque() -> None:
    """Of random forces; where a node has no point the others take its share; where none has, the force is dropped."""
    solver = standing(ALL, wall={"kind": "plane", "point": [-0.02, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}).solver
    model, parameters = solver.model, solver.parameters
    rows = model.indptr, model.node, parameters.arrays.weight
    given = np.random.default_rng(0).standard_normal((model.n_points, 2, 3))
    rest = parameters.arrays.x_rest[model.node] * parameters.arrays.weight[:, None]
    x = np.add.reduceat(rest, model.indptr[:-1], axis=0)

    def sums(force: Floats) -> Floats:
        return np.concatenate([force.sum(axis=0), np.cross(x[:, None], force).sum(axis=0)], axis=1)

    force = given.copy()
    hand_on(force, model.touches, model.n_surface, rows)
    assert not force[~model.touches].any()
    np.testing.assert_allclose(sums(force), sums(given), atol=1e-13)
    fewer = model.touches.copy()
    fewer[np.flatnonzero(fewer.any(axis=1))[0]] = False
    force = given.copy()
    force[model.touches] = 0.0
    wanted = force.sum(axis=0)
    hand_on(force, fewer, model.n_surface, rows)
    assert not force[~fewer].any()
    np.testing.assert_allclose(force.sum(axis=0), wanted, atol=1e-13)
    hand_on(force, np.zeros_like(fewer), model.n_surface, rows)
    assert not force.any()


def test_a_point_with_forces_of_two_tools_shares_out_what_it_has() -> None:
    """Pressed into a corner: an edge's force names the ground and holds the wall's; faces' middles bring their own."""
    wall = {"kind": "plane", "point": [-0.02, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}
    run = standing(ALL, wall=wall)
    x = run.fields().point_x
    below, beside = np.isclose(x[:, 2], 0.0), np.isclose(x[:, 0], -0.02)
    force = 1e-3 * (below[:, None] * np.array([0.0, 0.0, 1.0]) + beside[:, None] * np.array([1.0, 0.0, 0.0]))
    tool = np.where(below, 0, np.where(beside, 1, -1)).astype(np.int32)
    body = run.body
    run = standing(ALL, BodyState(body.x_rest.copy(), np.zeros_like(body.x_rest), force, tool), wall=wall)
    solver = run.solver
    share_out(solver.model, solver.parameters, solver.committed, run.request().tools, run.scratch)
    shared = run.committed.force.sum(axis=0)
    np.testing.assert_allclose(shared, [[0.0, 0.0, 1e-3 * below.sum()], [1e-3 * beside.sum(), 0.0, 0.0]], atol=1e-15)


def test_what_presses_inside_faces_is_told_at_nodes_and_handed_on_inside_faces() -> None:
    """With the same sum; a run goes on with the force that it had, when its share among points has settled."""
    ball: dict[str, Any] = {"kind": "sphere", "radius": 0.006, "position": [0.003, 0.002, 0.0255], "friction": 0.5}
    run = standing({"damping": {"mass": 60.0}}, ball=ball)
    run.run(0.1)
    model, handed = run.solver.model, run.handed()
    force = run.committed.force_mean
    assert model.n_surface < model.n_points
    assert not force[: model.n_surface, 1].any() and force[:, 1, 2].sum() < -0.01
    np.testing.assert_allclose(handed.contact_force.sum(axis=0), force.sum(axis=(0, 1)), atol=1e-14)
    assert (handed.contact_tool == 1).sum() >= 4
    again = standing({"damping": {"mass": 60.0}}, handed, ball=ball)
    begun = again.committed.force
    assert not begun[: model.n_surface, 1].any()
    np.testing.assert_allclose(begun.sum(axis=(0, 1)), handed.contact_force.sum(axis=0), atol=1e-14)
    assert again.run(0.05)[-1].wrench[1, 2] == pytest.approx(-force[:, 1, 2].sum(), rel=0.05)
