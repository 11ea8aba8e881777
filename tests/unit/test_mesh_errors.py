"""Every shape that cannot be simulated is refused with counts, a place and a remedy; what can be repaired is."""

from __future__ import annotations

import tempfile
from pathlib import Path

import meshio
import numpy as np
import pytest
from solids import box, join, obj, sphere

from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.interpolate import rest_points
from softseam_services.body.surface_check import enclosed_volume

CUBE, CUBE_TRIANGLES = box((0.04, 0.03, 0.02))


def read(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    return read_solid("a.obj", obj(vertices, triangles), 1.0, "z")


def refused(vertices: np.ndarray, triangles: np.ndarray, *words: str) -> None:
    with pytest.raises(MeshError) as caught:
        read(vertices, triangles)
    text = str(caught.value)
    assert text.startswith("a.obj: ")
    for word in words:
        assert word in text, text


def tets(points: np.ndarray, blocks: list[tuple[str, np.ndarray]], suffix: str) -> bytes:
    """A file with these cells, as meshio writes it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"m{suffix}"
        mesh = meshio.Mesh(points, blocks)
        if suffix == ".msh":
            meshio.write(file, mesh, file_format="gmsh22")
        else:
            meshio.write(file, mesh)
        return file.read_bytes()


# Kuhn's six tetrahedra of a box, corners numbered x fastest.
KUHN = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])


def test_open_edges() -> None:
    refused(CUBE, CUBE_TRIANGLES[1:], "3 open edges", "of 18", "close the holes")


def test_non_manifold_edges() -> None:
    wall = [[2, 3, 5], [2, 5, 4]]
    refused(CUBE, np.concatenate([CUBE_TRIANGLES, wall]), "4 non-manifold edges", "of 19", "remove inner walls")


def test_one_sided_surface() -> None:
    """Klein's bottle on a 6 x 5 grid of quads: closed, manifold, without an inside."""
    n, m = 6, 5

    def at(i: int, j: int) -> int:
        return (i % n) * m + (j if i < n else -j) % m

    quads = [(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)) for i in range(n) for j in range(m)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    refused(np.random.default_rng(0).uniform(size=(n * m, 3)), triangles, "one-sided")


@pytest.mark.kernels
def test_self_crossing() -> None:
    """Of three bodies the least may be a cavity, so that they are not united (see test_mesh_unions)."""
    one, two = box((0.04, 0.03, 0.02)), box((0.02, 0.01, 0.03), (0.01, 0.011, -0.005))
    either = box((0.002, 0.002, 0.002), (0.001, 0.001, 0.001))
    refused(*join(one, two, either), "crosses itself", "unite")
    # the same with faces in exact alignment: edges meet edges
    refused(*join(one, box((0.04, 0.03, 0.02), (0.02, 0.015, 0.01)), either), "crosses itself")


@pytest.mark.kernels
def test_touching_itself_is_no_crossing() -> None:
    """A finely meshed sphere and a box have no crossing."""
    read(*sphere(0.02, 4))
    read(CUBE, CUBE_TRIANGLES)


@pytest.mark.kernels
def test_pieces_and_cavities() -> None:
    apart = box((0.01, 0.01, 0.01), (0.1, 0, 0))
    refused(*join((CUBE, CUBE_TRIANGLES), apart), "disconnected", "2 separate bodies", "1e-06 m^3")
    # an island within a cavity is a second body
    cavity, island = box((0.02, 0.01, 0.01), (0.01, 0.01, 0.005)), box((0.005, 0.005, 0.005), (0.015, 0.012, 0.007))
    refused(*join((CUBE, CUBE_TRIANGLES), cavity, island), "2 separate bodies")
    vertices, triangles, notes = read(*join((CUBE, CUBE_TRIANGLES), cavity))
    assert enclosed_volume(vertices, triangles) == pytest.approx(0.04 * 0.03 * 0.02 - 2e-6, rel=1e-12)
    assert notes == ("1 shells were turned inside out: the outermost faces outward, one in it is a cavity",)


@pytest.mark.kernels
@pytest.mark.parametrize("seed", range(3))
def test_orientation_is_repaired(seed: int) -> None:
    turned = CUBE_TRIANGLES.copy()
    flip = np.random.default_rng(seed).random(12) < 0.4
    turned[flip] = turned[flip][:, [0, 2, 1]]
    vertices, triangles, notes = read(CUBE, turned)
    assert enclosed_volume(vertices, triangles) == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-12)
    assert any("turned" in note for note in notes)


@pytest.mark.kernels
def test_inside_out() -> None:
    vertices, triangles, notes = read(CUBE, CUBE_TRIANGLES[:, [0, 2, 1]])
    assert enclosed_volume(vertices, triangles) > 0
    assert notes


@pytest.mark.kernels
def test_sizes_of_the_wrong_unit() -> None:
    refused(1e5 * CUBE, CUBE_TRIANGLES, "4e+03 m long", "scale")
    refused(1e-3 * CUBE, CUBE_TRIANGLES, "4e-05 m long", "scale")
    assert np.ptp(read_solid("a.obj", obj(1e3 * CUBE, CUBE_TRIANGLES), 1e-3, "z")[0], axis=0) == pytest.approx(
        [0.04, 0.03, 0.02], rel=1e-12
    )


@pytest.mark.kernels
def test_no_volume() -> None:
    refused(CUBE * [1, 1, 0], CUBE_TRIANGLES, "in a plane", "give it a thickness")
    refused(CUBE * [1, 1, 1e-6], CUBE_TRIANGLES, "next to nothing")


@pytest.mark.kernels
@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_up_turns_without_mirroring(up: str) -> None:
    vertices, triangles, _ = read_solid("a.obj", obj(CUBE, CUBE_TRIANGLES), 1.0, up)
    assert enclosed_volume(vertices, triangles) > 0
    assert vertices[:, 2].max() == pytest.approx([0.04, 0.03, 0.02]["xyz".index(up)], rel=1e-14)
    np.testing.assert_allclose(vertices.min(axis=0)[:2] + vertices.max(axis=0)[:2], 0.0, atol=1e-16)
    assert vertices[:, 2].min() == 0.0


@pytest.mark.kernels
@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".msh"])
def test_tetrahedra_with_other_cells_and_stray_points(suffix: str) -> None:
    """As real exports: volume, faces, lines and vertices in one file, and points that nothing uses."""
    points = np.concatenate([[[9.0, 9.0, 9.0]], CUBE])
    blocks = [
        ("vertex", np.array([[0]])),
        ("line", np.array([[1, 2]])),
        ("triangle", CUBE_TRIANGLES[:2] + 1),
        ("tetra", KUHN + 1),
    ]
    vertices, triangles, notes = read_solid("m" + suffix, tets(points, blocks, suffix), 1.0, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-12)
    assert len(triangles) == 12
    assert "boundary of the tetrahedra" in notes[0]


@pytest.mark.kernels
@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj"])
def test_surface_files(suffix: str) -> None:
    vertices, triangles, _ = read_solid("m" + suffix, tets(CUBE, [("triangle", CUBE_TRIANGLES)], suffix), 1.0, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-6)  # STL is single
    assert len(vertices) == 8


@pytest.mark.kernels
def test_tetrahedra_numbered_in_either_sense_are_turned() -> None:
    for turned in ([0, 1, 2, 3, 4, 5], [2], [1, 4, 5]):
        some = KUHN.copy()
        some[turned] = some[turned][:, [0, 2, 1, 3]]
        vertices, triangles, notes = read_solid("m.vtk", tets(CUBE, [("tetra", some)], ".vtk"), 1.0, "z")
        assert enclosed_volume(vertices, triangles) == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-12)
        told = f"{len(turned)} of 6 tetrahedra were numbered in the other sense, and were turned"
        assert notes == ((told,) if len(turned) < 6 else ())


def test_tetrahedra_that_fold_over_are_refused() -> None:
    """A corner pulled through the opposite face: its tetrahedra have volume, but lie on one another."""
    inner = np.concatenate([CUBE, [[0.02, 0.015, 0.03]]])  # above the top, where it should be inside
    fan = np.array([[a, b, c, 8] for a, b, c in CUBE_TRIANGLES[:, [0, 2, 1]]])
    with pytest.raises(MeshError, match=r"m\.vtk: 4 pairs of cells lie on the same side .* remesh"):
        read_solid("m.vtk", tets(inner, [("tetra", fan)], ".vtk"), 1.0, "z")


@pytest.mark.kernels
def test_flat_and_doubled_tetrahedra_do_no_harm_to_the_surface() -> None:
    flat = np.concatenate([KUHN, [[0, 1, 3, 2]]])
    vertices, triangles, notes = read_solid("m.vtk", tets(CUBE, [("tetra", flat)], ".vtk"), 1.0, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-12)
    assert "1 of 7 tetrahedra are flat, and count for nothing" in notes
    twice = np.concatenate([KUHN, KUHN[:1, [1, 2, 0, 3]]])
    vertices, triangles, notes = read_solid("m.vtk", tets(CUBE, [("tetra", twice)], ".vtk"), 1.0, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-12)
    assert notes == ("1 tetrahedra that were there twice were left out",)


_FAN = b"v 0 0 0\nv 2 0 0\nv 3 2 0\nv 1 3 1\nv 0 2 0\nf 1 2 3 4 5\nf 4 3 2 1\n"


@pytest.mark.parametrize(
    ("path", "data", "words"),
    [
        ("a.vtk", b"", "empty"),
        ("a.vtk", b"# vtk DataFile Version 2.0\nnothing\nASCII\nDATASET", "cannot be read as .vtk"),
        ("a.stl", b"\x00" * 40, "no whole STL file"),
        ("a.xyz123", b"1 2 3", "cannot be read as .xyz123"),
        ("a", b"1 2 3", "cannot be read"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "a cloud of 3 points without faces"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 coordinates are not finite, the first of point 1"),
        (
            "a.obj",
            b"v 0 0 0\nv 1 0 0\nv 1 inf 0\nv 0 1 0\nf 1 2 3 4\n",
            "1 coordinates are not finite, the first of point 3",
        ),
        ("a.obj", _FAN.replace(b"1 3 1", b"nan 3 nan"), "2 coordinates are not finite, the first of point 4"),
    ],
)
def test_files_that_are_no_meshes(path: str, data: bytes, words: str, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(MeshError) as caught:
        read_solid(path, data, 1.0, "z")
    assert words in str(caught.value)
    assert str(caught.value).startswith(path)
    out, err = capfd.readouterr()
    assert out + err == ""


@pytest.mark.kernels
def test_hexahedra_are_embedded_by_their_boundary() -> None:
    hexahedron = np.array([[0, 1, 3, 2, 4, 5, 7, 6]])
    vertices, triangles, _ = read_solid("m.vtk", tets(CUBE, [("hexahedron", hexahedron)], ".vtk"), 1.0, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(0.04 * 0.03 * 0.02)


def scene(**shape: object) -> Scene:
    body = {
        "shape": {"kind": "mesh", "path": "a.obj", **shape},
        "position": [0.1, 0.2, 0.3],
        "cell": 0.01,
        "material": {"young": 2e4, "poisson": 0.3, "density": 1000},
    }
    return Scene.model_validate({"softseam": 1, "name": "mesh", "duration": 1.0, "body": body})


def built(**shape: object) -> Body:
    return build_body(scene(**shape), {"a.obj": obj(CUBE, CUBE_TRIANGLES)})


@pytest.mark.kernels
def test_missing_file_and_too_many_cells() -> None:
    with pytest.raises(MeshError, match=r"a\.obj: the file is missing"):
        build_body(scene(), {})
    with pytest.raises(MeshError, match="make `cell` larger"):
        built(scale=1000.0)


@pytest.mark.kernels
def test_a_box_as_mesh_is_the_block() -> None:
    body = built()
    points = rest_points(body)
    np.testing.assert_allclose(points.min(axis=0), [0.08, 0.185, 0.3], atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), [0.12, 0.215, 0.32], atol=1e-12)
    np.testing.assert_array_equal(body.fill, 1.0)
    spec = scene().body.model_dump() | {"shape": {"kind": "block", "size": (0.04, 0.03, 0.02)}}
    block = build_body(Scene.model_validate(scene().model_dump() | {"body": spec}), {})
    np.testing.assert_array_equal(body.cell_nodes, block.cell_nodes)
    np.testing.assert_allclose(body.x_rest, block.x_rest, atol=1e-15)
    np.testing.assert_allclose(body.cell_mass, block.cell_mass, rtol=1e-12)
    assert body.surface.area.sum() == pytest.approx(block.surface.area.sum(), rel=1e-12)


@pytest.mark.kernels
def test_fine_surfaces_carry_contact_on_a_subset_only() -> None:
    body = build_body(scene(), {"a.obj": obj(*sphere(0.02, 7))})
    carrying = body.surface.area > 0
    assert 20 < carrying.sum() < 0.2 * len(carrying)
    assert body.surface.area.sum() == pytest.approx(4 * np.pi * 0.02**2, rel=2e-3)


@pytest.mark.parametrize("turn", [0.3, 1.1, 2.7])
def test_places_are_told_without_rounding(turn: float) -> None:
    """A hole around the z axis is at z 0, however its coordinates were rounded."""
    around = turn + np.arange(8) * np.pi / 4
    rim = np.stack([np.cos(around), np.sin(around), 1e-17 * np.cos(3.0 * around)], axis=1)
    cone = np.concatenate([0.03 * rim, [[0.0, 0.0, 0.02]]])
    refused(cone, np.array([[k, (k + 1) % 8, 8] for k in range(8)]), "8 open edges", ", 0) m; close the holes")
