"""A mesh file takes time and memory by its size, and no other file is read because it says so."""

from __future__ import annotations

import base64
import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.reading import read_mesh_file
from softseam_services.body.mesh_io import read_surface
from softseam_services.body.surface_check import enclosed_volume


def star(n: int, dent: float = 0.9) -> tuple[np.ndarray, bytes]:
    """The corners of a star of n corners (n, 2), each other one nearer the middle, and its prism of height 1 as OBJ."""
    angle = 2.0 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.where(np.arange(n) % 2, dent, 1.0)[:, None]
    lines = [f"v {x!r} {y!r} {z}" for z in (0, 1) for x, y in rim.tolist()]
    lines.append("f " + " ".join(str(k + 1) for k in reversed(range(n))))
    lines.append("f " + " ".join(str(n + k + 1) for k in range(n)))
    lines += [f"f {k + 1} {(k + 1) % n + 1} {n + (k + 1) % n + 1} {n + k + 1}" for k in range(n)]
    return rim, "\n".join(lines).encode()


def test_a_face_of_many_corners_is_split_at_once() -> None:
    rim, data = star(10_000)
    begun = time.perf_counter()
    raw = read_surface("a.obj", data)
    assert time.perf_counter() - begun < 10.0  # .5 s where it was measured
    x, y = rim.T
    area = 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    assert enclosed_volume(raw.vertices, raw.triangles) == pytest.approx(area, rel=1e-9)


def test_a_face_of_too_many_corners_is_refused() -> None:
    with pytest.raises(MeshError, match=r"^a\.obj: .* 30,000 corners, more than 20,000"):
        read_surface("a.obj", star(30_000)[1])


def test_many_names_of_parts_are_read_in_time_by_their_number() -> None:
    """Triangles of a part each, but for the first, which has none, and the last two; and empty parts between."""
    n = 30_000
    faces = [f"o part {k}\no empty {k}\no part {k}\nf 1 2 3" for k in range(n)]
    data = "\n".join(["v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", *faces, "f 1 2 3\no last"]).encode()
    begun = time.perf_counter()
    file = read_mesh_file("a.obj", data)
    assert time.perf_counter() - begun < 5.0  # .3 s where it was measured, a minute by the square
    whose = [file.names[number] for number in file.blocks[0].part]
    assert whose == ["", *(f"part {k}" for k in range(n)), f"part {n - 1}"]


@pytest.mark.kernels
def test_a_round_face_of_many_corners_is_judged_at_once() -> None:
    """Fans of a disc's corners would all be near one another: ten seconds."""
    n = 8_000
    begun = time.perf_counter()
    vertices, triangles, _ = read_solid("a.obj", star(n, 1.0)[1], None, None)
    assert time.perf_counter() - begun < 5.0  # .5 s where it was measured
    assert enclosed_volume(vertices, triangles) == pytest.approx(0.5 * n * np.sin(2.0 * np.pi / n), rel=1e-9)


def abaqus(include: str) -> bytes:
    return f"*NODE\n1, 0., 0., 0.\n{include}\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n".encode()


@pytest.mark.parametrize(
    "keyword",
    [
        "*INCLUDE, INPUT=",
        "*include,input=",
        "  *Include, Input = ",
        "\f*INCLUDE, INPUT=",
        "* INCLUDE, INPUT=",
        "INCLUDE, INPUT=",
    ],
)
def test_what_includes_another_file_is_refused_by_name(tmp_path: Path, keyword: str) -> None:
    other = tmp_path / "other.inp"
    other.write_text("*NODE\n2, 1., 0., 0.\n3, 0., 1., 0.\n4, 0., 0., 1.\n")
    with pytest.raises(MeshError, match=r"^a\.inp:3: \*INCLUDE of '.*other\.inp'.* one file"):
        read_surface("a.inp", abaqus(f"{keyword}{other}"))
    with pytest.raises(MeshError, match=r"^a\.inp:3: \*INCLUDE"):
        read_surface("a.inp", abaqus(f"{keyword}{other}").replace(b"\n", b"\r"))


def test_no_reader_gets_a_file_that_could_name_others(tmp_path: Path) -> None:
    """XDMF names the files of its arrays."""
    np.arange(12.0).tofile(tmp_path / "points.bin")
    xdmf = (
        '<Xdmf Version="3.0"><Domain><Grid Name="Grid"><Geometry GeometryType="XYZ"><DataItem DataType="Float" '
        f'Dimensions="4 3" Format="Binary" Precision="8">{tmp_path / "points.bin"}</DataItem></Geometry><Topology '
        'TopologyType="Tetrahedron" NumberOfElements="1"><DataItem DataType="Int" Dimensions="1 4" Format="XML" '
        'Precision="8">0 1 2 3</DataItem></Topology></Grid></Domain></Xdmf>'
    )
    with pytest.raises(MeshError, match=r"^a\.xdmf: cannot be read as \.xdmf; save it"):
        read_surface("a.xdmf", xdmf.encode())


def compressed(sizes: tuple[int, int, int], blocks: list[bytes]) -> bytes:
    """A VTP whose points are so many blocks, of the size and last size that it tells, with what is packed in them."""
    packed = [zlib.compress(block) for block in blocks]
    head = struct.pack(f"<{3 + len(packed)}I", *sizes, *map(len, packed))
    text = (base64.b64encode(head) + base64.b64encode(b"".join(packed))).decode()
    return (
        '<VTKFile type="PolyData" compressor="vtkZLibDataCompressor"><PolyData><Piece NumberOfPoints="3"><Points>'
        f'<DataArray type="Float32" NumberOfComponents="3" format="binary">{text}</DataArray></Points>'
        "</Piece></PolyData></VTKFile>"
    ).encode()


def test_compressed_arrays_are_unpacked_no_further_than_they_tell() -> None:
    sound = np.eye(3, dtype="<f4").tobytes()
    with pytest.raises(MeshError, match=r"holds no triangles|without faces"):
        read_surface("a.vtp", compressed((1, 36, 0), [sound]))
    with pytest.raises(MeshError, match=r"a block has more than 36 bytes"):
        read_surface("a.vtp", compressed((1, 36, 0), [bytes(10_000_000)]))
    with pytest.raises(MeshError, match=r"arrays of 4,294,967,292 bytes, more than 1,073,741,824"):
        read_surface("a.vtp", compressed((1, 4_294_967_292, 0), [sound]))
    with pytest.raises(MeshError, match=r"a block has 36 bytes in place of 40"):
        read_surface("a.vtp", compressed((1, 40, 0), [sound]))
