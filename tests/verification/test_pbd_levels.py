"""Cells of one block beside cells of eight: nodes that hang pass the patch test and keep momentum."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from pbd_cases import BEAM, newton
from pbd_run import Energy, PbdRun, block_scene, cantilever

from softseam_coupling.regions import CellGrid
from softseam_protocol.messages.participant import Bundle, Correct
from softseam_protocol.scene.materials import MATERIALS
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Floats
from softseam_services.body.region import build_region, shared_nodes
from softseam_services.calibration.measure import Bench
from softseam_services.calibration.modes import CELL_REACH
from softseam_services.fem.kernels.elements import subtract_forces
from softseam_services.fem.structures import build_tables
from softseam_services.fem.work import build_work
from softseam_services.orchestrator.cuts import cut
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.seam_faces import tie_parts
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.levels import coarse_cells

Coarse = dict[str, Any]
KINDS = tuple(MATERIALS)
SIZE, CELL = (0.08, 0.06, 0.06), 0.02
CORNER = {"boxes": [{"min": (0.0, -1.0, 0.02), "max": (1.0, 0.01, 1.0)}]}
"""2 x 2 x 2 of 4 x 3 x 3 cells, in an edge of the body: faces, edges and corners hang"""
ALL = {"beyond": 0.0}


def block(coarse: Coarse | None = None, v: Floats | None = None, x: Floats | None = None, **keys: Any) -> PbdRun:
    return PbdRun(block_scene(SIZE, CELL, pbd={"coarse": coarse}, **{"poisson": 0.3, **keys}), v=v, x=x)


def on_skin(run: PbdRun) -> Any:
    x = run.body.x_rest
    return (np.isclose(x, x.min(axis=0)) | np.isclose(x, x.max(axis=0))).any(axis=1)


def grading(body: str) -> dict[str, Any]:
    return {"body": {"shape": {"kind": "block", "size": SIZE, "grading": 3.0}}} if body == "graded" else {}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("body", ["boxes", "graded"])
def test_the_patch_test_passes(kind: str, body: str) -> None:
    """Sheared alike everywhere: one stress in all cells to 1e-10, no force inside, the energy of blocks of one size."""
    run, equal = block(CORNER, kind=kind, **grading(body)), block(kind=kind, **grading(body))
    assert 7 <= run.solver.model.levels.coarse.sum() <= 12
    shape = np.eye(3) + 0.1 * np.random.default_rng(2).standard_normal((3, 3))
    x = run.body.x_rest @ shape.T
    force = Energy(run).force(x)
    size = np.abs(force).max()
    assert np.abs(force[~on_skin(run)]).max() < 1e-11 * size
    assert Energy(run).value(x) == pytest.approx(Energy(equal).value(x), rel=1e-11)
    stress = block(CORNER, x=x, kind=kind, **grading(body)).fields().cauchy
    np.testing.assert_allclose(stress, np.broadcast_to(stress[0, 0], stress.shape), atol=1e-10 * np.abs(stress).max())


def test_held_all_around_the_inside_finds_the_uniform_strain() -> None:
    """From a start far from it, to 1e-10 of the stretch: what hangs on coarse faces adds no stiffness of its own."""
    run = block(CORNER, kind="linear")
    shape = np.array([[1.05, 0.02, 0.0], [0.0, 0.97, 0.03], [0.01, 0.0, 1.02]])
    exact = run.body.x_rest @ shape.T
    free = ~on_skin(run) & ~run.solver.model.levels.hangs
    x = exact.copy()
    x[free] += 1e-3 * np.random.default_rng(0).standard_normal((int(free.sum()), 3))
    found = newton(run, x, np.repeat(free[:, None], 3, axis=1), 0.0, reach=CELL_REACH)
    moved = np.abs(exact - run.body.x_rest).max()
    np.testing.assert_allclose(found[free], exact[free], atol=1e-10 * moved)


@pytest.mark.parametrize("kind", KINDS)
def test_forces_of_any_shape_have_no_sum_and_no_torque(kind: str) -> None:
    """Of laws that do not see rotations, about any point; so momentum and spin are exact."""
    run = block(CORNER, kind=kind)
    x = run.body.x_rest + 2e-3 * np.random.default_rng(1).standard_normal(run.body.x_rest.shape)
    force = Energy(run).force(x)
    total = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * total
    if kind != "linear":
        assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-13 * total * 0.08
    energy, step = Energy(run), 1e-7
    towards = np.random.default_rng(3).standard_normal(x.shape)
    towards[run.solver.model.levels.hangs] = 0.0
    slope = (energy.value(x + step * towards) - energy.value(x - step * towards)) / (2.0 * step)
    assert slope == pytest.approx(-float((force * towards).sum()), rel=1e-6)


def test_masses_are_those_of_the_cells() -> None:
    """In all, about any axis of the first order, and an eighth of a coarse cell at each of its corners."""
    run = block(CORNER)
    mass, x = run.solver.parameters.arrays.mass, run.body.x_rest
    assert mass.sum() == pytest.approx(run.body.total_mass, rel=1e-14)
    np.testing.assert_allclose(mass @ x, run.region.mass @ x, atol=1e-15)
    assert (mass[run.solver.model.levels.hangs] == 0.0).all()
    whole = block(ALL).solver.parameters
    inner = (whole.arrays.mass > 0.0) & ~on_skin(run)
    np.testing.assert_allclose(whole.arrays.mass[inner], 1050.0 * CELL**3, rtol=1e-12)


def test_in_flight_momentum_is_kept_and_those_that_hang_follow() -> None:
    """Thrown and spun: momentum to rounding, spin as implicit Euler allows, and every node where its cell has it."""
    run = block(CORNER)
    middle = run.body.x_rest - run.body.x_rest.mean(axis=0)
    v = np.array([0.3, -0.2, 0.1]) + np.cross(np.array([0.0, 4.0, 3.0]), middle)
    run = block(CORNER, v=v)
    first = run.step()
    last = run.run(0.1)[-1]
    np.testing.assert_allclose(last.momentum, run.region.mass @ v, rtol=1e-12)
    np.testing.assert_allclose(first.momentum, last.momentum, rtol=1e-12)
    np.testing.assert_allclose(
        last.angular_momentum, first.angular_momentum, atol=0.02 * float(np.linalg.norm(first.angular_momentum))
    )
    ties = run.solver.model.levels.ties
    assert ties is not None
    np.testing.assert_array_equal(run.x, ties @ run.x)


def test_colours_share_no_node_and_all_blocks_are_solved() -> None:
    run = block(CORNER)
    blocks = run.solver.model.blocks
    coarse = run.solver.model.levels.coarse
    ids = np.arange(8 * len(coarse)).reshape(-1, 8)
    wanted = np.sort(np.concatenate([ids[~coarse].ravel(), ids[coarse, 0]]))
    assert np.array_equal(np.sort(blocks.octant[blocks.octant >= 0]), wanted)
    for each in (blocks, block(ALL).solver.model.blocks):
        for first, end in zip(each.colours[:-1], each.colours[1:], strict=True):
            mine = each.nodes[first:end].transpose(0, 2, 1).reshape(-1, 8)[each.octant[first:end].ravel() >= 0]
            assert len(np.unique(mine)) == mine.size


def test_the_same_bits_by_any_order_of_cells_and_again() -> None:
    """Cells given backwards, and a run again: the same motion, bit for bit."""
    kicks = 0.2 * np.random.default_rng(3).standard_normal((len(block().body.x_rest), 3))
    scene = block_scene(SIZE, CELL, poisson=0.3, pbd={"coarse": CORNER})
    runs = [PbdRun(scene, v=kicks, cells=np.arange(36, dtype=np.int32)[::way]) for way in (1, -1, 1)]
    for run in runs:
        run.run(0.05)
    for other in runs[1:]:
        np.testing.assert_array_equal(runs[0].x, other.x)
        np.testing.assert_array_equal(runs[0].fields().v, other.fields().v)


@pytest.mark.parametrize("kind", ["neo_hookean", "linear"])
@pytest.mark.parametrize("poisson", [0.0, 0.2, 0.45])
def test_kicked_at_random_it_only_loses_energy(kind: str, poisson: float) -> None:
    """With the substeps that `auto` takes, in part coarse and wholly."""
    n = len(block().body.x_rest)
    kicks = 0.2 * np.random.default_rng(3).standard_normal((n, 3))
    for coarse in (CORNER, ALL):
        run = block(coarse, kind=kind, poisson=poisson, v=kicks)
        energy = [reply.kinetic + reply.strain for reply in run.run(0.4)]
        assert energy[-1] < 0.25 * energy[0]
        assert max(energy) < 1.001 * energy[0]


def tip(coarse: dict[str, Any] | None) -> float:
    """Of the beam of `pbd_cases` in 10 x 2 x 2 cells at rest [m]."""
    run = PbdRun(cantilever(BEAM, 0.01, 1e5, 0.3, pbd={"coarse": coarse}))
    model = run.solver.model
    free = np.repeat((~run.region.fixed & ~model.levels.hangs)[:, None], 3, axis=1)
    x = newton(
        run,
        run.body.x_rest.copy(),
        free,
        run.solver.parameters.arrays.mass[:, None] * run.body.gravity,
        reach=CELL_REACH,
    )
    end = np.argmin(np.linalg.norm(run.body.x_rest - np.array([0.1, 0.01, -0.01]), axis=1))
    return float((x - run.body.x_rest)[end, 2])


def test_a_beam_of_two_levels_lies_between_the_levels() -> None:
    """At rest: coarse blocks bend 0.9 % less, the outer half of them 0.2 % less, since little happens there."""
    fine, outer, coarse = tip(None), tip({"boxes": [{"min": (0.05, -1, -1), "max": (1, 1, 1)}]}), tip(ALL)
    assert -0.015 < coarse / fine - 1.0 < -0.005
    assert -0.003 < outer / fine - 1.0 < 0.0


@pytest.mark.parametrize("kind", ["linear", "neo_hookean"])
@pytest.mark.parametrize("far", ["all coarse", "in part"])
def test_a_seam_to_quadratic_cells_passes_the_patch_test(kind: str, far: str) -> None:
    """FEM below, coarse blocks above, two by one: the multipliers that hold FEM's seam hold PBD's; and H is known."""
    coarse = ALL if far == "all coarse" else {"boxes": [{"min": (0.0, -1.0, -1.0), "max": (1.0, 1.0, 1.0)}]}
    scene = block_scene(SIZE, CELL, kind=kind, poisson=0.3, pbd={"coarse": coarse})
    body = PbdRun(scene).body
    sides = cut("body", body, body.cell_grid[:, 2] == 0, "fem", "pbd")
    tie = tie_parts(body, sides, CellGrid.build(body.cell_grid).neighbours, {"fem": "hex27", "pbd": "hex8"})
    stretch, nu = 1.05, 0.3
    across = 1.0 - nu * (stretch - 1.0)
    if kind == "neo_hookean":  # sides without traction: mu (b - 1/b) + lambda ln(a b b)/b = 0
        mu, lam = 20e3 / (2 * (1 + nu)), 20e3 * nu / ((1 + nu) * (1 - 2 * nu))
        for _ in range(50):
            slope = mu * (1 + 1 / across**2) + lam * (2 - np.log(stretch * across**2)) / across**2
            across -= (mu * (across - 1 / across) + lam * np.log(stretch * across**2) / across) / slope
    x = body.x_rest * np.array([across, across, stretch])
    region = build_region(body, sides.cells[sides.names[0]], sides.seam)
    model, parameters = build_tables(body, region)
    work = build_work(model, parameters, 0)
    r = np.zeros_like(work.r)
    subtract_forces(x[region.nodes], model, parameters, work, r)
    near = np.ascontiguousarray(r.reshape(-1, 3)[model.order])[region.seam]
    run = PbdRun(scene, cells=sides.cells[sides.names[1]], seam=sides.seam)
    ours = run.solver.model
    assert ours.levels.hangs[run.region.seam].any()
    given = Energy(run).force(x[run.region.nodes])[ours.seam]
    assert tie.p is not None
    wanted = ours.seam_force(-tie.p.T @ near)
    np.testing.assert_allclose(tie.gap(x[sides.seam], x[sides.seam]), 0.0, atol=1e-14)
    np.testing.assert_allclose(given, wanted, atol=1e-10 * np.abs(near).max())
    np.testing.assert_allclose(given.sum(axis=0), -near.sum(axis=0), atol=1e-10 * np.abs(near).max())


def seam_run(coarse: dict[str, Any]) -> PbdRun:
    scene = block_scene((0.12, 0.06, 0.06), 0.03, step=0.01, pbd={"coarse": coarse})
    body = PbdRun(scene).body
    near = np.flatnonzero(body.cell_grid[:, 0] == 0).astype(np.int32)
    far = np.flatnonzero(body.cell_grid[:, 0] > 0).astype(np.int32)
    return PbdRun(scene, cells=far, seam=shared_nodes(body, near, far))


@pytest.mark.parametrize(("boxes", "worker"), [(ALL, 27), ({"boxes": [{"min": [-1, 0, -1], "max": [1, 1, 1]}]}, 48)])
def test_the_compliance_of_a_seam_that_hangs_is_what_a_step_does(boxes: dict[str, Any], worker: int) -> None:
    """25 nodes follow 9, or 16, which are the worker. A step is settled as it would be solved."""
    run = seam_run(boxes)
    h = run.solver.advance(run.request(compliance=True)).coupling.compliance
    assert np.linalg.matrix_rank(h, tol=1e-8 * np.abs(h).max()) == worker == 3 * len(run.solver.model.seam)
    force = 1e-3 * np.random.default_rng(0).standard_normal((25, 3))
    rest = run.solver.advance(run.request(exchange=1)).coupling.x
    pushed = run.solver.advance(run.request(force, exchange=2)).coupling.x
    moved = (pushed - rest).ravel()
    np.testing.assert_allclose(h @ force.ravel(), moved, atol=3e-3 * np.abs(moved).max())
    run.solver.advance(run.request(exchange=3))
    run.solver.correct(Correct(run.request(exchange=4).header, force, force))
    np.testing.assert_allclose(run.x[run.region.seam], pushed, atol=3e-3 * np.abs(moved).max())


def test_switches_between_levels_keep_momentum_and_the_ledger() -> None:
    """A spinning cube of FEM and coarse PBD, cut anew every 20 steps: P to 1e-12, L to 1e-10 over a switch, and every
    joule that a change of masses costs is booked.

    Out of two models L comes to 1e-5: what the last step gives back of the spin counts with the masses of coarse cells
    in the report, and with those of all their nodes in the fields.
    """
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "spin",
            "gravity": [0.0, 0.0, -1.0],
            "step": 0.005,
            "duration": 0.5,
            "body": {
                "shape": {"kind": "block", "size": [0.06, 0.06, 0.06]},
                "cell": 0.02,
                "material": {"young": 20e3, "poisson": 0.4, "density": 1000.0},
                "velocity": [0.1, -0.05, 0.02],
                "spin": [1.0, 2.0, 5.0],
            },
            "regions": {
                "default": "pbd",
                "near": {"model": "fem", "boxes": [{"min": [-1, -1, -1], "max": [-0.01, 1, 1]}]},
            },
            "models": {"pbd": {"coarse": {"beyond": 0.0}}, "fem": {"tolerance": 1e-7}},
            "seam": {"tolerance": 1e-9, "exchanges": 12},
        }
    )
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    grid = simulation.body.cell_grid  # type: ignore[union-attr]
    cuts = [grid[:, 0] < 2, grid[:, 1] < 2, np.ones(27, bool), np.zeros(27, bool), grid[:, 2] < 1]
    assert simulation.regions.parts.models["body.far"] == "pbd"
    energy = simulation.step().energy
    for step in range(100):
        report = simulation.step()
        momentum, angular = report.momentum, report.angular_momentum
        total = sum(report.energy[name] for name in ("kinetic", "strain", "gravity"))
        before = sum(energy[name] for name in ("kinetic", "strain", "gravity"))
        booked = report.energy["switch"] + report.energy["seam_work"] - report.energy["dissipation"]
        np.testing.assert_allclose(total - before, booked, atol=1e-12 * report.energy["kinetic"])
        assert (report.energy["switch"] != 0.0) == (step % 20 == 0 and step > 0)
        energy = report.energy
        if step % 20 == 19:
            parts = len(simulation.regions.parts.names)
            simulation.set_near(cuts[step // 20])
            held, off = _begun(simulation), {1: 1e-10, 2: 1e-5}[parts]
            np.testing.assert_allclose(held[0], momentum, atol=1e-12 * float(np.linalg.norm(momentum)))
            np.testing.assert_allclose(held[1], angular, rtol=0.0, atol=off * float(np.linalg.norm(angular)))
    simulation.close()


def _begun(simulation: Simulation) -> tuple[Floats, Floats]:
    """Momentum and angular momentum of the body as its sides' fields have them."""
    body, sides = simulation.body, simulation.regions.parts
    linear, angular = np.zeros(3), np.zeros(3)
    for name, fields in simulation.regions.participants.observe().items():
        mass = build_region(body, sides.cells[name], sides.seam).mass  # type: ignore[arg-type]
        linear += mass @ fields.v
        angular += np.cross(fields.x, mass[:, None] * fields.v).sum(axis=0)
    return linear, angular


def test_cells_that_cannot_be_one_block_stay_in_eight() -> None:
    """Of two materials, filled in part, bent, or clamped over a part of a face; all others are coarse."""
    end = {"min": (-1.0, -1.0, -1.0), "max": (-0.04, -0.02, 1.0)}
    run = block(ALL, fixed=(end,))
    wanted = run.scene.models.pbd.coarse
    grid, body = run.body.cell_grid, run.body
    kept = (grid[:, 0] == 0) & (grid[:, 1] == 0)
    np.testing.assert_array_equal(coarse_cells(body, wanted, run.tools), ~kept)
    materials, fill, x = body.octant_material.copy(), body.fill.copy(), body.x_rest.copy()
    materials[14, 3], fill[15, 7] = 1, 0.4
    x[body.cell_nodes[18, 13]] += 1e-5
    other = dataclasses.replace(body, octant_material=materials, fill=fill, x_rest=x)
    found = coarse_cells(other, wanted, run.tools)
    np.testing.assert_array_equal(np.flatnonzero(~found & ~kept), [14, 15, 18])


def test_distance_is_to_the_tools_that_move() -> None:
    """Plates that will close on the left end, over a table that stays: cells further than 3 cm are coarse."""
    plates = {
        name: {"kind": "box", "size": (0.02, 0.06, 0.01), "position": (-0.03, 0.0, z)}
        for name, z in (("upper", 0.0655), ("lower", -0.0055))
    }
    tools = {**plates, "table": {"kind": "box", "size": (0.2, 0.2, 0.02), "position": (0.0, 0.0, -0.03)}}
    scene = block_scene(SIZE, CELL, tools=tools, moved=("upper", "lower"), pbd={"coarse": {"beyond": 0.03}})
    run = PbdRun(scene)
    np.testing.assert_array_equal(run.solver.model.levels.coarse, run.body.cell_grid[:, 0] == 3)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"models": {"pbd": {"coarse": {}}}}, "say which cells are coarse"),
        ({"quantities": ["model_error"]}, "leave out this quantity, or models.pbd.coarse"),
        ({"regions": {"near": {"error": 0.1, "within": 0.01}}}, "leave out regions.near.error, or models.pbd.coarse"),
    ],
)
def test_what_does_not_go_with_coarse_cells_is_refused(keys: dict[str, Any], said: str) -> None:
    scene = block_scene(SIZE, CELL, pbd={"coarse": ALL}).model_dump()
    with pytest.raises(ValueError, match=said):
        Scene.model_validate({**scene, **keys})


def test_calibration_says_that_it_wants_eight_blocks() -> None:
    run = block(ALL)
    with pytest.raises(ValueError, match=r"leave out models\.pbd\.coarse"):
        Bench(run.scene, run.body)
