"""Blocks that are no boxes: they are boxes where their shape is one, pass the patch test, turn, bend and stay calm."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hexahedra import lattice, mesh, vtk
from pbd_cases import BEAM, BEAM_RESTS, newton
from pbd_run import Energy, PbdRun, block_scene, cantilever, static_solution

from softseam_coupling.regions import CellGrid
from softseam_protocol.scene.materials import MATERIALS
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.lattice import LOCAL
from softseam_services.body.materials import point
from softseam_services.body.region import build_region
from softseam_services.fem.kernels.elements import subtract_forces
from softseam_services.fem.structures import build_tables
from softseam_services.fem.work import build_work
from softseam_services.orchestrator.cuts import cut
from softseam_services.orchestrator.seam_faces import tie_parts
from softseam_services.pbd.forms import MODES, mean_slopes

KINDS = tuple(MATERIALS)
SIZE = (0.06, 0.05, 0.04)
COUNTS = (2, 2, 2)


def ragged(counts: tuple[int, int, int] = COUNTS, amount: float = 0.15, turns: int = 0) -> bytes:
    """A block whose corners are all moved at random by up to `amount` of an edge: faces are warped, inside and out.

    turns: how often each hexahedron's corners are numbered on from x to y to z.
    """
    points, cells = lattice(counts, SIZE)
    edges = np.array(SIZE) / np.array(counts)
    points = points + amount * edges * np.random.default_rng(6).uniform(-1.0, 1.0, points.shape)
    for _ in range(turns):
        cells = cells[:, [0, 3, 7, 4, 1, 2, 6, 5]]
    return vtk(points, cells)


def shaped(data: bytes | None = None, **keys: Any) -> PbdRun:
    """A run whose cells are the hexahedra of a file, by default those of `ragged`."""
    v, x = keys.pop("v", None), keys.pop("x", None)
    shape = {"kind": "mesh", "path": "m.vtk", "cells": "own"}
    scene = block_scene(body={"shape": shape, "cell": None}, **{"poisson": 0.4, **keys})
    return PbdRun(scene, files={"m.vtk": ragged() if data is None else data}, x=x, v=v)


def rotation(axis: tuple[float, float, float], angle: float) -> Floats:
    k = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


TURN = rotation((1.0, -2.0, 0.5), 0.7)


def middle(run: PbdRun) -> Floats:
    """Places of the nodes about the body's centre of mass (n, 3)."""
    places: Floats = run.body.x_rest - run.region.mass @ run.body.x_rest / run.region.mass.sum()
    return places


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("hourglass", ["physical", "fitted"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_box_is_a_box(kind: str, hourglass: str, turned: bool) -> None:
    """Boxes of 15 x 12.5 x 10 mm given as hexahedra, and the same body turned: the boxes' energy and forces."""
    turn = TURN if turned else np.eye(3)
    pbd = {"hourglass": hourglass}
    boxes = PbdRun(block_scene(SIZE, (0.03, 0.025, 0.02), kind=kind, poisson=0.4, pbd=pbd))
    same = shaped(kind=kind, pbd=pbd, data=mesh(COUNTS, SIZE, bend=lambda points: points @ turn.T))
    apart = np.linalg.norm(middle(same)[:, None] - (middle(boxes) @ turn.T)[None], axis=2)
    order = apart.argmin(axis=0)  # nodes of files are numbered otherwise
    assert apart.min(axis=0).max() < 1e-12
    u = 2e-3 * np.random.default_rng(1).standard_normal(boxes.body.x_rest.shape)
    moved = same.body.x_rest.copy()
    moved[order] += u @ turn.T
    here, there = Energy(boxes), Energy(same)
    np.testing.assert_allclose(there.value(moved), here.value(boxes.body.x_rest + u), rtol=1e-11)
    force = here.force(boxes.body.x_rest + u) @ turn.T
    np.testing.assert_allclose(there.force(moved)[order], force, atol=1e-11 * np.abs(force).max())


@pytest.mark.parametrize("kind", ["neo_hookean", "mooney_rivlin"])
def test_a_turned_box_moves_as_a_box(kind: str) -> None:
    """Kicked alike, step by step: the local solve does not mind how blocks lie in space."""
    scene = block_scene(SIZE, (0.03, 0.025, 0.01), kind=kind, poisson=0.4, pbd={"substeps": 6})
    data = mesh((2, 2, 4), SIZE, bend=lambda points: points @ TURN.T)
    boxes, turned = PbdRun(scene), shaped(data, kind=kind, pbd={"substeps": 6})
    order = np.linalg.norm(middle(turned)[:, None] - (middle(boxes) @ TURN.T)[None], axis=2).argmin(axis=0)
    kicks = 0.1 * np.random.default_rng(3).standard_normal(boxes.body.x_rest.shape)
    given = np.empty_like(kicks)
    given[order] = kicks @ TURN.T
    boxes = PbdRun(scene, v=kicks)
    turned = shaped(data, kind=kind, pbd={"substeps": 6}, v=given)
    for _ in range(5):
        boxes.step()
        turned.step()
    moved = (boxes.x - boxes.body.x_rest) @ TURN.T
    assert np.abs(moved).max() > 5e-4
    np.testing.assert_allclose((turned.x - turned.body.x_rest)[order], moved, atol=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_force_is_minus_the_gradient_of_the_energy(kind: str) -> None:
    run = shaped(kind=kind)
    energy, rng = Energy(run), np.random.default_rng(1)
    x = run.body.x_rest + 2e-3 * rng.standard_normal(run.body.x_rest.shape)
    direction, h = rng.standard_normal(x.shape), 1e-6
    slope = (energy.value(x + h * direction) - energy.value(x - h * direction)) / (2 * h)
    force = energy.force(x)
    np.testing.assert_allclose(-np.sum(force * direction), slope, rtol=2e-6, atol=1e-6 * np.abs(force).sum())


@pytest.mark.parametrize("kind", KINDS)
def test_patch_any_affine_state_is_uniform_and_balanced_inside(kind: str) -> None:
    """x = G X on blocks with warped faces: the material's stress everywhere, no force on inner nodes."""
    run = shaped(kind=kind)
    gradient = np.eye(3) + 0.1 * np.random.default_rng(3).standard_normal((3, 3))
    x = run.body.x_rest @ gradient.T
    force = Energy(run).force(x)
    inside = np.ones(run.body.n_nodes, dtype=np.bool_)
    inside[run.solver.model.node] = False  # of the surface
    assert inside.sum() == 27
    np.testing.assert_allclose(force[inside], 0.0, atol=1e-12 * np.abs(force).max())
    material = run.body.material
    sigma = np.empty((3, 3))
    point.cauchy(material.number, material.parameters, gradient, sigma)
    cauchy = shaped(kind=kind, x=x).fields().cauchy
    expected = sigma[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    np.testing.assert_allclose(cauchy, np.broadcast_to(expected, cauchy.shape), rtol=1e-10)


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"linear"}))
def test_rigid_motion_changes_neither_energy_nor_stress(kind: str) -> None:
    run = shaped(kind=kind)
    energy, rng = Energy(run), np.random.default_rng(5)
    x = run.body.x_rest + 2e-3 * rng.standard_normal(run.body.x_rest.shape)
    moved = x @ TURN.T + rng.standard_normal(3)
    force = energy.force(x)
    np.testing.assert_allclose(energy.value(moved), energy.value(x), rtol=1e-10)
    np.testing.assert_allclose(energy.force(moved), force @ TURN.T, atol=1e-9 * np.abs(force).max())
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())
    np.testing.assert_allclose(np.cross(x, force).sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())


@pytest.mark.parametrize("kind", ["neo_hookean", "linear"])
def test_a_cell_has_six_modes_without_energy(kind: str) -> None:
    """Eight blocks of one distorted cell at rest: no hourglass is free, and no more than rigid motions are."""
    run = shaped(kind=kind, data=ragged((1, 1, 1)))
    force, x = Energy(run), run.body.x_rest
    columns = []
    for i in range(x.size):
        ahead, behind = x.copy(), x.copy()
        ahead.reshape(-1)[i] += 1e-8
        behind.reshape(-1)[i] -= 1e-8
        columns.append((force.force(behind) - force.force(ahead)).ravel() / 2e-8)
    stiffness = np.array(columns)
    found = np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))
    assert np.abs(found[:6]).max() < 1e-5 * found[-1]
    assert found[6] > 1e-3 * found[-1]


@pytest.mark.parametrize("kind", ["neo_hookean", "linear"])
def test_how_corners_are_numbered_does_not_matter(kind: str) -> None:
    """Axes x y z of every hexahedron named y z x and z x y: the same energy of the same shape."""
    rest = shaped(kind=kind).body.x_rest
    shift = 2e-3 * np.random.default_rng(1).standard_normal(rest.shape)
    found = []
    for turns in range(3):
        run = shaped(kind=kind, data=ragged(turns=turns))
        same = np.linalg.norm(run.body.x_rest[:, None] - rest[None], axis=2).argmin(axis=1)
        found.append(Energy(run).value(run.body.x_rest + shift[same]))
    np.testing.assert_allclose(found[1:], found[0], rtol=1e-11)


def test_hourglass_energies_of_a_skew_block_are_those_of_skew_plates() -> None:
    """One skew block, any four modes: what is linear in one coordinate is isotropic plane stress in the plane of the
    other two, as tensors; what is linear in two is pulled along one axis each."""
    skew = 0.015 * np.array([[1.0, 0.3, -0.2], [0.1, 0.8, 0.25], [0.0, -0.3, 1.2]])
    cube = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
    run = shaped(kind="linear", data=vtk(2.0 * cube @ skew.T, np.arange(8)[None]))
    energy, young, nu = Energy(run), 20e3, 0.4
    blocks = run.solver.model.blocks
    batch, lane = np.argwhere(blocks.octant == 3)[0]
    numbers = run.solver.parameters.blocks
    alone = np.zeros_like(numbers.volume)
    alone[batch, lane] = volume = numbers.volume[batch, lane]
    energy.numbers = dataclasses.replace(numbers, volume=alone)
    a = 1e-4 * np.random.default_rng(5).standard_normal((4, 3))
    x = run.body.x_rest.copy()
    x[blocks.nodes[batch, :, lane]] += MODES.T @ a
    g = 0.5 * skew.T
    expected = sum(young / 9.0 * (a[3] @ g[c] / (g[c] @ g[c])) ** 2 for c in range(3))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        shear = 0.5 * (a[i] @ g[i] + a[j] @ g[j])
        dual = np.linalg.pinv(g[[i, j]])
        strain = dual @ np.array([[a[j] @ g[i], shear], [shear, a[i] @ g[j]]]) @ dual.T
        expected += young / (1 - nu**2) / 3.0 * ((1 - nu) * (strain**2).sum() + nu * np.trace(strain) ** 2)
    assert volume == pytest.approx(np.linalg.det(skew), rel=1e-12)
    assert energy.value(x) == pytest.approx(0.5 * volume * expected, rel=1e-9)


def test_mean_slopes_are_the_volume_s_derivatives() -> None:
    """V b_i = dV/dX_i, of a hexahedron with warped faces; a parallelepiped's are those at its middle."""
    rng = np.random.default_rng(4)
    signs = np.array([(i, j, k) for k in (-1, 1) for j in (-1, 1) for i in (-1, 1)], dtype=np.float64)
    x = (0.01 * signs + 0.002 * rng.standard_normal((8, 3)))[None]
    slopes, volume = mean_slopes(x)
    for node, axis in ((0, 0), (3, 2), (6, 1)):
        ahead, behind = x.copy(), x.copy()
        ahead[0, node, axis] += 1e-6
        behind[0, node, axis] -= 1e-6
        slope = (mean_slopes(ahead)[1] - mean_slopes(behind)[1])[0] / 2e-6
        assert volume[0] * slopes[0, node, axis] == pytest.approx(slope, rel=1e-8)
    skew = np.array([[0.01, 0.002, 0.0], [0.001, 0.008, 0.003], [0.0, -0.002, 0.012]])
    slopes, volume = mean_slopes((signs @ skew.T)[None])
    assert volume[0] == pytest.approx(8.0 * np.linalg.det(skew), rel=1e-12)
    np.testing.assert_allclose(slopes[0], signs @ np.linalg.inv(skew) / 8.0, rtol=1e-9)


def test_blocks_that_meet_anyhow_share_no_node_in_a_colour() -> None:
    """Three hexahedra around one edge, four cells high: the octants' places say nothing, and all are solved once."""
    angle = np.arange(6) * np.pi / 3
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    layer = np.concatenate([[[0.0, 0.0]], ring])
    points = np.concatenate([np.column_stack([0.03 * layer, np.full(7, 0.02 * k)]) for k in range(5)])
    base = np.array([(0, 6, 1, 2), (0, 2, 3, 4), (0, 4, 5, 6)])
    cells = np.concatenate([np.concatenate([base, base + 7], axis=1) + 7 * k for k in range(4)])
    run = shaped(data=vtk(points, cells.astype(np.int64)), v=None)
    blocks = run.solver.model.blocks
    assert np.array_equal(np.sort(blocks.octant[blocks.octant >= 0]), np.arange(8 * 12))
    for first, end in zip(blocks.colours[:-1], blocks.colours[1:], strict=True):
        mine = blocks.nodes[first:end].transpose(0, 2, 1).reshape(-1, 8)[blocks.octant[first:end].ravel() >= 0]
        assert len(np.unique(mine)) == mine.size
    assert len(blocks.colours) - 1 <= 12
    run.run(0.05)
    np.testing.assert_allclose(run.x, run.body.x_rest, atol=1e-13)


def test_momentum_is_kept_in_flight() -> None:
    """A distorted body thrown and spun: total momentum to rounding, angular momentum as implicit Euler allows."""
    run = shaped()
    rest = middle(run)
    v = np.array([0.3, -0.2, 0.1]) + np.cross(np.array([0.0, 4.0, 3.0]), rest)
    run = shaped(v=v)
    before = run.region.mass @ v
    spin = np.cross(rest, run.region.mass[:, None] * (v - [0.3, -0.2, 0.1])).sum(axis=0)
    replies = run.run(0.1)
    np.testing.assert_allclose(replies[-1].momentum, before, rtol=1e-12)
    centre = run.region.mass @ run.x / run.region.mass.sum()
    after = np.cross(run.x - centre, run.region.mass[:, None] * run.fields().v).sum(axis=0)
    np.testing.assert_allclose(after, spin, atol=0.02 * float(np.linalg.norm(spin)))


def test_statics_are_exact() -> None:
    """What a dense Newton finds on the distorted blocks stays where it is to 1e-9 of the sag."""
    end = {"min": (-1.0, -1.0, -1.0), "max": (0.007, 1.0, 1.0)}
    keys: dict[str, Any] = {"gravity": (0.0, 0.0, -9.81), "position": (0.03, 0.0, 0.0), "fixed": (end,)}
    run = shaped(ragged((2, 1, 1), 0.1), **keys)
    exact = static_solution(run, run.region.mass[:, None] * run.body.gravity)
    sag = np.abs(exact - run.body.x_rest).max()
    assert sag > 5e-4
    handed = shaped(ragged((2, 1, 1), 0.1), x=exact, **keys)
    handed.run(0.1)
    np.testing.assert_allclose(handed.x, exact, atol=1e-9 * sag)


def _lattice_of(body: Body, counts: tuple[int, int, int]) -> Ints:
    """Place of each node on the lattice of a block's cells, numbered x fastest (N, 3)."""
    grid = np.empty((body.n_nodes, 3), dtype=np.int32)
    k, j, i = (a.ravel() for a in np.meshgrid(*[np.arange(n) for n in reversed(counts)], indexing="ij"))
    grid[body.cell_nodes] = 2 * np.stack([i, j, k], axis=1)[:, None, :] + LOCAL
    return grid


def beam_error(counts: tuple[int, int, int], grading: float = 1.0, amount: float = 0.0) -> float:
    """Of the tip of a beam at rest (`pbd_cases`), in graded cells, or in distorted ones."""
    cell = tuple(edge / count for edge, count in zip(BEAM, counts, strict=True))
    shape: dict[str, Any] = {"kind": "block", "size": BEAM, "grading": grading}
    scene = cantilever(BEAM, cell, 1e5, 0.3, body={"shape": shape})  # type: ignore[arg-type]
    files = {}
    if amount > 0.0:
        said = scene.model_dump()
        said["body"] |= {"shape": {"kind": "mesh", "path": "m.vtk", "cells": "own"}, "cell": None}
        scene, files = Scene.model_validate(said), {"m.vtk": mesh(counts, BEAM, amount)}
    run = PbdRun(scene, files=files)
    free = np.repeat(~run.region.fixed[:, None], 3, axis=1)
    load = run.region.mass[:, None] * run.body.gravity
    x = newton(run, run.body.x_rest.copy(), free, load, _lattice_of(run.body, counts))
    tip = np.argmin(np.linalg.norm(run.body.x_rest - np.array([0.1, 0.0, 0.0]), axis=1))
    return float((x - run.body.x_rest)[tip, 2]) / BEAM_RESTS - 1.0


def test_a_cantilever_in_cells_of_any_shape_sags_as_in_equal_ones() -> None:
    """Against finite elements of independent codes: equal cells -2.2 %, distorted ones and graded ones no worse, and
    twice as many along each axis come closer by the order of the equal ones."""
    equal = beam_error((5, 1, 1))
    assert -0.024 < equal < -0.02
    assert abs(beam_error((5, 1, 1), amount=0.06)) < abs(equal)
    graded = beam_error((5, 1, 1), grading=3.0)
    assert abs(graded) < abs(equal)
    assert abs(beam_error((10, 2, 2), grading=3.0)) < 0.5 * abs(graded)


@pytest.mark.parametrize("kind", ["neo_hookean", "linear"])
@pytest.mark.parametrize("poisson", [0.0, 0.2, 0.45])
def test_kicked_at_random_blocks_of_any_shape_only_lose_energy(kind: str, poisson: float) -> None:
    """Substeps by the automatic rule on cells graded by 4 and on distorted ones: the highest frequency is theirs."""
    body = {"shape": {"kind": "block", "size": SIZE, "grading": 4.0}}
    scene = block_scene(SIZE, (0.02, 0.05 / 3, 0.04 / 3), kind=kind, poisson=poisson, body=body)
    equal = block_scene(SIZE, (0.02, 0.05 / 3, 0.04 / 3), kind=kind, poisson=poisson)
    n = len(PbdRun(scene).body.x_rest)
    kicks = 0.2 * np.random.default_rng(3).standard_normal((n, 3))
    graded = PbdRun(scene, v=kicks)
    assert graded.solver.substeps > 1.5 * PbdRun(equal).solver.substeps
    n = len(shaped().body.x_rest)
    for run in (graded, shaped(kind=kind, poisson=poisson, v=kicks[:n])):
        replies = run.run(0.4)
        energy = [reply.kinetic + reply.strain for reply in replies]
        assert energy[-1] < 0.2 * energy[0] and max(energy) < 1.001 * energy[0]
        assert sum(1 for reply in replies if reply.alarms) <= 1  # a kick at rest may take a repetition, boxes too


def test_a_seam_between_graded_cells_passes_the_patch_test() -> None:
    """FEM below, PBD above, pulled along z: the multipliers that hold FEM's seam nodes hold PBD's, too."""
    shape = {"kind": "block", "size": SIZE, "grading": 5.0}
    scene = block_scene(SIZE, (0.02, 0.05 / 3, 0.04 / 3), kind="linear", body={"shape": shape})
    body = PbdRun(scene).body
    sides = cut("body", body, body.cell_grid[:, 2] == 0, "fem", "pbd")
    neighbours = CellGrid.build(body.cell_grid).neighbours
    tie = tie_parts(body, sides, neighbours, {"fem": "hex27", "pbd": "hex8"})
    nu = 0.45  # the sides of the body feel no traction
    x = body.x_rest * (1.0 + 0.05 * np.array([-nu, -nu, 1.0]))
    region = build_region(body, sides.cells[sides.names[0]], sides.seam)
    model, parameters = build_tables(body, region)
    work = build_work(model, parameters, 0)
    r = np.zeros_like(work.r)
    subtract_forces(x[region.nodes], model, parameters, work, r)
    near = np.ascontiguousarray(r.reshape(-1, 3)[model.order])[region.seam]
    run = PbdRun(scene, cells=sides.cells[sides.names[1]], seam=sides.seam)
    far = Energy(run).force(x[run.region.nodes])[run.region.seam]
    np.testing.assert_allclose(tie.gap(x[sides.seam], x[sides.seam]), 0.0, atol=1e-14)
    assert near.sum(axis=0)[2] == pytest.approx(-20e3 * 0.05 * 0.06 * 0.05, rel=1e-9)
    assert tie.p is not None
    np.testing.assert_allclose(far, -tie.p.T @ near, atol=1e-11 * np.abs(near).max())
