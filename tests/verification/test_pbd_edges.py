"""A tool's edge between points of PBD: the force follows the edge as FEM's does, without steps, and takes part in all
that contact takes part in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray
from pbd_run import PbdRun, Vector, block_scene
from test_tool_edges import REFERENCE, press

from softseam_services.pbd.kernels.pairs import EDGED

Floats = NDArray[np.float64]
CELL = 0.0125
BLOCK = CELL / 2.0
WHOLE = {"boxes": [{"min": (-1.0, -1.0, -1.0), "max": (1.0, 1.0, 1.0)}]}


def two_pads(half: float, friction: float = 20.0, aside: float = 0.0) -> dict[str, Any]:
    pad = {"kind": "box", "size": (2.0 * half, 2.0 * half, 0.01), "friction": friction}
    return {"low": {**pad, "position": (aside, 0.0, -0.005)}, "high": {**pad, "position": (aside, 0.0, 0.055)}}


def pads(half: float, cells: int = 4, aside: float = 0.0, friction: float = 20.0, **keys: Any) -> PbdRun:
    """A cube of 5 cm without weight between two square pads; keys of `block_scene`."""
    tools = two_pads(half, friction, aside)
    return PbdRun(block_scene(cell=0.05 / cells, tools=tools, moved=("low", "high"), **{"step": 0.01, **keys}))


def squeezed(run: PbdRun, share: float = 0.15) -> float:
    """Force that the upper pad holds after a squeeze by this share of the cube [N]."""
    way = 0.5 * share * 0.05
    run.velocity[:, 2] = way / 0.3, -way / 0.3
    run.run(0.3)
    run.velocity[:] = 0.0
    reply = run.run(0.4)[-1]
    assert reply.wrench[0, 2] == pytest.approx(-reply.wrench[1, 2], rel=1e-3)
    return float(reply.wrench[1, 2])


def test_the_force_follows_the_edge_over_a_cell_as_fem_does() -> None:
    """At each eighth of a cell within 8 % of FEM on the same cells, and the mean within 2 %. Points that touched wholly
    or not at all were 6 to 37 % off, and four of the edge's seven steps changed nothing."""
    halves = CELL * (1.0 + np.arange(8) / 8.0)
    held = np.array([squeezed(pads(half)) for half in halves])
    fem = []
    for half in halves:
        scene = block(cell=CELL, poisson=0.45, tools=two_pads(half), gravity=(0.0, 0.0, 0.0), step=0.02)
        fem.append(press(FemRun(scene), [0.15], 8)[0])
    np.testing.assert_allclose(held, fem, rtol=0.08)
    assert np.mean(held / np.array(fem)) == pytest.approx(1.0, abs=0.02)
    rises = 7.0 * np.diff(held) / (held[-1] - held[0])
    assert 0.2 < rises.min() and rises.max() < 1.8


@pytest.mark.parametrize(("cells", "within"), [(2, 0.08), (3, 0.12), (4, 0.04)])
def test_a_pad_between_points_is_held_with_the_converged_force(cells: int, within: float) -> None:
    """The pad's edge is at 20, 80 and 40 % of a block; the force was off by 9, 45 and 14 %."""
    assert squeezed(pads(0.015, cells)) == pytest.approx(REFERENCE[2], rel=within)


def test_long_cells_and_cells_of_one_block() -> None:
    """Blocks of other sizes beside each other, and corners of coarse cells that no pad of this size covers."""
    graded = {"shape": {"kind": "block", "size": (0.05, 0.05, 0.05), "grading": 2.0}}
    assert squeezed(pads(0.015, 3, body=graded)) == pytest.approx(REFERENCE[2], rel=0.04)
    assert squeezed(pads(0.015, 4, pbd={"coarse": WHOLE})) == pytest.approx(REFERENCE[2], rel=0.07)
    assert squeezed(pads(0.004, 4, pbd={"coarse": WHOLE})) > 0.5


def test_the_force_follows_a_pad_that_slides() -> None:
    """Without friction over two lines of points, in steps of a twentieth of a block; it fell by 23 % in one step,
    where a line was left."""
    run = pads(0.0095, 4, -0.006, friction=0.0)
    squeezed(run, 0.05)
    run.velocity[:, 0] = 0.05 * BLOCK / 0.01
    force = np.array([run.step().wrench[1, 2] for _ in range(40)])
    assert np.abs(np.diff(force)).max() < 0.03 * force.mean()
    assert np.ptp(force) < 0.2 * force.mean()


@pytest.mark.parametrize(("rotation", "size"), [((0, 0, 1), (0.03, 0.02, 0.01)), ((1, 0, 0), (0.02, 0.01, 0.03))])
def test_a_pad_is_what_it_is_in_its_own_frame(rotation: Vector, size: Vector) -> None:
    """Pads of 2 x 3 cm, and the same boxes written turned by a quarter about z and about x."""
    held = []
    turned = tuple(0.5 * np.pi * np.array(rotation))
    for edges, turn in (((0.02, 0.03, 0.01), (0.0, 0.0, 0.0)), (size, turned)):
        pad = {"kind": "box", "friction": 0.6, "size": edges, "rotation": turn}
        tools = {"low": {**pad, "position": (0.003, 0.0, -0.005)}, "high": {**pad, "position": (0.003, 0.002, 0.055)}}
        held.append(squeezed(PbdRun(block_scene(cell=CELL, tools=tools, moved=("low", "high"), step=0.01)), 0.05))
    assert held[1] == pytest.approx(held[0], rel=1e-3)


def test_pads_that_carry_press_as_pads_at_rest() -> None:
    """Seen from a frame that moves along, 2 mm a step, nothing moves; more points are tried for contact,
    in another order."""
    rest, carried = pads(0.01), pads(0.01)
    carried.committed.v[:] += (0.2, 0.12, 0.0)
    rest.velocity[:, 2] = 0.01, -0.01
    carried.velocity[:] = (0.2, 0.12, 0.01), (0.2, 0.12, -0.01)
    for _ in range(20):
        still, moving = rest.step(), carried.step()
    assert still.wrench[1, 2] > 0.5
    np.testing.assert_allclose(moving.wrench[:, 2], still.wrench[:, 2], rtol=2e-3)


def test_friction_of_a_pad_between_points() -> None:
    """Pushed aside by 0.1 mm the pads stick, by 8 mm they slip: then the pull is mu times what they press with, up to a
    quarter more or less as rows of points pass an edge, and 6 to 12 % less in the mean, for that is round."""
    middle = [{"min": (-1.0, -1.0, 0.02), "max": (1.0, 1.0, 0.03)}]
    run = pads(0.01, friction=0.3, fixed=middle)
    squeezed(run, 0.05)
    pulls = []
    for way in (1e-4, 8e-3):
        run.velocity[:, 0] = way / 0.2
        wrench = np.array([reply.wrench for reply in run.run(0.2)])
        pulls.append(np.abs(wrench[:, :, 0] / wrench[:, :, 2]))
    assert (pulls[0][-1] < 0.1).all()
    np.testing.assert_allclose(pulls[1][-1], 0.3, rtol=0.25)
    np.testing.assert_allclose(pulls[1][4:].mean(axis=0), 0.3, rtol=0.13)


def test_what_tools_feel_is_what_the_body_feels() -> None:
    """Impulses of the tools are the body's momentum, and their wrenches the forces on its points, to rounding."""
    run = pads(0.0085, 3, 0.004)
    run.velocity[:, 2] = 0.03, -0.01
    before = run.step()
    for _ in range(20):
        reply = run.step()
        change = (reply.momentum - before.momentum) / run.scene.step
        np.testing.assert_allclose(change, -reply.wrench[:, :3].sum(axis=0), atol=1e-9)
        np.testing.assert_allclose(run.fields().contact_force.sum(axis=0), -reply.wrench[:, :3].sum(axis=0), atol=1e-12)
        before = reply
    assert reply.wrench[1, 2] > 0.5 and (run.scratch.arrays.contacts.rows[:, EDGED] > 0).any()


def test_a_body_under_larger_plates_has_no_edges() -> None:
    run = pads(0.026)
    squeezed(run, 0.05)
    assert run.solver.model.n_points == run.solver.model.n_surface
    assert not run.scratch.arrays.contacts.rows[:, EDGED].any()


def test_a_state_that_is_handed_over_goes_on() -> None:
    """Positions, velocities and forces of points are all that a point in part needs."""
    run = pads(0.0115, 4)
    held = squeezed(run, 0.1)
    rebuilt = PbdRun(run.scene, state=run.handed())
    rebuilt.position = run.position
    for _ in range(10):
        assert rebuilt.step().wrench[1, 2] == pytest.approx(held, rel=0.07)
    data = run.solver.snapshot()
    ahead = [run.step().wrench.tobytes() for _ in range(3)]
    run.solver.restore(data)
    assert [run.step().wrench.tobytes() for _ in range(3)] == ahead


def half(friction: float, **keys: Any) -> PbdRun:
    """The half of a cube, between pads, whose seam is its middle; keys of `block_scene`."""
    scene = block_scene(cell=0.025, tools=two_pads(0.021, friction), moved=("low", "high"), step=0.01, **keys)
    body = PbdRun(scene).body
    mine, others = (np.flatnonzero(body.cell_grid[:, 0] == side).astype(np.int32) for side in (0, 1))
    seam = np.intersect1d(body.cell_nodes[mine], body.cell_nodes[others]).astype(np.int32)
    run = PbdRun(scene, cells=mine, seam=seam)
    run.velocity[:, 2] = 2e-3, -2e-3
    run.run(0.3)
    run.velocity[:] = 0.0
    return run


def probed(run: PbdRun) -> tuple[Floats, Floats]:
    """Every seventh column of the seam's compliance, and the same by central differences of the step [m/N]."""
    compliance = run.solver.advance(run.request(compliance=True)).coupling.compliance
    columns = np.arange(0, len(compliance), 7)
    difference = np.empty((len(compliance), len(columns)))
    for at, column in enumerate(columns):
        ends = []
        for sign in (1.0, -1.0):
            force = np.zeros(len(compliance))
            force[column] = sign * 1e-6
            ends.append(run.solver.advance(run.request(force.reshape(-1, 3))).coupling.x.ravel())
        difference[:, at] = (ends[0] - ends[1]) / 2e-6
    return compliance[:, columns], difference


def test_the_seam_is_probed_with_points_in_part() -> None:
    """Compliance against central differences of a step in which all stick; the pads' edges lie beyond the seam."""
    run = half(20.0)
    run.run(0.6)
    assert (run.scratch.arrays.contacts.rows[:, EDGED] > 0).any()
    compliance, difference = probed(run)
    off = np.linalg.norm(compliance - difference, axis=0)
    assert (off <= 0.01 * np.linalg.norm(difference, axis=0)).all()


def test_the_seam_is_probed_while_pads_slide() -> None:
    """In a step in which points slip: .21 off, .31 where they would stick."""
    run = half(0.3, fixed=[{"min": (-1.0, -1.0, -1.0), "max": (-0.024, 1.0, 1.0)}])
    run.velocity[:, 1] = 0.02
    run.run(0.3)
    compliance, difference = probed(run)
    assert np.linalg.norm(compliance - difference) < 0.25 * np.linalg.norm(difference)


def test_sticking_is_as_soft_whatever_the_sweeps() -> None:
    """A pad within a block, slid by 0.02 mm: each of a substep's projections added the whole slip to the force."""
    middle = [{"min": (-1.0, -1.0, 0.02), "max": (1.0, 1.0, 0.03)}]
    pulls = []
    for sweeps in (1, 2, 4):
        run = pads(0.3 * BLOCK, 2, fixed=middle, pbd={"sweeps": sweeps, "substeps": 40})
        squeezed(run, 0.02)
        run.velocity[:, 0] = 1e-4
        run.run(0.2)
        run.velocity[:] = 0.0
        pulls.append(run.run(0.3)[-1].wrench[1, 0])
    assert abs(pulls[0]) > 1e-4
    np.testing.assert_allclose(pulls, pulls[0], rtol=0.02)


def test_points_handed_over_inside_a_pad_come_out_slowly() -> None:
    """Pads that begin 0.5 mm inside give the body three times the energy that plates do, which cover it."""
    moving = {}
    for half in (0.0115, 0.026):
        run = pads(half)
        run.position[:, 2] += 5e-4, -5e-4
        moving[half] = max(run.step().kinetic for _ in range(3))
    assert moving[0.0115] < 3.5 * moving[0.026]


@pytest.mark.parametrize("half", [1.5 * BLOCK, 2.3 * BLOCK])
def test_a_thin_pad_presses_as_a_thick_one(half: float) -> None:
    """The side is the same, and its edges less round: within 10 %. The surface beside it passes the middle of a pad of
    2 mm."""
    held = []
    for thick in (0.002, 0.02):
        pad = {"kind": "box", "size": (2.0 * half, 2.0 * half, thick), "friction": 20.0}
        tools = {
            "low": {**pad, "position": (0.0, 0.0, -0.5 * thick)},
            "high": {**pad, "position": (0.0, 0.0, 0.05 + 0.5 * thick)},
        }
        held.append(squeezed(PbdRun(block_scene(cell=CELL, tools=tools, moved=("low", "high"), step=0.01)), 0.25))
    assert held[0] == pytest.approx(held[1], rel=0.1)


def test_what_sticks_at_an_edge_does_not_creep() -> None:
    """A pad that covers points in part, dragged until some of them slide, then held: the pull stays."""
    middle = [{"min": (-1.0, -1.0, 0.02), "max": (1.0, 1.0, 0.03)}]
    run = pads(0.0085, friction=0.6, fixed=middle)
    squeezed(run, 0.1)
    run.velocity[:, 0] = 1e-2
    run.run(0.2)
    run.velocity[:] = 0.0
    pulls = [run.run(0.5)[-1].wrench[1, 0] for _ in range(3)]
    assert abs(pulls[0]) > 0.5
    np.testing.assert_allclose(pulls[1:], pulls[0], rtol=2e-4)
