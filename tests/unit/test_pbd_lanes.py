"""Lanes: what runs four and eight side by side means what it means one by one, NaN included."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numba import njit
from pbd_run import PbdRun, block_scene

from softseam_services.body.materials import neo_hookean
from softseam_services.pbd.kernels.lanes import LANES, LINE, aligned, transpose_four
from softseam_services.pbd.kernels.neo_hookean import logarithm, volumetric
from softseam_services.pbd.kernels.pairs import DIRECT, EIGHT, POINT, find_pairs
from softseam_services.pbd.records import new_contacts, new_inputs, new_state

pytestmark = pytest.mark.kernels

MU, LAM = 7e3, 62e3
GROUND = {"kind": "plane", "friction": 0.6}


def test_logarithm_is_good_to_two_units_in_the_last_place() -> None:
    rng = np.random.default_rng(0)
    x = np.concatenate([np.exp(rng.uniform(-700.0, 700.0, 5000)), 1.0 + rng.uniform(-1e-3, 1e-3, 5000), [0.2, 1.0]])
    found = np.array([logarithm(value) for value in x])
    assert np.abs(found - np.log(x)).max() <= 1.2e-13  # half a unit of 700
    near = np.abs(x - 1.0) < 0.5
    units = np.abs(found - np.log(x))[near] / np.spacing(np.abs(np.log(x[near])) + 1e-300)
    assert units.max() <= 2.0


@pytest.mark.parametrize("J", [-3.0, -0.1, 0.0, 0.05, 0.2, 0.2000001, 0.7, 1.0, 1.3, 40.0])
def test_volumetric_without_branches_is_the_material_s(J: float) -> None:
    expected = neo_hookean.volumetric(J, MU, LAM)
    np.testing.assert_allclose(volumetric(J, MU, LAM), expected, rtol=1e-13, atol=1e-13 * LAM)


def test_nan_is_not_swallowed() -> None:
    assert np.isnan(volumetric(np.nan, MU, LAM)[:2]).all()
    run = PbdRun(block_scene())
    run.run(0.01)
    run.committed.v[3, 1] = np.nan
    assert "diverged" in run.solver.advance(run.request()).why


@njit(error_model="numpy")
def _transpose(to: np.ndarray, source: np.ndarray) -> None:
    transpose_four(to, 0, 10, 20, 30, source, 4, 12, 20, 33)


def test_transpose() -> None:
    source, to = np.arange(40.0), np.zeros(40)
    _transpose(to, source)
    rows = np.array([source[s : s + LANES] for s in (4, 12, 20, 33)]).T
    np.testing.assert_array_equal(to.reshape(4, 10)[:, :LANES], rows)
    assert aligned(3, 5).shape == (3, 5) and aligned(3, 5).ctypes.data % (8 * LINE) == 0


@pytest.mark.parametrize("embedded", [False, True])
def test_groups_hold_each_pair_once_and_share_no_node(embedded: bool) -> None:
    """Ground and a plate against a block whose points are nodes, and against one whose points follow eight nodes."""
    plate = {"kind": "box", "size": (0.01, 0.06, 0.06), "position": (0.0305, 0.0, 0.025), "friction": 0.6}
    solver = PbdRun(block_scene(cell=0.0125, tools={"ground": GROUND, "plate": plate})).solver
    model, tools, p, t = solver.model, solver.parameters.tools, solver.model.n_points, solver.model.n_tools
    point_x = solver.parameters.arrays.x_rest[model.node]
    arrays = model.arrays
    numbers = solver.parameters.arrays._replace(point_softness=np.ones(p))
    if embedded:
        rng = np.random.default_rng(1)
        indptr = 8 * np.arange(p + 1, dtype=np.int32)
        node = np.concatenate([rng.choice(40, 8, replace=False) for _ in range(p)]).astype(np.int32)
        arrays, numbers = arrays._replace(indptr=indptr, node=node), numbers._replace(weight=np.full(8 * p, 0.125))
    indptr, node = arrays.indptr, arrays.node
    contacts, inputs = new_contacts(arrays, model.n_nodes, t), new_inputs(t, 0)
    state = new_state(model.n_nodes, model.blocks.n_batches, p, t)
    contacts.point_x[:], inputs.position[:], inputs.orientation[:] = point_x, tools.position, tools.orientation
    find_pairs(arrays, numbers, state, inputs, contacts, 0.002, 1e-6)
    start, rows = contacts.start, contacts.rows
    for tool, axis, place in ((0, 2, 0.0), (1, 0, 0.025)):
        groups = rows[start[tool] : start[tool + 1], POINT : POINT + EIGHT]
        found = np.sort(groups[groups >= 0])
        np.testing.assert_array_equal(found, np.flatnonzero(np.abs(point_x[:, axis] - place) < 1e-9))
        for group in groups:
            nodes = np.concatenate([node[indptr[q] : indptr[q + 1]] for q in group[group >= 0]])
            assert len(np.unique(nodes)) == len(nodes)
        assert (rows[start[tool] : start[tool + 1], DIRECT] == (0 if embedded else 1)).all()
        if not embedded:
            assert len(groups) == -(-len(found) // EIGHT)


def test_a_tool_that_turns_takes_a_body_along_as_one_that_moves() -> None:
    """Turning about a far axis by a small angle is moving: the two ways of writing a tool's motion agree."""
    pulled = []
    for angle in (0.0, 1e-9):
        run = PbdRun(block_scene(gravity=(0.0, 0.0, -9.81), tools={"ground": GROUND}))
        run.run(0.1)
        request = run.request()
        tools = dataclasses.replace(
            request.tools,
            position_next=request.tools.position + np.array([1e-4, 0.0, 0.0]),
            orientation_next=np.array([[np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]]),
        )
        reply = run.solver.advance(dataclasses.replace(request, tools=tools))
        pulled.append(reply.wrench[0, :3])
        assert reply.tool_work > 0.0 and reply.wrench[0, 0] < -0.1
    np.testing.assert_allclose(pulled[0], pulled[1], rtol=1e-5, atol=1e-5)
