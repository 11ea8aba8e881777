"""The same solids in every format, in text and binary, old and new; and files that are cut off or something else."""

from __future__ import annotations

import base64
import io
import lzma
import struct
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from solids import BOX_TRIANGLES, box, obj, sphere

from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.reading import read_mesh_file
from softseam_services.body.mesh_io import read_hexahedra, read_surface, read_tetrahedra
from softseam_services.body.surface_check import enclosed_volume

SIZES = [(0.04, 0.03, 0.02), (1.5, 0.25, 3.0), (70.0, 110.0, 45.0)]
QUADS = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
HEXAHEDRON = np.array([[0, 1, 3, 2, 4, 5, 7, 6]])
KUHN = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])
PRISMS = np.array([[0, 1, 3, 4, 5, 7], [0, 3, 2, 4, 7, 6]])


def written(suffix: str, points: np.ndarray, cells: list[tuple[str, np.ndarray]], **how: object) -> bytes:
    """A file as meshio writes it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"m{suffix}"
        meshio.write(file, meshio.Mesh(points, cells), **how)
        return file.read_bytes()


def ply(points: np.ndarray, order: str, *, mixed: bool = False, extra: bool = False) -> bytes:
    """A PLY file with normals and colours, of triangles or of quads and triangles; with a texture list a face."""
    faces = [list(map(int, face)) for face in (BOX_TRIANGLES if not mixed else [*QUADS[:5], *BOX_TRIANGLES[10:]])]
    head = [
        "ply", f"format {order} 1.0", "comment by a scanner", f"element vertex {len(points)}",
        *(f"property {kind} {name}" for kind, name in (("float", "nx"), ("double", "x"), ("double", "y"),
                                                       ("double", "z"), ("uchar", "red"))),
        f"element face {len(faces)}", "property uchar quality", "property list uchar int vertex_indices",
        *(["property list uchar float texcoord"] if extra else []), "element edge 1", "property int v1",
        "property int v2", "end_header\n",
    ]  # fmt: skip
    data = io.BytesIO()
    data.write("\n".join(head).encode())
    mark = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[order]

    def put(codes: str, *values: float) -> None:
        if mark:
            data.write(struct.pack(mark + codes, *values))
        else:
            data.write((" ".join(f"{value:.17g}" for value in values) + "\n").encode())

    for point in points:
        put("fdddB", 0.5, *point, 200)
    for face in faces:
        texture = [2 * len(face), *([0.25] * (2 * len(face)))] if extra else []
        codes = f"BB{len(face)}i" + (f"B{2 * len(face)}f" if extra else "")
        put(codes, 7, len(face), *face, *texture)
    put("2i", 0, 1)
    return data.getvalue()


def off(points: np.ndarray, *, head: str = "OFF", loose: bool = False) -> bytes:
    rows = [" ".join(f"{value!r}" for value in point) for point in points.tolist()]
    if head == "COFF":
        rows = [row + " 0.1 0.2 0.3 1" for row in rows]
    faces = [" ".join(map(str, [4, *quad])) for quad in QUADS.tolist()]
    if loose:  # numbers wherever lines end
        faces = "\n".join(" ".join(faces).split()).split("\n")
    return "\n".join([f"{head} # a box", "", f"{len(points)} 6 12", *rows, *faces]).encode()


def vtp(points: np.ndarray, how: str, order: str = "<") -> bytes:
    """VTK's XML of PolyData, its arrays stored in one way or another."""
    ends = np.arange(4, 25, 4)
    arrays = [(points.ravel(), "Float64", "d"), (QUADS.ravel(), "Int64", "q"), (ends, "Int32", "i")]
    appended = b""
    bodies = []
    pack: dict[str, Callable[[bytes], bytes]] = {"zlib": zlib.compress, "lzma": lzma.compress}
    for values, _, code in arrays:
        raw = struct.pack(f"{order}{len(values)}{code}", *values.tolist())
        if how == "ascii":
            bodies.append(("ascii", " ".join(repr(value) for value in values.tolist()), 0))
        elif how in pack:
            blocks = [raw[: len(raw) // 2], raw[len(raw) // 2 :]]
            packed = [pack[how](part) for part in blocks]
            sizes = struct.pack(f"{order}5I", 2, len(blocks[0]), len(blocks[1]), *map(len, packed))
            bodies.append(("binary", (base64.b64encode(sizes) + base64.b64encode(b"".join(packed))).decode(), 0))
        elif how == "base64":
            bodies.append(("binary", base64.b64encode(struct.pack(f"{order}I", len(raw)) + raw).decode(), 0))
        else:  # appended
            bodies.append(("appended", "", len(appended)))
            block = struct.pack(f"{order}I", len(raw)) + raw
            appended += block if how == "raw" else base64.b64encode(block)
    arrays_written = [
        f'<DataArray type="{kind}" Name="{name}" format="{form}" offset="{at}">{text}</DataArray>'
        for (_, kind, _), name, (form, text, at) in zip(
            arrays, ("Points", "connectivity", "offsets"), bodies, strict=True
        )
    ]
    compressor = {"zlib": ' compressor="vtkZLibDataCompressor"', "lzma": ' compressor="vtkLZMADataCompressor"'}
    head = f'<?xml version="1.0"?>\n<VTKFile type="PolyData" byte_order="{"Big" if order == ">" else "Little"}Endian"'
    document = (
        f"{head}{compressor.get(how, '')}><PolyData><Piece><PointData/><Points>{arrays_written[0]}</Points>"
        f"<Polys>{arrays_written[1]}{arrays_written[2]}</Polys></Piece></PolyData>"
    ).encode()
    if appended:
        encoding = b"raw" if how == "raw" else b"base64"
        document += b'<AppendedData encoding="' + encoding + b'">\n _' + appended + b"\n</AppendedData>"
    return document + b"</VTKFile>"


def stl(points: np.ndarray, *, head: bytes = b"solid by a CAD program", tail: bytes = b"") -> bytes:
    """In binary."""
    data = head.ljust(80) + struct.pack("<I", 12)
    for triangle in BOX_TRIANGLES:
        data += struct.pack("<12fH", 0, 0, 0, *points[triangle].ravel(), 9)
    return data + tail


def msh4(points: np.ndarray, version: str) -> bytes:
    """Gmsh 4 in text, as gmsh writes it: entities with a physical group, one node parametric, tags with gaps."""
    tags = 5 + 3 * np.arange(8)
    lines = [
        "$MeshFormat",
        f"{version} 0 8",
        "$EndMeshFormat",
        "$PhysicalNames",
        "1",
        '3 4 "loaf"',
        "$EndPhysicalNames",
    ]
    lines += ["$Entities", "0 0 0 1", "2 0 0 0 1 1 1 1 4 0", "$EndEntities", "$Nodes"]
    rows = [" ".join(f"{value!r}" for value in point) for point in points.tolist()]
    if version == "4.1":
        lines += ["2 8 5 26", "2 1 1 1", str(tags[0]), f"{rows[0]} 0.5 0.5", "3 2 0 7", *map(str, tags[1:]), *rows[1:]]
    else:
        lines += ["2 8", "1 2 1 1", f"{tags[0]} {rows[0]} 0.5 0.5", "2 3 0 7"]
        lines += [f"{tag} {row}" for tag, row in zip(tags[1:], rows[1:], strict=True)]
    lines += ["$EndNodes", "$Elements", "1 6 1 6" if version == "4.1" else "1 6"]
    lines += ["3 2 4 6" if version == "4.1" else "2 3 4 6"]
    lines += [" ".join(map(str, [number, *tags[tet]])) for number, tet in enumerate(KUHN, 1)]
    return "\n".join([*lines, "$EndElements", ""]).encode()


def msh40_binary(points: np.ndarray) -> bytes:
    """Gmsh 4.0 in binary, of little byte order."""
    data = b"$MeshFormat\n4 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n$Nodes\n"
    data += struct.pack("<2Q3iQ", 1, 8, 1, 3, 0, 8)
    for tag, point in enumerate(points, 11):
        data += struct.pack("<i3d", tag, *point)
    data += b"\n$EndNodes\n$Elements\n" + struct.pack("<2Q3iQ", 1, 6, 1, 3, 4, 6)
    for tag, tet in enumerate(KUHN, 1):
        data += struct.pack("<5i", tag, *(tet + 11))
    return data + b"\n$EndElements\n"


def gmsh1(points: np.ndarray) -> bytes:
    """Tetrahedra of first order and a triangle of second, as Gmsh 1 wrote them."""
    nodes = [f"{2 * n} {x!r} {y!r} {z!r}" for n, (x, y, z) in enumerate(points.tolist(), 1)]
    tets = [f"{n} 4 7 1 4 {' '.join(str(2 * (node + 1)) for node in tet)}" for n, tet in enumerate(KUHN, 1)]
    return "\n".join(["$NOD", "8", *nodes, "$ENDNOD", "$ELM", "7", "9 15 1 1 1 2", *tets, "$ENDELM"]).encode()


KINDS: dict[str, Callable[[np.ndarray], tuple[str, bytes]]] = {
    "OBJ, UTF-16": lambda x: ("a.obj", obj(x, BOX_TRIANGLES).decode().encode("utf-16")),
    "OBJ, a mark of UTF-8": lambda x: ("a.obj", b"\xef\xbb\xbf" + obj(x, BOX_TRIANGLES)),
    "OBJ, lines of old Macs": lambda x: ("a.OBJ", obj(x, BOX_TRIANGLES).replace(b"\n", b"\r")),
    "STL, binary": lambda x: ("a.stl", stl(x)),
    "STL, binary, more behind": lambda x: ("a.STL", stl(x, head=b"CAD", tail=b"\0" * 7)),
    "PLY, text": lambda x: ("a.ply", ply(x, "ascii")),
    "PLY, text, mixed, more lists": lambda x: ("a.ply", ply(x, "ascii", mixed=True, extra=True)),
    "PLY, little": lambda x: ("a.ply", ply(x, "binary_little_endian", extra=True)),
    "PLY, little, mixed": lambda x: ("a.ply", ply(x, "binary_little_endian", mixed=True)),
    "PLY, big, mixed, more lists": lambda x: ("a.ply", ply(x, "binary_big_endian", mixed=True, extra=True)),
    "PLY, lines of Windows": lambda x: ("a.ply", ply(x, "ascii").replace(b"\n", b"\r\n")),
    "PLY, text, longer than said": lambda x: ("a.ply", ply(x, "ascii", extra=True).replace(b" 0.25\n", b" 0.25 9 1\n")),
    "PLY, text, mixed, longer": lambda x: ("a.ply", ply(x, "ascii", mixed=True).replace(b" 7 3\n", b" 7 3 9 1 1\n")),
    "OFF": lambda x: ("a.off", off(x)),
    "OFF without a blank": lambda x: ("a.off", off(x).replace(b"OFF # a box\n\n", b" OFF")),
    "OFF with colours": lambda x: ("a.off", off(x, head="COFF")),
    "OFF wherever lines end": lambda x: ("a.off", off(x, loose=True)),
    "OFF under another name": lambda x: ("a.txt", off(x)),
    "VTP, text": lambda x: ("a.vtp", vtp(x, "ascii")),
    "VTP, base64": lambda x: ("a.vtp", vtp(x, "base64")),
    "VTP, base64, big": lambda x: ("a.vtp", vtp(x, "base64", ">")),
    "VTP, zlib": lambda x: ("a.vtp", vtp(x, "zlib")),
    "VTP, lzma, big": lambda x: ("a.vtp", vtp(x, "lzma", ">")),
    "VTP, appended": lambda x: ("a.vtp", vtp(x, "raw")),
    "VTP, appended base64, named .vtk": lambda x: ("a.vtk", vtp(x, "appended")),
    "VTU, zlib": lambda x: ("a.vtu", written(".vtu", x, [("tetra", KUHN)])),
    "VTU, text": lambda x: ("a.vtu", written(".vtu", x, [("wedge", PRISMS)], binary=False)),
    "VTK 5, binary": lambda x: ("a.vtk", written(".vtk", x, [("hexahedron", HEXAHEDRON)])),
    "VTK 4, text": lambda x: ("a.vtk", written(".vtk", x, [("tetra", KUHN)], file_format="vtk42", binary=False)),
    "VTK, a voxel": lambda x: ("a.vtk", written(".vtk", x, [("hexahedron", HEXAHEDRON)], file_format="vtk42",
                               binary=False).replace(b"8\n0\n1\n3\n2\n4\n5\n7\n6\n", b"8\n0\n1\n2\n3\n4\n5\n6\n7\n")
                               .replace(b"\n12\n", b"\n11\n")),
    "Gmsh 1": lambda x: ("a.msh", gmsh1(x)),
    "Gmsh 2, text": lambda x: ("a.msh", written(".msh", x, [("tetra", KUHN)], file_format="gmsh22", binary=False)),
    "Gmsh 2, binary": lambda x: ("a.msh", written(".msh", x, [("triangle", BOX_TRIANGLES[:3]), ("wedge", PRISMS)],
                                 file_format="gmsh22")),
    "Gmsh 4.0, text": lambda x: ("a.msh", msh4(x, "4")),
    "Gmsh 4.0, binary": lambda x: ("a.msh", msh40_binary(x)),
    "Gmsh 4.1, text": lambda x: ("a.msh", msh4(x, "4.1")),
    "Gmsh 4.1, binary": lambda x: ("a.msh", written(".msh", x, [("hexahedron", HEXAHEDRON)], file_format="gmsh")),
    "MEDIT": lambda x: ("a.mesh", written(".mesh", x, [("triangle", BOX_TRIANGLES), ("tetra", KUHN)])),
    "Abaqus, by meshio": lambda x: ("a.inp", written(".inp", x, [("tetra", KUHN)])),
}  # fmt: skip


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS.keys())
def test_the_same_box(kind: Callable[[np.ndarray], tuple[str, bytes]], size: tuple[float, float, float]) -> None:
    points, _ = box(size, (0.3 * size[0], -2.0 * size[1], size[2]))
    raw = read_surface(*kind(points))
    assert raw.vertices.shape == (8, 3) and raw.triangles.shape == (12, 3)
    rounding = 1e-5 if "STL" in str(kind(points)[0]).upper() else 1e-12
    assert enclosed_volume(raw.vertices, raw.triangles) == pytest.approx(np.prod(size), rel=rounding)
    assert raw.volume is None or raw.volume == pytest.approx(np.prod(size), rel=1e-12)
    np.testing.assert_allclose(np.ptp(raw.vertices, axis=0), size, rtol=1e-6)  # single precision


def mixed_cells(height: float) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
    """A cube of 1 with a pyramid on it that is two tetrahedra, a prism beside it, a pyramid below."""
    points = np.array([
        [0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1],
        [0.5, 0.5, -height], [2, 0, 0.5], [2, 1, 0.5],
    ])  # fmt: skip
    return points, [
        ("hexahedron", np.array([[0, 1, 2, 3, 4, 5, 6, 7]])),
        ("pyramid", np.array([[0, 3, 2, 1, 8]])),
        ("wedge", np.array([[1, 9, 5, 2, 10, 6]])),
    ]


@pytest.mark.kernels
@pytest.mark.parametrize("height", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".msh"])
def test_cells_of_several_kinds(suffix: str, height: float) -> None:
    """Hexahedron, pyramid and prism, one numbered in either sense: V = 1 + height/3 + 1/2."""
    points, cells = mixed_cells(height)
    cells[1] = ("pyramid", cells[1][1][:, [0, 3, 2, 1, 4]])
    data = written(suffix, points, cells, **({"file_format": "gmsh22"} if suffix == ".msh" else {}))
    vertices, triangles, notes = read_solid(f"a{suffix}", data, 0.1, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(1e-3 * (1.5 + height / 3.0), rel=1e-12)
    assert notes == ()


@pytest.mark.kernels
@pytest.mark.parametrize("height", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("tets", [[[0, 1, 2, 8], [0, 2, 3, 8]], [[1, 2, 3, 8], [1, 3, 0, 8]]])
def test_tetrahedra_on_a_hexahedron_without_a_pyramid_between(tets: list[list[int]], height: float) -> None:
    points, cells = mixed_cells(height)
    points[1, 2] = -0.1  # a face that is not plane
    data = written(".vtu", points, [cells[0], ("tetra", np.array(tets))])
    raw = read_surface("a.vtu", data)
    vertices, triangles, notes = read_solid("a.vtu", data, 0.1, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(1e-3 * (raw.volume or 0.0), rel=1e-12)
    assert len(triangles) == 14 and any("there twice were left out" in note for note in notes)


@pytest.mark.parametrize("bulge", [0.0, 0.002, 0.2])
def test_middle_nodes_count_as_straight_and_that_is_said(bulge: float) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    ends = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    middles = corners[np.array(ends)].mean(axis=1)
    middles[:, 2] += bulge
    data = written(".vtu", np.concatenate([corners, middles]), [("tetra10", np.arange(10)[None])])
    raw = read_surface("a.vtu", data)
    assert raw.volume == pytest.approx(1.0 / 6.0)
    told = "1 cells are curved by middle nodes, and count as straight between their corners"
    assert raw.notes == ((told,) if bulge > 0.01 else ())


def test_hexahedra_and_tetrahedra_as_they_are() -> None:
    points, _ = box(SIZES[1])
    both = written(".vtu", points, [("hexahedron", HEXAHEDRON), ("tetra", KUHN)])
    with pytest.raises(MeshError, match=r"a\.vtu: has 6 tetra, but `cells: own` takes hexahedra"):
        read_hexahedra("a.vtu", both)
    with pytest.raises(MeshError, match=r"a\.vtu: has 1 hexahedron, but a tet_mesh"):
        read_tetrahedra("a.vtu", both)
    mirrored = written(".msh", points, [("tetra", KUHN[:, [1, 0, 2, 3]])], file_format="gmsh22", binary=False)
    found = read_tetrahedra("a.msh", mirrored)
    spans = found.points[found.cells[:, 1:]] - found.points[found.cells[:, :1]]
    assert (np.linalg.det(spans) > 0.0).all()
    assert enclosed_volume(found.points, found.triangles) == pytest.approx(np.prod(SIZES[1]))


CUBE = box((1.0, 1.0, 1.0))[0]
WRONG: dict[str, tuple[str, bytes, list[str]]] = {
    "half an STL": ("a.stl", stl(CUBE)[:400], ["no whole STL file", "says 12 triangles and has 6"]),
    "half a PLY": ("a.ply", ply(CUBE, "ascii")[:450], ["no whole PLY file", "ends"]),
    "half a binary PLY": ("a.ply", ply(CUBE, "binary_little_endian")[:-30], ["no whole PLY file"]),
    "a PLY with words": ("a.ply", ply(CUBE, "ascii").replace(b"7 3 0 4 2", b"7 3 0 four 2"), ["'four' is no number"]),
    "a PLY of points": ("a.ply", ply(CUBE, "ascii").replace(b"vertex_indices", b"neighbours"), ["cloud of 8 points"]),
    "a PLY of atoms": ("a.ply", b"ply\nformat ascii 1.0\nelement atom 1\nproperty int z\nend_header\n7", ["'vertex'"]),
    "an OFF with a lost line": ("a.off", off(CUBE).rpartition(b"\n")[0], [":3: '8 6 12'", "8 vertices and 6 faces"]),
    "an OFF with a wrong corner": ("a.off", off(CUBE).replace(b"4 1 3 7 5", b"4 1 3 8 5"), ["'4 1 3 8 5'", "below 8"]),
    "half a VTP": ("a.vtp", vtp(CUBE, "base64")[:300], ["no whole VTK XML file"]),
    "a VTP of other numbers": ("a.vtp", vtp(CUBE, "zlib").replace(b"eJ", b"eK", 1), ["no whole VTK XML file"]),
    "an image": ("a.vti", b'<VTKFile type="ImageData"><ImageData/></VTKFile>', ["VTK XML of ImageData", "ParaView"]),
    "a compressor": ("a.vtp", vtp(CUBE, "zlib").replace(b"ZLib", b"LZ4"), ["vtkLZ4DataCompressor", "by zlib"]),
    "half a Gmsh": ("a.msh", msh4(CUBE, "4.1")[:300], ["no whole Gmsh file", "$Elements"]),
    "a lost node": ("a.msh", msh4(CUBE, "4").replace(b"\n26 ", b"\n27 "), ["no whole Gmsh file", "node 26"]),
    "Gmsh 9": ("a.msh", msh4(CUBE, "9.0"), ["version 9", "1, 2 and 4 are read"]),
    "half a MEDIT": ("a.mesh", written(".mesh", CUBE, [("tetra", KUHN)])[:300], ["no whole MEDIT file"]),
    "CAD": ("part.STEP", b"ISO-10303-21;", ["format of CAD", "STL or OBJ"]),
    "a scene": ("part.fbx", b"Kaydara FBX", ["export the solid as glTF, STL, OBJ or PLY"]),
    "a pointer": ("a.stl", b"version https://git-lfs.github.com/spec/v1\noid", ["pointer of Git LFS", "git lfs pull"]),
    "polyhedra": ("a.vtk", written(".vtk", CUBE, [("tetra", KUHN[:1])], file_format="vtk42", binary=False)
                  .replace(b"\n10\n", b"\n42\n"), ["1 polyhedron", "prisms, pyramids or hexahedra"]),
}  # fmt: skip


@pytest.mark.parametrize(("name", "data", "words"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_said(name: str, data: bytes, words: list[str]) -> None:
    with pytest.raises(MeshError) as caught:
        read_surface(name, data)
    assert str(caught.value).startswith(name)
    for word in words:
        assert word in str(caught.value), str(caught.value)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS.keys())
def test_no_cut_ends_in_a_traceback(kind: Callable[[np.ndarray], tuple[str, bytes]]) -> None:
    """Whatever is left of a file is read, or refused as a mesh."""
    name, data = kind(CUBE)
    for cut in range(1, 60):
        try:
            read_surface(name, data[: len(data) * cut // 60])
        except MeshError as error:
            assert str(error).startswith(name), error
            assert "(1)" not in str(error)


def test_large_polygons_and_many() -> None:
    """A disk of 600 corners with a tooth, extruded; and a sphere's hexagons and pentagons in the thousands."""
    n = 600
    angle = 2.0 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.where(np.arange(n) == 7, 0.5, 1.0)[:, None]
    points = np.concatenate([np.pad(rim, [(0, 0), (0, 1)]), np.pad(rim, [(0, 0), (0, 1)], constant_values=1.0)])
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines.append("f " + " ".join(str(k + 1) for k in reversed(range(n))))
    lines.append("f " + " ".join(str(n + k + 1) for k in range(n)))
    lines += [f"f {k + 1} {(k + 1) % n + 1} {n + (k + 1) % n + 1} {n + k + 1}" for k in range(n)]
    raw = read_surface("a.obj", "\n".join(lines).encode())
    x, y = rim.T
    area = 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    assert enclosed_volume(raw.vertices, raw.triangles) == pytest.approx(area, rel=1e-12)
    mesh = read_mesh_file("a.obj", "\n".join([*lines[: 2 * n], *(["f 1 2 3 4 5 6"] * 5_000)]).encode())
    assert len(mesh.blocks[0].cells) == 20_000


def test_a_file_of_many_triangles_is_read_at_once() -> None:
    """All formats of a sphere give the same triangles."""
    points, triangles = sphere(1.0, 5)
    volume = enclosed_volume(points, triangles.astype(np.int32))
    for suffix in (".ply", ".vtu", ".vtk", ".off", ".msh"):
        how = {"file_format": "gmsh22"} if suffix == ".msh" else {}
        raw = read_surface(f"a{suffix}", written(suffix, points, [("triangle", triangles)], **how))
        assert len(raw.triangles) == len(triangles)
        assert enclosed_volume(raw.vertices, raw.triangles) == pytest.approx(volume, rel=1e-12)
