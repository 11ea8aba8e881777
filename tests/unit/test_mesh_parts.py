"""Several solids in one file: which there are, and how one is taken."""

from __future__ import annotations

import tempfile
from pathlib import Path

import meshio
import numpy as np
import pytest
from solids import box, join, obj, sphere

from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.interpolate import rest_points
from softseam_services.body.mesh_io import read_hexahedra, read_tetrahedra
from softseam_services.body.surface_check import enclosed_volume
from softseam_services.shapes.mesh import tool_mesh

LARGE, SMALL, BALL = box((0.04, 0.03, 0.02)), box((0.01, 0.02, 0.01), (0.1, 0.0, 0.0)), sphere(0.008, 2)
VOLUMES = {"large": 2.4e-5, "small": 2e-6, "ball": enclosed_volume(BALL[0], BALL[1].astype(np.int32))}
BALL = (BALL[0] + [0.0, 0.1, 0.0], BALL[1])
KUHN = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])
HEXAHEDRON = np.array([0, 1, 3, 2, 4, 5, 7, 6])


def named_obj(word: str) -> bytes:
    """Three solids as objects or as groups."""
    parts, before = [], 0
    for name, (points, triangles) in (("small", SMALL), ("large", LARGE), ("ball", BALL)):
        text = obj(points, triangles + before).decode()
        parts.append(f"{word} {name}\n{text}")
        before += len(points)
    return "".join(parts).encode()


def named_stl(end: str) -> bytes:
    lines = []
    for name, (points, triangles) in (("small", SMALL), ("large", LARGE), ("ball", BALL)):
        lines.append(f"solid {name}")
        for triangle in triangles:
            corners = [f"vertex {x!r} {y!r} {z!r}" for x, y, z in points[triangle].tolist()]
            lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
        lines.append(f"endsolid {name}")
    return end.join(lines).encode()


def named_gmsh() -> bytes:
    """Two boxes of tetrahedra in physical groups, as text of Gmsh 2."""
    points, _ = join(SMALL, LARGE)
    rows = [f"{n} {x!r} {y!r} {z!r}" for n, (x, y, z) in enumerate(points.tolist(), 1)]
    tets = [(2, tet + 1) for tet in KUHN] + [(5, tet + 9) for tet in KUHN]
    cells = [f"{n} 4 2 {group} 1 {' '.join(map(str, tet))}" for n, (group, tet) in enumerate(tets, 1)]
    names = ["2", '3 2 "small"', '3 5 "large"']
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", *names, "$EndPhysicalNames"]
    lines += ["$Nodes", "16", *rows, "$EndNodes", "$Elements", "12", *cells, "$EndElements"]
    return "\n".join(lines).encode()


FILES = {
    "objects": ("a.obj", named_obj("o")),
    "groups": ("a.obj", named_obj("g")),
    "solids": ("a.stl", named_stl("\n")),
    "solids, lines of Windows": ("a.stl", named_stl("\r\n")),
    "physical groups": ("a.msh", named_gmsh()),
}


@pytest.mark.kernels
@pytest.mark.parametrize(("name", "data"), FILES.values(), ids=FILES.keys())
def test_one_is_taken_by_name_or_by_number(name: str, data: bytes) -> None:
    names = ["large", "small"] if name == "a.msh" else ["large", "ball", "small"]
    names.sort(key=lambda each: -VOLUMES[each])
    for number, called in enumerate(names, 1):
        for part in (called, number):
            vertices, triangles, _ = read_solid(name, data, 1.0, "z", part)
            assert enclosed_volume(vertices, triangles) == pytest.approx(VOLUMES[called], rel=1e-6), part
            assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(MeshError, match=f"{len(names)} separate bodies") as caught:
        read_solid(name, data, 1.0, "z")
    assert "`part: 1` takes the largest closed body alone (by size 1: 24 cm^3 (large), 2: " in str(caught.value)
    for part, words in (("lid", "no part called 'lid'; it has small, large"), (4, "has no body 4")):
        with pytest.raises(MeshError, match=words):
            read_solid(name, data, 1.0, "z", part)


@pytest.mark.kernels
def test_what_is_left_out_is_said() -> None:
    open_box = (SMALL[0] + [0.0, 0.2, 0.0], SMALL[1][2:])
    data = obj(*join(LARGE, SMALL, open_box))
    with pytest.raises(MeshError, match=r"open edges.*`part: 1` takes the largest .*1: 24 cm\^3, 2: 2 cm\^3\)"):
        read_solid("a.obj", data, 1.0, "z")
    assert read_solid("a.obj", data, 1.0, "z", 1)[2] == ("1 other bodies and 1 open pieces of the file were left out",)
    assert read_solid("a.obj", obj(*LARGE), 1.0, "z", 1)[2] == ()


@pytest.mark.kernels
@pytest.mark.parametrize("size", [1e-4, 3e-5, 1e-6])
def test_dust_is_left_out(size: float) -> None:
    dust = box((size, size, size), (0.1, 0.0, 0.0))
    vertices, triangles, notes = read_solid("a.obj", obj(*join(LARGE, dust, SMALL)), 1.0, "z", 1)
    assert len(vertices) == 8 and notes == ("2 other bodies of the file were left out",)
    vertices, triangles, notes = read_solid("a.obj", obj(*join(LARGE, dust)), 1.0, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(2.4e-5, rel=1e-12)
    assert notes == ("1 bodies of less than a millionth of the volume were left out",)


@pytest.mark.kernels
def test_a_body_keeps_its_cavities() -> None:
    cavity = box((0.02, 0.01, 0.01), (0.01, 0.01, 0.005))
    data = obj(*join(SMALL, LARGE, cavity))
    vertices, triangles, _ = read_solid("a.obj", data, 1.0, "z", 1)
    assert enclosed_volume(vertices, triangles) == pytest.approx(2.4e-5 - 2e-6, rel=1e-12)


@pytest.mark.kernels
def test_bodies_that_cross_are_told_apart() -> None:
    """Whether all are united, or, with another that may be a cavity, none."""
    crossing = join(LARGE, box((0.02, 0.01, 0.03), (0.01, 0.011, -0.005)))
    data = obj(*join(crossing, box((0.002, 0.002, 0.002), (0.001, 0.001, 0.001))))
    with pytest.raises(MeshError, match=r"crosses itself.*unite.*`part: 1` takes the largest closed body alone"):
        read_solid("a.obj", data, 1.0, "z")
    data = obj(*crossing)
    vertices, triangles, _ = read_solid("a.obj", data, 1.0, "z", 1)
    assert enclosed_volume(vertices, triangles) == pytest.approx(2.4e-5, rel=1e-12)


@pytest.mark.parametrize("scale", [1.0, 0.5, 7.0])
def test_cells_that_are_taken_as_they_are(scale: float) -> None:
    points, _ = join(SMALL, LARGE)
    blocks = [("hexahedron", np.array([HEXAHEDRON, HEXAHEDRON + 8]))]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "a.vtu"
        meshio.write(file, meshio.Mesh(scale * points, blocks))
        data = file.read_bytes()
    found = read_hexahedra("a.vtu", data, 2)
    assert len(found.cells[0]) == 1
    assert np.ptp(found.points[found.cells[0][0]], axis=0) == pytest.approx(scale * np.array([0.01, 0.02, 0.01]))
    assert len(read_hexahedra("a.vtu", data).cells[0]) == 2
    for part in ("large", 1):
        tets = read_tetrahedra("a.msh", named_gmsh(), part)
        assert np.ptp(tets.points, axis=0) == pytest.approx([0.04, 0.03, 0.02]) and len(tets.cells) == 6


def scene(part: object) -> Scene:
    shape = {"kind": "mesh", "path": "a.obj", "part": part}
    body = {"shape": shape, "cell": 0.01, "material": {"young": 2e4, "poisson": 0.3, "density": 1000}}
    tool = {"kind": "mesh", "path": "a.obj", "part": part, "position": [0, 0, 1]}
    return Scene.model_validate(
        {"softseam": 1, "name": "parts", "duration": 1.0, "body": body, "tools": {"finger": tool}}
    )


@pytest.mark.kernels
def test_in_a_scene() -> None:
    files = {"a.obj": named_obj("o")}
    for part, size in (("small", [0.01, 0.02, 0.01]), (1, [0.04, 0.03, 0.02])):
        body = build_body(scene(part), files)
        assert np.ptp(rest_points(body), axis=0) == pytest.approx(size)
        tool = scene(part).tools["finger"]
        mesh = tool_mesh("a.obj", files["a.obj"], 1.0, "z", tool.part)  # type: ignore[union-attr]
        assert np.ptp(mesh.vertices, axis=0) == pytest.approx(size)
    for wrong in (0, True, 1.5, ""):
        with pytest.raises(ValueError, match="part"):
            scene(wrong)
    assert '"part":' not in scene(None).model_dump_json(), "scenes without it keep their hash"


@pytest.mark.kernels
def test_notes_name_their_file() -> None:
    points, triangles = LARGE
    data = obj(points, np.concatenate([triangles, triangles[:1]]))
    body = build_body(scene(None), {"a.obj": data})
    assert body.notes[0] == "a.obj: 1 triangles that were there twice were left out"
