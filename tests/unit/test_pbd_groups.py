"""Groups of contacts of an embedded surface: how full they are, and that those left alone would feel nothing."""

from __future__ import annotations

import numpy as np
import pytest
import solids
from numpy.typing import NDArray
from pbd_run import PbdRun, block_scene

from softseam_services.pbd.kernels.contact import begin_pairs, project_contacts
from softseam_services.pbd.kernels.lanes import aligned, copy_rows
from softseam_services.pbd.kernels.pairs import EIGHT, find_pairs, look_ahead, place_points
from softseam_services.pbd.kernels.tool_motion import tool_motions
from softseam_services.pbd.records import Contacts, new_contacts, new_inputs

pytestmark = pytest.mark.kernels

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
MARGIN, H = 1e-3, 4e-4
"""of pairs [m], of a substep [s]"""
BALL = {"shape": {"kind": "mesh", "path": "ball.obj"}, "position": (0.0, 0.0, 0.0)}
TOOLS = {
    "plane": {"ground": {"kind": "plane", "friction": 0.6}},
    "box": {"table": {"kind": "box", "size": (0.1, 0.1, 0.02), "position": (0.0, 0.0, -0.01), "friction": 0.6}},
    "mesh": {"cube": {"kind": "mesh", "path": "cube.obj", "position": (0.0, 0.0, -0.0305), "friction": 0.6}},
}
FILES = {
    "ball.obj": solids.obj(*solids.sphere(0.03, 4)),
    "cube.obj": solids.obj(*solids.box((0.06, 0.06, 0.06), (-0.03, -0.03, -0.03))),
}


def resting(tool: str) -> PbdRun:
    """A ball that was let go on a tool a moment ago."""
    run = PbdRun(block_scene(cell=0.012, gravity=(0, 0, -9.81), tools=TOOLS[tool], body=BALL), files=FILES)
    run.run(0.05)
    return run


def found(run: PbdRun, visits: Ints | None = None) -> tuple[Contacts, Floats]:
    """Pairs of its state, and xw; visits: another order of the points."""
    solver = run.solver
    model, parameters, state = solver.model.arrays, solver.parameters.arrays, run.committed
    model = model if visits is None else model._replace(visits=visits)
    n, t = solver.model.n_nodes, solver.model.n_tools
    contacts, inputs, xw = new_contacts(model, n, t), new_inputs(t, 0), aligned(n + 8, 4)
    xw[:n, :3], xw[:n, 3], xw[n:, :3] = state.x, parameters.inverse_mass, solver.parameters.blocks.padding_x
    for pose, orientation in (
        (inputs.position, inputs.orientation),
        (inputs.position_next, inputs.orientation_next),
        (contacts.position[0], contacts.orientation[0]),
        (contacts.position[1], contacts.orientation[1]),
    ):
        pose[:], orientation[:] = run.position, run.tools.orientation
    tool_motions(
        *contacts.position[:1],
        *contacts.orientation[:1],
        *contacts.position[1:],
        *contacts.orientation[1:],
        contacts.motion,
    )
    place_points(model, parameters, xw, contacts.point_x)
    look_ahead(parameters, inputs, contacts, state.x, 1e-4)
    find_pairs(model, parameters, state, inputs, contacts, MARGIN, H * H)
    copy_rows(contacts.found_at, xw)
    return contacts, xw


def solved(run: PbdRun, way: float, awake: bool) -> tuple[Floats, Floats, int]:
    """Where contacts put nodes that came down by so much [m] in a substep, the pairs, and groups solved."""
    model, parameters = run.solver.model.arrays, run.solver.parameters.arrays
    contacts, xw = found(run)
    n = int(contacts.start[-1])
    if awake:
        contacts.clear[:] = -np.inf
    begin_pairs(model, parameters, contacts, xw, np.zeros((run.solver.model.n_nodes, 3)), H)
    xw[: run.solver.model.n_nodes, 2] -= way
    project_contacts(model, parameters, contacts, xw, H * H, False)
    return xw, contacts.pairs[:n].reshape(n, -1, EIGHT)[:, 8:11], int(np.isneginf(contacts.clear[:n]).sum())


@pytest.mark.parametrize("tool", TOOLS)
def test_what_is_left_alone_would_feel_nothing(tool: str) -> None:
    """However far the nodes come, places and forces are those of all groups, bit for bit; and some are left alone."""
    run, counts = resting(tool), []
    for way in (0.0, 1e-4, 3e-4, 6e-4, 2e-3):
        places, forces, few = solved(run, way, awake=False)
        expected, of_all, every = solved(run, way, awake=True)
        np.testing.assert_array_equal(places, expected)
        np.testing.assert_array_equal(forces, of_all)
        assert forces.any()
        counts.append(few)
    assert counts == sorted(counts) and counts[0] < 0.75 * every and counts[-1] == every


def test_points_by_colours_take_fewer_groups() -> None:
    """Cell by cell they held two points each."""
    run = resting("plane")
    model = run.solver.model
    by_colours, by_cells = (
        int(found(run, visits)[0].start[-1]) for visits in (model.visits, np.arange(model.n_points, dtype=np.int32))
    )
    assert sorted(model.visits) == list(range(model.n_points)) and by_colours < 0.7 * by_cells
