"""Augmented-Lagrangian contact at surface points: forces, friction, tangents."""

from __future__ import annotations

import numpy as np
import pytest
import solids
from fem_run import FemRun, block
from numpy.typing import NDArray
from test_fem_fronts import dense_of

from softseam_protocol.messages.participant import ToolMotion
from softseam_services.body.build import build_body
from softseam_services.fem.face_forces import point_positions
from softseam_services.fem.inputs import Tools, at_rest, moved
from softseam_services.fem.kernels.candidates import find_candidates
from softseam_services.fem.kernels.contact import (
    add_contact_forces,
    any_held,
    evaluate_contacts,
    hold_what_stuck,
    lets_go,
    next_anchor,
)
from softseam_services.fem.kernels.contact_columns import ANCHOR, HELD, N_STATE, OPEN, SLIP, STICK
from softseam_services.fem.kernels.contact_tangents import add_contact_tangents
from softseam_services.fem.model import FemModel
from softseam_services.fem.parameters import FemParameters
from softseam_services.fem.tree import Tree
from softseam_services.fem.work import Work
from softseam_services.shapes.branches import PLANE
from softseam_services.tools.kernels import tool_gap

pytestmark = pytest.mark.kernels


def squeezed_problem(
    friction: float,
    multiplier: tuple[float, float, float] = (0.0, 0.0, 0.0),
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    pace: float = 1.0,
    embedded: bool = False,
) -> tuple[FemModel, FemParameters, Tree, Work, Tools, NDArray[np.float64], int]:
    """A cube whose lower face is 10 um below the ground; every point there carries the multiplier.

    embedded: it is read as a mesh, so that many points share a cell
    """
    shape = {"shape": {"kind": "mesh", "path": "cube.obj"}} if embedded else {}
    scene = block(tools={"ground": {"kind": "plane", "friction": friction}}, body=shape)
    cube = solids.obj(*solids.box((0.05, 0.05, 0.05), (-0.025, -0.025, 0.0)))
    run = FemRun(scene, body=build_body(scene, {"cube.obj": cube}))
    model, parameters = run.model, run.parameters
    tree, work = model.tree, run.work
    tools = moved(at_rest(run.tools), ToolMotion(run.position, run.orientation, run.position, run.orientation))
    x = parameters.x_rest - np.array([0.0, 0.0, 1e-5])
    contact = np.zeros((len(run.region.points), 1, N_STATE))
    height = point_positions(model, parameters, parameters.x_rest)[:, 2]
    touching = height < height.min() + 1e-9
    contact[touching, 0, :3] = multiplier
    contact[:, 0, ANCHOR:] = point_positions(model, parameters, x - np.array(start) - np.array(offset))
    count = find_candidates(
        x - np.array(start), np.zeros_like(x), 0.0, model, parameters, tools, contact, 1e-3, 1.0, pace, work
    )
    return model, parameters, tree, work, tools, x, count


def forces_at(
    x: NDArray[np.float64], model: FemModel, parameters: FemParameters, tools: Tools, count: int, work: Work
) -> NDArray[np.float64]:
    evaluate_contacts(x, model, parameters, tools, count, work)
    r = np.zeros_like(work.r)
    add_contact_forces(model, parameters, count, work, r)
    return r


def test_pressure_follows_the_penalty() -> None:
    """Without a multiplier p = r depth at each point; the sum is r/A of the face times area times depth."""
    model, parameters, _, work, tools, x, count = squeezed_problem(0.0)
    assert count == 25
    total = forces_at(x, model, parameters, tools, count, work).reshape(-1, 3).sum(axis=0)
    np.testing.assert_allclose(total[:2], 0.0, atol=1e-15)
    below = parameters.point_stiffness[work.pair[:count, 0]].sum()
    np.testing.assert_allclose(total[2], below * 1e-5, rtol=1e-12)


@pytest.mark.parametrize(("way", "state"), [((1e-6, 2e-6, 0.0), STICK), ((1e-4, -2e-4, 0.0), SLIP)])
def test_friction_sticks_inside_the_cone_and_slips_on_it(way: tuple[float, float, float], state: int) -> None:
    model, parameters, _, work, tools, x, count = squeezed_problem(0.5, start=way)
    evaluate_contacts(x, model, parameters, tools, count, work)
    assert (work.state[:count] == state).all()
    for row, pair in zip(work.contact[:count], work.pair[:count], strict=True):
        pressure, traction = row[1], row[5:8]
        if state == STICK:
            np.testing.assert_allclose(traction, -parameters.point_stiffness[pair[0]] * np.array(way), rtol=1e-9)
        else:
            np.testing.assert_allclose(np.linalg.norm(traction), 0.5 * pressure, rtol=1e-12)
            assert traction @ np.array(way) < 0.0


def _next_offset(
    model: FemModel, parameters: FemParameters, x: NDArray[np.float64], count: int, work: Work
) -> NDArray[np.float64]:
    """Of every candidate from its next anchor (count, 3) [m]; x (n, 3) is the step's end."""
    at = point_positions(model, parameters, x)[work.pair[:count, 0]]
    anchor = np.empty((count, 3))
    for c in range(count):
        next_anchor(c, at[c], work, anchor[c])
    return at - anchor


WAY, OFFSET = np.array([1e-6, 2e-6, 0.0]), np.array([-3e-6, 1e-6, 5e-6])
ACROSS = np.array([1.0, 1.0, 0.0])


@pytest.mark.parametrize("pace", [1.0, 0.25])
@pytest.mark.parametrize("carry", [1.0, 0.0])
def test_what_sticks_is_drawn_to_its_anchor(carry: float, pace: float) -> None:
    """t = lambda_t - r (pace d + D), d_next = c D + (1 - pace (1 - c)) d; the part of d along the normal is dropped."""
    multiplier = (0.01, 0.0, 0.5)
    model, parameters, _, work, tools, x, count = squeezed_problem(
        50.0, multiplier, start=(WAY[0], WAY[1], WAY[2]), offset=(OFFSET[0], OFFSET[1], OFFSET[2]), pace=pace
    )
    work.hold[:count, 1] = carry
    evaluate_contacts(x, model, parameters, tools, count, work)
    assert (work.state[:count] == STICK).all()
    drawn = pace * OFFSET * ACROSS + WAY
    expected = np.array(multiplier) * ACROSS - parameters.point_stiffness[work.pair[:count, 0], None] * drawn
    np.testing.assert_allclose(work.contact[:count, 5:8], expected, rtol=1e-7, atol=1e-12)
    left = carry * WAY + (1.0 - pace * (1.0 - carry)) * OFFSET * ACROSS
    np.testing.assert_allclose(_next_offset(model, parameters, x, count, work), np.tile(left, (count, 1)), atol=1e-15)


def test_where_it_slips_there_it_sticks_next() -> None:
    model, parameters, _, work, tools, x, count = squeezed_problem(
        0.01, (0.0, 0.0, 0.1), start=(1e-4, 0.0, 0.0), offset=(1e-5, 0.0, 0.0)
    )
    evaluate_contacts(x, model, parameters, tools, count, work)
    assert (work.state[:count] == SLIP).all()
    assert not _next_offset(model, parameters, x, count, work).any()


def test_an_anchor_turns_with_its_tool() -> None:
    """A point that goes with a tool that turns by 90 degrees keeps its offset in the tool's frame."""
    model, parameters, _, work, tools, x, _ = squeezed_problem(0.5)
    half = np.sqrt(0.5)
    tools = tools._replace(orientation_next=np.array([[half, 0.0, 0.0, half]]))
    contact = np.zeros((len(model.point_face), 1, N_STATE))
    contact[:, 0, 2] = 10.0
    contact[:, 0, ANCHOR:] = point_positions(model, parameters, x) - OFFSET
    count = find_candidates(x, np.zeros_like(x), 0.0, model, parameters, tools, contact, 1e-3, 1.0, 1.0, work)
    turned = x @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).T
    evaluate_contacts(turned, model, parameters, tools, count, work)
    stuck = work.state[:count] == STICK
    assert stuck.sum() == 25
    expected = np.array([-OFFSET[1], OFFSET[0], 0.0])
    np.testing.assert_allclose(
        _next_offset(model, parameters, turned, count, work)[stuck], np.tile(expected, (25, 1)), atol=1e-15
    )


def test_a_pulling_multiplier_is_dropped() -> None:
    model, parameters, _, work, tools, x, count = squeezed_problem(0.5, multiplier=(0.0, 0.0, -1.0))
    evaluate_contacts(x + np.array([0.0, 0.0, 2e-5]), model, parameters, tools, count, work)
    assert (work.state[:count] == OPEN).all()


@pytest.mark.parametrize("embedded", [False, True])
@pytest.mark.parametrize("case", ["frictionless", "stick", "slip"])
def test_tangent_is_the_gradient_of_the_force(case: str, embedded: bool) -> None:
    """Central differences; in slip along directions that leave the pressure alone, whose effect is dropped."""
    friction = {"frictionless": 0.0, "stick": 5.0, "slip": 0.01}[case]
    model, parameters, tree, work, tools, x, count = squeezed_problem(
        friction, multiplier=(0.0, 0.0, 1e-3), start=(3e-5, 1e-5, 0.0), embedded=embedded
    )
    assert count > (100 if embedded else 8)
    forces_at(x, model, parameters, tools, count, work)
    work.contact[:count, 12] = 1.0 if case == "slip" else 0.0
    work.values[:] = 0.0
    add_contact_tangents(model, parameters, tree, count, -np.inf, work)
    dense = dense_of(model, tree, work)
    way = np.random.default_rng(0).standard_normal(x.shape)
    if case == "slip":
        way[:, 2] = 0.0
    e = 1e-9
    difference = forces_at(x - e * way, model, parameters, tools, count, work) - forces_at(
        x + e * way, model, parameters, tools, count, work
    )
    ordered = np.zeros_like(work.r)
    ordered.reshape(-1, 3)[model.order] = way
    product = dense @ ordered
    np.testing.assert_allclose(product, difference / (2.0 * e), atol=1e-5 * np.abs(product).max())


def test_tools_that_carry_a_point_along_do_not_rub() -> None:
    """A point that moves with its tool, turn included, has no slip."""
    model, parameters, _, work, tools, x, _ = squeezed_problem(0.5)
    half = 0.05
    turned = np.array([[np.cos(half / 2), 0.0, 0.0, np.sin(half / 2)]])
    tools = tools._replace(orientation_next=turned, position_next=tools.position + np.array([[0.01, 0.0, 0.0]]))
    turn = np.array([[np.cos(half), -np.sin(half), 0.0], [np.sin(half), np.cos(half), 0.0], [0.0, 0.0, 1.0]])
    none = np.zeros((len(model.point_face), 1, N_STATE))
    count = find_candidates(x, np.zeros_like(x), 0.0, model, parameters, tools, none, 1e-3, 1.0, 1.0, work)
    evaluate_contacts(x @ turn.T + np.array([0.01, 0.0, 0.0]), model, parameters, tools, count, work)
    assert (work.state[:count] == STICK).all()
    assert np.abs(work.contact[:count, 9:12]).max() < 1e-16


@pytest.mark.parametrize(("multiplier", "states"), [((0.1, 0.0, 1.0), (HELD, SLIP)), ((0.5, 0.0, 1.0), (SLIP, SLIP))])
def test_what_stuck_is_held_once_however_far_its_tool_has_gone(
    multiplier: tuple[float, float, float], states: tuple[int, int]
) -> None:
    """A multiplier inside the cone stuck in the last step, one on the cone slipped."""
    way = np.array([1e-3, -2e-3, 0.0])
    model, parameters, _, work, tools, x, count = squeezed_problem(0.5, multiplier, start=(way[0], way[1], way[2]))
    hold_what_stuck(count, work)
    for state in states:
        evaluate_contacts(x, model, parameters, tools, count, work)
        assert (work.state[:count] == state).all()
        assert any_held(count, work) == (state == HELD)
        for row, pair in zip(work.contact[:count], work.pair[:count], strict=True):
            if state == HELD:
                stuck = np.array(multiplier) * [1.0, 1.0, 0.0] - parameters.point_stiffness[pair[0]] * way
                np.testing.assert_allclose(row[5:8], stuck, rtol=1e-9)
            else:
                np.testing.assert_allclose(np.linalg.norm(row[5:8]), 0.5 * row[1], rtol=1e-12)


@pytest.mark.parametrize(("along", "friction", "state"), [(0.1, 0.5, HELD), (0.5, 0.5, OPEN), (0.0, 0.0, OPEN)])
def test_what_stuck_is_held_once_by_a_tool_that_leaves(along: float, friction: float, state: int) -> None:
    """It pulls by the penalty times the gap; what slipped in the last step, or has no friction, it leaves."""
    model, parameters, _, work, tools, x, count = squeezed_problem(friction, (along, 0.0, 1.0), start=(1e-6, 0.0, 0.0))
    away = tools._replace(position_next=tools.position_next - np.array([[0.0, 0.0, 1.0]]))
    hold_what_stuck(count, work)
    evaluate_contacts(x, model, parameters, away, count, work)
    assert (work.state[:count] == state).all()
    assert any_held(count, work) == (state == HELD)
    for row, pair in zip(work.contact[:count], work.pair[:count], strict=True):
        stiffness = parameters.point_stiffness[pair[0]]
        pull, held = (work.hold[0, 1] - stiffness * row[0], along - stiffness * 1e-6) if state == HELD else (0.0, 0.0)
        np.testing.assert_allclose(row[1], pull, rtol=1e-9)
        np.testing.assert_allclose(row[5:8], [held, 0.0, 0.0], atol=1e-9)
    evaluate_contacts(x, model, parameters, away, count, work)
    assert (work.state[:count] == OPEN).all()


def test_without_friction_nothing_stuck_however_the_tool_is_tilted() -> None:
    """What is left of a normal force without its part along the normal is rounding, of either sign."""
    model, parameters, _, work, tools, x, count = squeezed_problem(0.0)
    turns = np.random.default_rng(0).standard_normal((40, 1, 4))
    for turn in turns / np.linalg.norm(turns, axis=2, keepdims=True):
        tilted = tools._replace(followed=np.array([True]), orientation=turn, orientation_next=turn)
        evaluate_contacts(x, model, parameters, tilted, count, work)
        normal = np.array(tool_gap(PLANE, tools.shape[0], tools.position[0], turn[0], x[0])[1:])
        work.multiplier[:count] = normal
        work.begun[:count, :] += 1e-4 * np.cross(normal, [0.6, 0.0, 0.8])
        hold_what_stuck(count, work)
        evaluate_contacts(x - 0.1 * normal, model, parameters, tilted, count, work)
        assert (work.state[:count] == SLIP).all()
        assert not lets_go(parameters, tilted, count, work)


@pytest.mark.parametrize(
    ("multiplier", "along", "up", "lost"),
    [
        ((0.1, 0.0, 1.0), 1e-3, 0.0, True),  # stuck, and would slip
        ((0.5, 0.0, 1.0), 1e-3, 0.0, False),  # slipped, and goes on
        ((0.1, 0.0, 1.0), 0.0, 0.0, False),  # stuck, and does
        ((0.1, 0.0, 1.0), 0.0, 5e-4, True),  # touched, and would not
        ((0.0, 0.0, 0.0), 1e-3, 0.0, False),  # nothing to lose
    ],
)
def test_a_guess_that_loses_its_contacts_is_known(
    multiplier: tuple[float, float, float], along: float, up: float, lost: bool
) -> None:
    model, parameters, _, work, tools, x, count = squeezed_problem(0.5, multiplier, start=(along, 0.0, 0.0))
    evaluate_contacts(x + np.array([0.0, 0.0, up]), model, parameters, tools, count, work)
    assert lets_go(parameters, tools._replace(followed=np.array([True])), count, work) == lost
    assert not lets_go(parameters, tools._replace(followed=np.array([False])), count, work)
