"""Files as modellers write them: the same cube in every way of saying it, and what is wrong with its line."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import meshio
import numpy as np
import pytest

from softseam_services.body.errors import MeshError
from softseam_services.body.formats.polygons import triangulate
from softseam_services.body.formats.reading import read_mesh_file
from softseam_services.body.mesh_io import read_surface
from softseam_services.body.surface_check import enclosed_volume

SCENES = Path(__file__).parents[2] / "scenes"
CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
QUADS = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
TRIANGLES = [half for a, b, c, d in QUADS for half in ((a, b, c), (a, c, d))]
V = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)


def faces(write: str) -> str:
    """Lines of the quads, each corner written as `write` says of its number n from 1, and k back from the last."""
    return "".join("f " + " ".join(write.format(n=n, k=n - 9) for n in quad) + "\n" for quad in QUADS)


def polydata(cells: Sequence[tuple[int, ...]], word: str, *, binary: bool = False, new: bool = False) -> bytes:
    """A legacy VTK file."""
    flat = [corner - 1 for cell in cells for corner in cell]
    lists = [entry for cell in cells for entry in (len(cell), *(corner - 1 for corner in cell))]
    offsets = np.cumsum([0, *map(len, cells)]).tolist()

    def block(numbers: list[int] | list[float], code: str) -> bytes:
        if binary:
            return struct.pack(f">{len(numbers)}{code}", *numbers) + b"\n"
        return " ".join(map(str, numbers)).encode() + b"\n"

    version = "5.1" if new else "3.0"
    head = (
        f"# vtk DataFile Version {version}\ncube\n{'BINARY' if binary else 'ASCII'}\nDATASET POLYDATA\nPOINTS 8 float\n"
    )
    data = head.encode() + block([float(value) for corner in CORNERS for value in corner], "f")
    if new:
        data += f"{word} {len(offsets)} {len(flat)}\nOFFSETS vtktypeint64\n".encode() + block(offsets, "q")
        data += b"CONNECTIVITY vtktypeint64\n" + block(flat, "q")
    else:
        data += f"{word} {len(cells)} {len(lists)}\n".encode() + block(lists, "i")
    return data + b"CELL_DATA 12\nSCALARS a float 1\nLOOKUP_TABLE default\n"


def stl_text(letters: str) -> bytes:
    lines = ["solid cube"]
    for triangle in TRIANGLES:
        corners = [f"vertex {x} {y} {z}" for x, y, z in (CORNERS[corner - 1] for corner in triangle)]
        lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    text = "\n".join([*lines, "endsolid cube"])
    return (text.upper() if letters == "upper" else text).encode()


GMSH1_NODES = "$NOD\n8\n" + "".join(f"{10 * n} {x} {y} {z}\n" for n, (x, y, z) in enumerate(CORNERS, 1)) + "$ENDNOD\n"
GMSH1_HEX = GMSH1_NODES + "$ELM\n1\n1 5 1 1 8 10 50 70 30 20 60 80 40\n$ENDELM\n"

CUBES = {
    "plain": ("a.obj", V + faces("{n}")),
    "texture": ("a.obj", V + "vt 0 0\n" + faces("{n}/1")),
    "normals": ("a.obj", V + "vn 1 0 0\n" + faces("{n}//1")),
    "both": ("a.obj", V + "vt 0 0\nvn 1 0 0\n" + faces("{n}/1/1")),
    "back from the last": ("a.obj", V + faces("{k}/-1/-1")),
    "colours": ("a.obj", V.replace("\n", " 0.5 0.5 0.5\n") + faces("{n}")),
    "lines that go on": ("a.obj", V + faces("{n}").replace(" ", " \\\r\n ", 12)),
    "remarks and groups": ("a.obj", "# a cube\nmtllib a.mtl\n" + V + "g all\nusemtl x\ns off\nl 1 2\n" + faces("{n}")),
    "Latin letters": ("a.obj", ("# W\xfcrfel\n" + V + faces("{n}")).encode("latin-1")),
    "polygons": ("a.vtk", polydata(QUADS, "POLYGONS")),
    "polygons, binary": ("a.vtk", polydata(QUADS, "POLYGONS", binary=True)),
    "polygons, version 5": ("a.vtk", polydata(TRIANGLES, "POLYGONS", new=True)),
    "polygons, version 5, binary": ("a.vtk", polydata(QUADS, "POLYGONS", new=True, binary=True)),
    "strips": ("a.vtk", polydata([(a, b, d, c) for a, b, c, d in QUADS], "TRIANGLE_STRIPS")),
    "STL in small letters": ("a.stl", stl_text("lower")),
    "STL in capital letters": ("a.stl", stl_text("upper")),
    "Gmsh 1": ("a.msh", GMSH1_HEX),
}  # fmt: skip


@pytest.mark.parametrize(("name", "text"), CUBES.values(), ids=CUBES.keys())
def test_the_same_cube(name: str, text: str | bytes) -> None:
    raw = read_surface(name, text.encode() if isinstance(text, str) else text)
    assert raw.vertices.shape == (8, 3) and raw.triangles.shape == (12, 3)
    assert enclosed_volume(raw.vertices, raw.triangles) == pytest.approx(1.0)


@pytest.mark.parametrize("scene", ["dumpling", "sausage"])
def test_triangles_are_in_the_order_of_the_file(scene: str) -> None:
    """As meshio reads a plain file, to the last bit: what was simulated before is simulated alike."""
    file = SCENES / f"{scene}.obj"
    ours, theirs = read_mesh_file(file.name, file.read_bytes()), meshio.read(file)
    assert np.array_equal(ours.points, theirs.points)
    assert [block.kind for block in ours.blocks] == ["triangle"]
    assert np.array_equal(ours.blocks[0].cells, theirs.cells_dict["triangle"])


def area(points: np.ndarray, triangles: list[tuple[int, int, int]]) -> float:
    """Signed, about z."""
    a, b, c = (points[[triangle[k] for triangle in triangles]] for k in range(3))
    return 0.5 * float(np.cross(b - a, c - a)[:, 2].sum())


def test_polygons_with_dents_are_cut_into_ears() -> None:
    """A star of ten corners: no triangle is turned over, and together they have its area."""
    angle = 2.0 * np.pi * np.arange(10) / 10.0
    radius = np.where(np.arange(10) % 2, 0.4, 1.0)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(10)], axis=1)
    for first in range(10):
        found = [tuple(row) for row in triangulate(points, np.roll(np.arange(10), first).tolist()).tolist()]
        assert len(found) == 8
        assert all(area(points, [triangle]) > 0.0 for triangle in found)
        assert area(points, found) == pytest.approx(5.0 * 0.4 * np.sin(np.pi / 5.0))
    fan = [(0, k, k + 1) for k in range(1, 9)]
    assert any(area(points, [triangle]) < 0.0 for triangle in fan), "a fan would not do"


def test_a_quad_with_a_dent_is_cut_through_it() -> None:
    dart = np.array([[0.0, 0.0, 0.0], [2.0, -1.0, 0.0], [0.5, 0.0, 0.0], [2.0, 1.0, 0.0]])
    for first in range(4):
        order = np.roll(np.arange(4), first)
        text = "".join(f"v {x} {y} {z}\n" for x, y, z in dart) + "f " + " ".join(str(k + 1) for k in order)
        mesh = read_mesh_file("a.obj", text.encode())
        halves = [tuple(triangle) for triangle in mesh.blocks[0].cells.tolist()]
        assert [area(dart, [half]) > 0.0 for half in halves] == [True, True]


WRONG = {
    "a vertex that is not there": ("a.obj", V + "f 1 2 9\n", ["a.obj:9: ", "vertex 9", "has 8"]),
    "one before the first": ("a.obj", V + "f -9 1 2\n", ["a.obj:9: ", "has 8"]),
    "a corner 0": ("a.obj", V + "f 0 1 2\n", ["a.obj:9: 'f'", "counted from 1"]),
    "two corners": ("a.obj", V + "f 1 2\n", ["a.obj:9: 'f'", "three corners or more"]),
    "no number": ("a.obj", "v 0 0\n", ["a.obj:1: 'v'", "three numbers"]),
    "the line where it begins": ("a.obj", V + "f 1 \\\n 2 \\\n x\n", ["a.obj:9: 'f'"]),
    "free-form surface": ("a.obj", V + "surf 0 1 0 1 1 2 3 4\n", ["a.obj:9: surf", "export polygons"]),
    "nothing": ("a.obj", "# empty\n", ["holds no triangles"]),
    "half a polygon": ("a.vtk", polydata(QUADS, "POLYGONS")[:230], ["no whole VTK file", "save it anew"]),
    "points that are not there": ("a.vtk", polydata([(1, 2, 9)], "POLYGONS"), ["has point 8", "of 8"]),
    "half an STL": ("a.stl", stl_text("upper").rpartition(b"VERTEX")[0], ["no whole STL file"]),
    "an unknown element": ("a.msh", GMSH1_NODES + "$ELM\n1\n1 99 1 1 3 10 20 30\n$ENDELM\n", ["type 99"]),
    "no elements": ("a.msh", GMSH1_NODES, ["no $ELM", "save it anew"]),
    "lost lines": ("a.msh", GMSH1_HEX.replace("$NOD\n8", "$NOD\n9"), ["32 numbers in place of 36"]),
    "lost nodes": ("a.msh", GMSH1_HEX.replace("70 30", "75 30"), ["no whole Gmsh file", "node 75"]),
}  # fmt: skip


@pytest.mark.parametrize(("name", "text", "words"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_said_with_its_line(name: str, text: str | bytes, words: list[str]) -> None:
    with pytest.raises(MeshError) as caught:
        read_surface(name, text.encode() if isinstance(text, str) else text)
    for word in words:
        assert word in str(caught.value), str(caught.value)
