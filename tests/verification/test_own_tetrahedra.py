"""Tetrahedra of a file as FEM's cells: masses, surface, contact, what viewers and probes get; what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fem_run import tofu
from hexahedra import mesh
from tet_bar import bar, vtk
from tetrahedra import EDGES, shaken, ten_nodes, tetrahedral, with_middles

import softseam
from softseam.recording import Recording
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import SceneError, bundle_scene, parse_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Floats
from softseam_services.body.build import build_body
from softseam_services.body.check import check_body
from softseam_services.body.errors import MeshError
from softseam_services.body.interpolate import point_weights, rest_points
from softseam_services.body.own_shapes import cell_lines, local_place, point_octants
from softseam_services.body.region import build_region
from softseam_services.body.tetrahedron import NODES, barycentric_of, shape_functions
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.quantities import RestingBody
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.recorder.begin import surface_mesh
from softseam_services.server import build_setup

SIZE = (0.05, 0.05, 0.05)
VOLUME = 0.05**3


def built(data: bytes, **keys: Any) -> Body:
    return build_body(tetrahedral(**keys), {"m.vtk": data})


def bent(points: Floats) -> Floats:
    """A bar of 0.2 m bent to a quarter of a circle in the x-z plane."""
    radius, angle = 0.2 / (0.5 * np.pi), points[:, 0] / 0.2 * 0.5 * np.pi
    r = radius + points[:, 2]
    return np.stack([r * np.sin(angle), points[:, 1], r * np.cos(angle)], axis=1)


def test_volume_mass_and_surface_of_an_irregular_block() -> None:
    body = built(vtk(*shaken((3, 2, 2), SIZE)))
    check = check_body(body)
    assert check.mass == pytest.approx(1000.0 * VOLUME, rel=1e-12)
    assert check.volume == pytest.approx(VOLUME, rel=1e-12)
    np.testing.assert_allclose(check.centre, [0.0, 0.0, 0.025], atol=1e-12)
    assert (body.cell_mass[:, NODES] > 0.0).all() and np.count_nonzero(body.cell_mass) == 10 * body.n_cells
    assert body.surface.area.sum() == pytest.approx(6.0 * 0.05**2, rel=1e-12)
    assert body.n_cells == 72 and body.n_nodes == 7 * 5 * 5
    points = rest_points(body)
    np.testing.assert_allclose(np.abs(points - [0.0, 0.0, 0.025]).max(axis=1), 0.025, atol=1e-12)
    assert len(np.unique(np.round(points, 9), axis=0)) == len(points)
    assert np.all(np.diff(body.surface.cell) >= 0)


def test_points_follow_the_functions_of_the_element_and_octants_have_their_shares() -> None:
    """Linear functions are never negative, quadratic ones are; both put points where they are at rest."""
    body = built(vtk(*shaken((2, 2, 2), SIZE)))
    region = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
    least = {}
    for functions in ("tet4", "tet10"):
        start, node, weight = point_weights(body, region, functions)
        found = np.add.reduceat(weight[:, None] * body.x_rest[node], start[:-1], axis=0)
        np.testing.assert_allclose(found, rest_points(body), atol=1e-15)
        least[functions] = weight.min()
    assert least["tet4"] == 0.5 and least["tet10"] == -0.125
    volume = RestingBody(body).octant_volume
    np.testing.assert_allclose(volume[0] / volume[0].sum(), [1 / 8, 3 / 8, 0, 3 / 8, 0, 0, 0, 1 / 8], atol=1e-14)
    assert volume.sum() == pytest.approx(VOLUME, rel=1e-12)


@pytest.mark.parametrize("order", EDGES)
def test_middle_nodes_are_taken_in_any_order(order: str) -> None:
    """A file of ten nodes, in VTK's and in Gmsh's order, gives the cells that one of four gives, to the bit."""
    mesh = shaken((2, 2, 2), SIZE)
    four, ten = built(vtk(*mesh)), built(ten_nodes(*with_middles(*mesh, order=order)))
    np.testing.assert_array_equal(four.cell_nodes, ten.cell_nodes)
    np.testing.assert_allclose(four.x_rest, ten.x_rest, atol=1e-15)


def test_curved_tetrahedra_follow_a_ring() -> None:
    """A quarter ring of 4 x 1 x 1 cubes of six: with curved edges its volume is 50 times as exact."""
    volume = 0.05 * 0.25 * np.pi * ((0.4 / np.pi + 0.025) ** 2 - (0.4 / np.pi - 0.025) ** 2)
    points, cells = bar((4, 1, 1), (0.2, 0.05, 0.05))
    straight = built(vtk(bent(points), cells)).total_mass / 1000.0 / volume - 1.0
    curved = built(ten_nodes(*with_middles(points, cells, bent))).total_mass / 1000.0 / volume - 1.0
    assert straight < -0.02
    assert abs(curved) < 4e-4


def test_probes_find_their_place() -> None:
    points, cells = bar((4, 1, 1), (0.2, 0.05, 0.05))
    body = built(ten_nodes(*with_middles(points, cells, bent)))
    inside = body.x_rest[body.cell_nodes[7, NODES]].mean(axis=0)
    found = local_place(body, inside)
    assert found is not None
    value = shape_functions(barycentric_of(found[1][None]))[0][0]
    np.testing.assert_allclose(value @ body.x_rest[body.cell_nodes[found[0], NODES]], inside, atol=1e-12)
    assert local_place(body, np.array([0.2, 0.0, 0.5])) is None


def test_viewers_get_octants_lines_and_volumes() -> None:
    body = built(vtk(*bar((1, 1, 1), SIZE)))
    surface = surface_mesh(Header(1, "test", "near", 0, 0, 0, 0.0), "body", body, {})
    assert surface.cell_volume.sum() == pytest.approx(VOLUME, rel=1e-12)
    np.testing.assert_allclose(surface.cell_center.mean(axis=0), [0.0, 0.0, 0.025], atol=1e-12)
    assert len(cell_lines(body)) == 4 * (12 + 6)  # the cube's edges, and a diagonal of each face
    octants = point_octants(body)
    assert (octants[:, 0] >= 0).all()
    assert set(np.unique(octants[octants >= 0] % 8)) == {0, 1, 3, 7}


def simulated(scene: Scene, files: dict[str, bytes]) -> Any:
    simulation = Simulation(bundle_scene(scene, files), EmbeddedTransport())
    while not simulation.done:
        report = simulation.step(fields=True)
    simulation.close()
    return report


@pytest.mark.parametrize("element", ["tet10", "tet4_fbar"])
def test_it_stands_on_the_ground_with_its_weight(element: str) -> None:
    """Force, no torque, and what probes read: rho g h, and rho g L^2/2E; the latter at a corner of cells, where lumped
    masses weigh more than quadratic functions have them (8 % on so coarse a mesh), and the contact yields."""
    scene = tetrahedral(
        element,
        young=20e3,
        poisson=0.3,
        tools={"ground": {"kind": "plane", "friction": 0.0}},
        gravity=[0.0, 0.0, -9.81],
        duration=0.5,
        probes={"low": [0.004, 0.003, 0.012], "top": [0.0, 0.0, 0.05]},
    )
    report = simulated(scene, {"m.vtk": vtk(*shaken((2, 2, 2), SIZE))})
    weight = 1000.0 * VOLUME * 9.81
    assert report.wrench[0, 2] == pytest.approx(-weight, rel=1e-3)
    np.testing.assert_allclose(report.wrench[0, 3:5], 0.0, atol=1e-3 * weight * 0.05)
    assert report.quantities["low.von_mises"] == pytest.approx(1000.0 * 9.81 * 0.038, rel=0.06)
    assert report.quantities["low.displacement"] == pytest.approx(0.4905 * (0.05 - 0.006) * 0.012, rel=0.2)
    assert report.quantities["top.displacement"] == pytest.approx(0.5 * 1000.0 * 9.81 * 0.05**2 / 20e3, rel=0.14)


@pytest.mark.parametrize("element", ["hex27", "tet10", "tet4_fbar"])
def test_a_squeeze_is_as_firm_as_of_hexahedra(element: str) -> None:
    """A cube of tofu by 10 % between plates: 8.35 N by hexahedra of 12.5 mm; of tetrahedra the contact yields."""
    said = tofu(cell=0.025, step=0.01).model_dump(exclude_unset=True)
    said["motion"] = [{"tools": ["left", "right"], "close": 0.03, "until": {"compression": 0.1}}, {"hold": 0.05}]
    said |= {"quantities": ["grip_force"], "models": {"fem": {"element": element}}}
    if element != "hex27":
        said["body"] |= {"shape": {"kind": "mesh", "path": "m.vtk", "cells": "tetrahedra"}, "cell": None}
    report = simulated(Scene.model_validate(said), {"m.vtk": vtk(*bar((2, 2, 2), SIZE))} if element != "hex27" else {})
    assert report.quantities["grip_force"] == pytest.approx(8.35, rel=0.05)


def test_a_scene_is_simulated_recorded_and_goes_on_from_a_snapshot(tmp_path: Path) -> None:
    """Through the client, of a block that falls: the recording holds it, and the same bits follow from a snapshot."""
    (tmp_path / "m.vtk").write_bytes(vtk(*bar((1, 1, 1), SIZE)))
    text = "softseam: 1\nname: t\nduration: 0.05\nstep: 0.01\nbody:\n  velocity: [0, 0, 0.1]\n"
    text += "  shape: {kind: mesh, path: m.vtk, cells: tetrahedra}\n"
    text += "  material: {young: 2.0e+4, poisson: 0.4, density: 1000}\n"
    (tmp_path / "t.yaml").write_text(text)
    with softseam.open(tmp_path / "t.yaml", record=tmp_path / "t.mcap") as session:
        session.reset()
        session.run(max_steps=2)
        kept = session.snapshot()
        last = session.run(fields=True)
        session.restore(kept)
        again = session.run(fields=True)
    np.testing.assert_array_equal(again.surface, last.surface)
    rise = 0.1 * 0.05 - 0.5 * 9.81 * 0.05 * 0.06
    np.testing.assert_allclose(last.surface[:, 2].max() - 0.05, rise, atol=1e-9)
    frames = list(Recording(tmp_path / "t.mcap").frames())
    assert len(frames) > 2 and frames[-1].cauchy.shape == (6, 8, 6)


def test_one_body_of_hexahedra_and_one_of_tetrahedra() -> None:
    """Where no element is named each has its own; a named one of tetrahedra is both bodies'."""
    one = tetrahedral().model_dump(by_alias=True, exclude_unset=True)
    block = {"shape": {"kind": "block", "size": SIZE}, "material": one["body"]["material"], "position": (0.2, 0.0, 0.0)}
    many = {key: value for key, value in one.items() if key != "body"} | {"bodies": {"a": one["body"], "b": block}}
    scene = Scene.model_validate(many)
    assert [scene.of(name).models.fem.element for name in ("a", "b")] == ["tet10", "hex27"]
    named = Scene.model_validate(many | {"models": {"fem": {"element": "tet4_fbar"}}})
    assert {named.of(name).models.fem.element for name in ("a", "b")} == {"tet4_fbar"}
    setup = build_setup(Bundle(bundle_scene(tetrahedral(), {}).scene, {"m.vtk": vtk(*bar((1, 1, 1), SIZE))}))
    assert setup.scene.regions.default == "fem" and "only fem takes tetrahedra" in setup.why


def test_materials_are_those_in_the_middles_of_cells() -> None:
    hard = {"shape": {"kind": "box", "size": [1, 1, 0.05], "position": [0, 0, 0.05]}, "material": {"young": 9e5}}
    body = built(vtk(*bar((1, 1, 2), SIZE)), inclusions=[hard])
    upper = body.x_rest[body.cell_nodes[:, NODES[:4]]].mean(axis=1)[:, 2] > 0.025
    np.testing.assert_array_equal(body.octant_material, np.repeat(upper[:, None], 8, axis=1))


def inverted() -> bytes:
    points, cells = bar((1, 1, 1), SIZE)
    cells[3, [0, 1]] = cells[3, [1, 0]]
    return vtk(points, cells)


def curled() -> bytes:
    """A regular one, two of whose edges are drawn to its middle."""
    corners = 0.02 * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    points, cells = with_middles(corners, np.array([[0, 1, 2, 3]]))
    points[cells[0, [4, 6]]] *= 0.1
    points[cells[0, 4]] += 1e-4
    return ten_nodes(points, cells)


def far_middle() -> bytes:
    points, cells = with_middles(*bar((1, 1, 1), SIZE))
    points[cells[0, 4]] = points[cells[0, 5]] + 1e-6
    return ten_nodes(points, cells)


def torn() -> bytes:
    """One cell of ten nodes whose middle node a straight neighbour of four does not know."""
    points, cells = with_middles(*bar((1, 1, 1), SIZE))
    moved = points[cells[0, 7]] + 0.002
    cells[0, 7] = len(points)
    return ten_nodes(np.concatenate([points, moved[None]]), cells)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (inverted, "1 of 6 tetrahedra are inverted, the worst is number 3"),
        (lambda: vtk(bar((1, 1, 1), SIZE)[0] * [1.0, 1.0, 0.0], bar((1, 1, 1), SIZE)[1]), "degenerate"),
        (curled, "curved so far that they are turned over in part.*remesh"),
        (far_middle, "middle nodes far from where they belong.*export tetrahedra of 4 nodes"),
        (torn, "curved otherwise than a neighbour.*let neighbours share"),
        (lambda: mesh((1, 1, 1), SIZE), "has 1 hexahedron, but cells: tetrahedra takes tetrahedra; mesh the solid"),
    ],
)
def test_what_cannot_be_cells_is_refused_by_number(data: Any, message: str) -> None:
    with pytest.raises(MeshError, match=message):
        built(data())


def test_mirrored_ones_are_turned_and_slivers_told() -> None:
    points, cells = bar((1, 1, 1), SIZE)
    mirrored = built(vtk(points, cells[:, [1, 0, 2, 3]]))
    assert "mirrored" in mirrored.notes[0]
    assert mirrored.total_mass == pytest.approx(1000.0 * VOLUME, rel=1e-12)
    flat = built(vtk(points * [1.0, 1.0, 0.01], cells))
    assert "6 of 6 tetrahedra are slivers, the worst is number" in flat.notes[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("body.cell=0.01", "the file's tetrahedra are the cells: leave out `cell`"),
        ("regions={default: pbd}", "pbd moves a file's tetrahedra as particles .body: .kind: tet_mesh"),
        ("regions={default: fem, near: {within: 0.01}}", "have one model, fem: leave out regions.near"),
        ("models.fem.element=hex8", "hex8 is made of hexahedra.*use tet10, tet4_fbar or tet4"),
        ("symmetry=[x]", "not each other's images: leave it out"),
        ("regions={goal: grip_force}", "boxes of one size"),
    ],
)
def test_what_tetrahedra_cannot_have_is_refused(change: str, message: str, tmp_path: Path) -> None:
    key, value = change.split("=")
    lines = ["softseam: 1", "name: t", "duration: 1.0", "body:"]
    lines += ["  shape: {kind: mesh, path: m.vtk, cells: tetrahedra}"]
    lines += ["  material: {young: 2.0e+4, poisson: 0.4, density: 1000}"]
    if key.startswith("body."):
        lines.append(f"  {key.removeprefix('body.')}: {value}")
    elif key.startswith("models."):
        lines.append("models: {fem: {element: " + value + "}}")
    else:
        lines.append(f"{key}: {value}")
    with pytest.raises(SceneError, match=message) as refused:
        parse_scene("\n".join(lines) + "\n", "t.yaml")
    assert "t.yaml:" in str(refused.value)
