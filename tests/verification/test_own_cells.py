"""Hexahedra of a file as cells: masses, patch test, bending, contact, what viewers get; what is refused, and how."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fem_run import FemRun
from hexahedra import Floats, distorted, lattice, mesh, vtk

import softseam
from softseam_coupling.regions import CellGrid
from softseam_protocol.messages.header import Header
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.scene import Scene
from softseam_services.body.block import graded_line
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.check import check_body
from softseam_services.body.errors import MeshError
from softseam_services.body.interpolate import rest_points
from softseam_services.body.own_shapes import cell_lines, local_place, point_octants
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.recorder.begin import surface_mesh

HEADER = Header(1, "test", "near", 0, 0, 0, 0.0)
BEAM = (0.2, 0.05, 0.05)
CLAMP = [{"min": (-0.1001, -1, -1), "max": (-0.0999, 1, 1)}]
DOWN = (0.0, 0.0, -9.81)


def own(
    element: ElementKind = "hex27",
    integrator: str = "implicit_euler",
    poisson: float = 0.4,
    young: float = 100e3,
    **keys: Any,
) -> Scene:
    """A scene whose cells are the hexahedra of m.vtk; keys of the body, and of the scene."""
    body = {key: keys.pop(key) for key in ("fixed", "position", "cell") if key in keys}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "own",
            "duration": 1.0,
            "body": {
                "shape": {"kind": "mesh", "path": "m.vtk", "cells": "own"},
                "material": {"young": young, "poisson": 0.4, "density": 1000.0},
                **body,
            },
            "regions": {"default": "fem"},
            "models": {"fem": {"element": element, "integrator": integrator, "tolerance": 1e-8}},
            **keys,
        }
    )


def built(data: bytes, scene: Scene | None = None) -> Body:
    return build_body(own() if scene is None else scene, {"m.vtk": data})


def bent(points: Floats) -> Floats:
    """A bar of 0.2 m bent to a quarter of a circle in the x-z plane; curved where cells have middle nodes."""
    radius, angle = 0.2 / (0.5 * np.pi), points[:, 0] / 0.2 * 0.5 * np.pi
    r = radius + points[:, 2]
    return np.stack([r * np.sin(angle), points[:, 1], r * np.cos(angle)], axis=1)


@pytest.mark.parametrize("nodes", [8, 27])
def test_volume_mass_and_surface_of_a_distorted_block(nodes: int) -> None:
    body = built(mesh((4, 2, 2), BEAM, 0.05, nodes=nodes))
    check = check_body(body)
    assert check.mass == pytest.approx(1000.0 * 0.2 * 0.05 * 0.05, rel=1e-12)
    assert body.surface.area.sum() == pytest.approx(2 * (0.2 * 0.05 + 0.2 * 0.05 + 0.05 * 0.05), rel=1e-12)
    assert body.n_nodes == 9 * 5 * 5
    np.testing.assert_allclose(check.centre, [0.0, 0.0, 0.025], atol=1e-12 if nodes == 8 else 2e-6)
    assert (body.cell_mass > 0.0).all()
    number = body.surface.cell, ((body.surface.local + 1.0) @ [1, 3, 9]).astype(int)
    np.testing.assert_allclose(rest_points(body), body.x_rest[body.cell_nodes[number]], atol=1e-15)


@pytest.mark.parametrize(("nodes", "error"), [(8, 0.03), (27, 2e-3)])
def test_curved_cells_have_the_volume_of_a_ring(nodes: int, error: float) -> None:
    """A quarter ring of four cells: flat ones cut its corners, quadratic ones follow it."""
    volume = 0.05 * 0.25 * np.pi * ((0.4 / np.pi + 0.05) ** 2 - (0.4 / np.pi) ** 2)
    body = built(mesh((4, 1, 1), BEAM, bend=bent, nodes=nodes))
    assert body.cell_mass.sum() / 1000.0 == pytest.approx(volume, rel=error)


@pytest.mark.parametrize("element", ["hex27", "hex27_full", "hex8", "hex8_bbar", "tet10"])
@pytest.mark.parametrize("nodes", [8, 27])
def test_patch(element: ElementKind, nodes: int) -> None:
    """Nodes of the surface at x -> F x: inner ones follow, and the stress is the same everywhere."""
    data = mesh((3, 2, 2), BEAM, 0.05, nodes=nodes)
    every = [{"min": (-1, -1, -1), "max": (1, 1, 1)}]
    scene = own(element, "static", fixed=every, gravity=(0.0, 0.0, 0.0))
    body = built(data, scene)
    outer = np.zeros(body.n_nodes, dtype=np.bool_)
    outer[body.cell_nodes[body.surface.cell, ((body.surface.local + 1.0) @ [1, 3, 9]).astype(int)]] = True
    body = replace(body, fixed=outer)
    run = FemRun(scene, body=body)
    gradient = np.eye(3) + np.array([[0.05, 0.02, 0.0], [0.0, -0.04, 0.03], [0.01, 0.0, 0.02]])
    run.solver.state.x[:] = body.x_rest
    run.solver.state.x[outer] = body.x_rest[outer] @ gradient.T
    reply = run.step()
    assert reply.status == "converged"
    np.testing.assert_allclose(run.x, body.x_rest @ gradient.T, atol=1e-10)
    cauchy = run.solver.fields(HEADER).cauchy.reshape(-1, 6)
    assert np.ptp(cauchy, axis=0).max() < 1e-6 * np.abs(cauchy).max()


@pytest.mark.parametrize(("element", "within"), [("hex27", 0.01), ("hex27_full", 0.025), ("hex8_bbar", 0.025)])
def test_cantilever_on_distorted_cells(element: ElementKind, within: float) -> None:
    """Scene A at rest: tip at -85.75 mm by independent codes; 8 x 2 x 2 cells distorted by 6 % of the beam's size."""
    scene = own(element, "static", fixed=CLAMP, gravity=DOWN)
    body = built(mesh((8, 2, 2), BEAM, 0.06), scene)
    run = FemRun(scene, body=body)
    run.step(dt=1.0)
    tip = np.argmin(np.linalg.norm(body.x_rest - [0.1, 0.0, 0.025], axis=1))
    assert (run.x - body.x_rest)[tip, 2] == pytest.approx(-0.08575, rel=within)


@pytest.mark.parametrize(("model", "comes_to_rest"), [("fem", 0.4), ("pbd", 1.5)])
def test_it_stands_on_the_ground_with_its_weight(model: str, comes_to_rest: float) -> None:
    """Contact on the faces of distorted cells, through the product: force, no torque, and what a probe reads."""
    scene = own(
        young=20e3,
        tools={"ground": {"kind": "plane"}},
        step=0.01,
        duration=comes_to_rest,
        probes={"low": [0.01, 0.004, 0.003]},
        regions={"default": model},
    )
    data = mesh((2, 2, 2), (0.05, 0.05, 0.05), 0.05)
    simulation = Simulation(bundle_scene(scene, {"m.vtk": data}), EmbeddedTransport())
    while not simulation.done:
        report = simulation.step(fields=True)
    frame = simulation.frame()
    simulation.close()
    weight = 1000.0 * 0.05**3 * 9.81
    assert report.wrench[0, 2] == pytest.approx(-weight, rel=1e-3)
    assert report.penetration < 2e-5
    np.testing.assert_allclose(report.wrench[0, 3:5], 0.0, atol=1e-3 * weight * 0.05)
    assert frame.cell_energy.sum() == pytest.approx(report.parts["body.far"].strain, rel=1e-12)
    assert report.quantities["low.von_mises"] == pytest.approx(0.94 * weight / 0.05**2, rel=0.1)


def test_probes_find_their_place() -> None:
    body = built(mesh((4, 2, 2), BEAM, 0.05))
    for at in ([0.013, 0.004, 0.03], [-0.09, -0.02, 0.001], [0.1, 0.025, 0.05]):
        found = local_place(body, np.array(at))
        assert found is not None
        cell, t = found
        line = np.stack([0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)], axis=1)
        value = np.einsum("i,j,k->kji", *line).ravel()
        np.testing.assert_allclose(value @ body.x_rest[body.cell_nodes[cell]], at, atol=1e-12)
    assert local_place(body, np.array([0.2, 0.0, 0.0])) is None


def test_probes_find_their_place_in_long_cells() -> None:
    """Near the upper end of a long cell more than a dozen flat ones above it have their middles closer by."""

    def graded(points: Floats) -> Floats:
        heights = np.interp(points[:, 2], [0.0, 0.03, 0.06, 0.09, 0.12], [0.0, 0.09, 0.1, 0.11, 0.12])
        return np.column_stack([points[:, :2], heights])

    body = built(mesh((10, 10, 4), (0.05, 0.05, 0.12), bend=graded))
    at = np.array([0.0, 0.001, 0.088])
    found = local_place(body, at)
    assert found is not None
    cell, t = found
    x = body.x_rest[body.cell_nodes[cell]]
    np.testing.assert_allclose(x.mean(axis=0) + 0.5 * t * np.ptp(x, axis=0), at, atol=1e-12)
    middles = body.x_rest[body.cell_nodes[:, 13]]
    assert np.count_nonzero(np.linalg.norm(middles - at, axis=1) < np.linalg.norm(middles[cell] - at)) > 12


def test_viewers_get_octants_lines_and_volumes() -> None:
    body = built(mesh((2, 1, 1), (0.1, 0.05, 0.05), 0.04))
    surface = surface_mesh(HEADER, "body", body, {})
    assert surface.cell_volume.sum() == pytest.approx(0.1 * 0.05 * 0.05, rel=1e-12)
    assert len(cell_lines(body)) == 2 * (4 * 3 + 8)  # eight edges along, three rings of four, two halves each
    octants = point_octants(body)
    shared = np.abs(rest_points(body)[:, 0]) < 1e-9
    from_middle = np.abs(rest_points(body) - [0.0, 0.0, 0.025])
    corner = (np.abs(from_middle - [0.05, 0.025, 0.025]) < 1e-9).all(axis=1)
    assert corner.sum() == 8
    assert ((octants[corner] >= 0).sum(axis=1) == 1).all()
    assert ((octants[shared] >= 0).sum(axis=1) >= 2).all()


def swapped() -> tuple[Floats, np.ndarray]:
    points, cells = lattice((2, 2, 2), BEAM)
    cells[3, [0, 6]] = cells[3, [6, 0]]
    return points, cells


REFUSED: list[tuple[Callable[[], bytes], str]] = [
    (lambda: vtk(*swapped()), "1 of 8 hexahedra are inverted.*number 3"),
    (lambda: vtk(*doubled()), "faces belong to three or more"),
    (lambda: vtk(lattice((1, 1, 1), BEAM)[0] * [1, 1, 0], lattice((1, 1, 1), BEAM)[1]), "inverted or degenerate"),
    (lambda: vtk(*far_middle()), "middle nodes far from where they belong, the first is number 0"),
]


def doubled() -> tuple[Floats, np.ndarray]:
    points, cells = lattice((2, 1, 1), BEAM)
    return points, np.concatenate([cells, cells[:1]])


def far_middle() -> tuple[Floats, np.ndarray]:
    points, cells = lattice((1, 1, 1), BEAM, 27)
    points[13] = points[4]
    return points, cells


@pytest.mark.parametrize(("data", "message"), REFUSED)
def test_what_cannot_be_cells_is_refused_by_number(data: Callable[[], bytes], message: str) -> None:
    with pytest.raises(MeshError, match=message):
        built(data())


def test_mirrored_cells_are_put_in_order_and_poor_ones_are_told() -> None:
    points, cells = lattice((2, 2, 2), BEAM)
    mirrored = built(vtk(points, cells[:, [1, 0, 3, 2, 5, 4, 7, 6]]))
    assert "mirrored" in mirrored.notes[0]
    assert mirrored.cell_mass.sum() == pytest.approx(0.5, rel=1e-12)
    poor = points.copy()
    poor[np.argmin(np.linalg.norm(points - [0.0, 0.0, 0.025], axis=1))] += [0.033, 0.0075, 0.0075]
    assert "badly distorted, the worst is number" in built(vtk(poor, cells)).notes[0]


def test_tetrahedra_are_refused_with_what_to_do() -> None:
    tetrahedron = b"""# vtk DataFile Version 3.0
one
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 4 double
0 0 0 0.1 0 0 0 0.1 0 0 0 0.1
CELLS 1 5
4 0 1 2 3
CELL_TYPES 1
10
"""
    with pytest.raises(MeshError, match=r"1 tetra, but `cells: own` takes hexahedra.*say `cells: tetrahedra`"):
        built(tetrahedron)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"regions": {"default": "pbd", "near": {"boxes": [CLAMP[0]]}}}, "one model.*leave out regions.near"),
        ({"regions": {"default": "fem", "near": {"boxes": [CLAMP[0]]}}}, "one model.*leave out regions.near"),
        ({"regions": {"default": "pbd"}, "quantities": ["model_error"]}, "boxes of one size: leave out this quantity"),
    ],
)
def test_what_own_cells_cannot_have_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        own(**change)


def test_a_cell_edge_beside_own_cells_is_refused() -> None:
    with pytest.raises(ValueError, match="leave out `cell`"):
        own(cell=0.01)


def test_distorted_points_stay_on_their_faces() -> None:
    """Of the tests' own meshes: what is on a face of the block stays there."""
    points, _ = lattice((4, 2, 2), BEAM)
    moved = distorted(points, BEAM, 0.06)
    np.testing.assert_allclose(np.ptp(moved, axis=0), BEAM, rtol=1e-12)
    assert np.abs(moved - points).max() > 0.003


def graded(grading: float, cells: int = 4) -> Scene:
    shape = {"kind": "block", "size": (0.02, 0.04, 0.08), "grading": grading}
    material = {"young": 20e3, "poisson": 0.45, "density": 1050.0}
    cell = (0.02 / cells, 0.04 / cells, 0.08 / cells)
    body = {"shape": shape, "cell": cell, "material": material, "position": (0.01, 0.0, 0.1)}
    return Scene.model_validate(
        {"softseam": 1, "name": "graded", "duration": 1.0, "body": body, "regions": {"default": "fem"}}
    )


def test_graded_cells_are_thin_at_the_faces() -> None:
    body = build_body(graded(5.0), {})
    corners = body.x_rest[body.cell_nodes[:, [0, 26]]]
    widths = np.unique(np.round(corners[:, 1] - corners[:, 0], 9), axis=0)
    np.testing.assert_allclose(np.unique(widths[:, 0]) / 0.02, [1 / 12, 5 / 12], rtol=1e-6)
    np.testing.assert_allclose(np.unique(widths[:, 2]) / 0.08, [1 / 12, 5 / 12], rtol=1e-6)
    assert body.cell_mass.sum() == pytest.approx(1050.0 * 0.02 * 0.04 * 0.08)
    mass = np.zeros(len(body.x_rest))
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    np.testing.assert_allclose(mass @ body.x_rest / mass.sum(), [0.01, 0.0, 0.14], atol=1e-12)


@pytest.mark.parametrize(("count", "widths"), [(1, [1.0]), (2, [1.0, 1.0]), (3, [1.0, 9.0, 1.0]), (5, [1, 3, 9, 3, 1])])
def test_a_graded_line_is_symmetric_and_grows_by_one_factor(count: int, widths: list[float]) -> None:
    found = np.diff(graded_line(count, 9.0))
    np.testing.assert_allclose(found, np.array(widths) / sum(widths), rtol=1e-12)


def test_the_model_error_of_graded_cells_is_refused() -> None:
    scene = graded(5.0).model_dump()
    Scene.model_validate({**scene, "regions": {"default": "pbd", "near": {"model": "fem", "within": 0.01}}})
    with pytest.raises(ValueError, match=r"boxes of one size: leave out regions.near.error, or body.shape.grading"):
        Scene.model_validate({**scene, "regions": {"default": "pbd", "near": {"model": "fem", "error": 0.1}}})


def test_graded_regions_know_their_neighbours() -> None:
    """A seam runs along the faces that cells share: a graded block's cells are numbered as a lattice."""
    body = build_body(graded(5.0), {})
    neighbours = CellGrid.build(body.cell_grid).neighbours
    for face, (mine, other) in enumerate(((12, 14), (14, 12), (10, 16), (16, 10), (4, 22), (22, 4))):
        cells = np.flatnonzero(neighbours[:, face] >= 0)
        assert len(cells) == 48
        beside = neighbours[cells, face]
        np.testing.assert_array_equal(body.cell_nodes[cells, mine], body.cell_nodes[beside, other])


@pytest.mark.slow
@pytest.mark.parametrize(("near", "most"), [("", 0.031), (", near: {model: fem, within: 0.012, split: always}", 0.016)])
def test_grading_helps_pbd_and_a_hybrid_as_it_helps_fem(near: str, most: float) -> None:
    """The grip of tofu_grasp on 27 cells graded by 4; equal ones are off by 5.0 % and, as a hybrid, by 2.2 %."""
    settings = (f"regions={{default: pbd{near}}}", "body.cell=0.0167", "body.shape.grading=4")
    with softseam.open("tofu_grasp", settings=settings) as simulation:
        report = simulation.run()
    assert abs(float(report.quantities["grip_force"]) / 10.178 - 1.0) < most
    said = report.error_estimate  # PBD's own error is known of boxes of one size alone
    assert said is not None and ("for pbd are boxes" in said.text) == (not near)


def test_grading_takes_half_the_error_of_a_grip() -> None:
    """Limit 10.178 +- 0.047 N (docs/results/verification.md): 27 equal cells are off by 2.4 %, graded ones by 1.2 %."""
    off = {}
    for grading in (1.0, 4.0):
        settings = ("step=0.04", "regions={default: fem}", "body.cell=0.0167", f"body.shape.grading={grading}")
        with softseam.open("tofu_grasp", settings=settings) as simulation:
            report = simulation.run()
        off[grading] = float(report.quantities["grip_force"]) / 10.178 - 1.0
    assert 0.0 < off[4.0] < 0.6 * off[1.0] < 0.016
