"""A mesh file of any format -> points and cells: the format is what the content says, else what the suffix says."""

import contextlib
import io
import re
import tempfile
from collections.abc import Callable
from pathlib import Path, PurePosixPath

from softseam_services.body.errors import MeshError
from softseam_services.body.formats.collada import read_collada
from softseam_services.body.formats.gltf import read_gltf
from softseam_services.body.formats.gmsh import read_gmsh
from softseam_services.body.formats.medit import read_medit
from softseam_services.body.formats.mesh_file import MeshFile, from_meshio
from softseam_services.body.formats.obj import read_obj
from softseam_services.body.formats.off import read_off
from softseam_services.body.formats.ply import read_ply
from softseam_services.body.formats.polygons import LargePolygon
from softseam_services.body.formats.stl import read_stl
from softseam_services.body.formats.tetgen import read_tet, read_tetgen
from softseam_services.body.formats.usd import read_usd
from softseam_services.body.formats.vtk_legacy import legacy_dataset, read_legacy
from softseam_services.body.formats.vtk_xml import read_xml

READ = "OBJ, STL, PLY, OFF, VTK (legacy, VTU, VTP), Gmsh, MEDIT, COLLADA, glTF, USD and TetGen"
_Reader = Callable[[str, bytes], MeshFile]
_BY_CONTENT: tuple[tuple[re.Pattern[bytes], _Reader], ...] = (
    (re.compile(rb"\s*<\?xml[^>]*>\s*(<!--.*?-->\s*)*<VTKFile\b|\s*<VTKFile\b", re.S), read_xml),
    (re.compile(rb"\s*ply\s*[\r\n]"), read_ply),
    (re.compile(rb"\s*\$(MeshFormat|NOD)\b"), read_gmsh),
    (re.compile(rb"\s*(ST)?C?N?OFF(?![A-Za-z])"), read_off),
    (re.compile(rb"\s*MeshVersionFormatted\b"), read_medit),
    (re.compile(rb"glTF[\x01-\x0f]\x00\x00\x00"), read_gltf),
    (re.compile(rb"#usda |PXR-USDC"), read_usd),
    (re.compile(rb"(?:\xef\xbb\xbf)?\s*(<\?xml[^>]*>\s*)?(<!--.*?-->\s*)*<COLLADA\b", re.S), read_collada),
)
_BY_SUFFIX: dict[str, _Reader] = {
    ".obj": read_obj,
    ".stl": read_stl,
    ".ply": read_ply,
    ".off": read_off,
    ".msh": read_gmsh,
    ".vtp": read_xml,
    ".vtu": read_xml,
    ".dae": read_collada,
    **dict.fromkeys((".gltf", ".glb"), read_gltf),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), read_usd),
    **dict.fromkeys((".node", ".ele"), read_tetgen),
    ".tet": read_tet,
}
_OTHERS = {
    **dict.fromkeys((".step", ".stp", ".iges", ".igs", ".brep", ".fcstd", ".sldprt", ".x_t", ".3dm"), "CAD"),
    **dict.fromkeys((".3mf", ".amf", ".fbx", ".blend", ".3ds", ".x3d", ".wrl", ".ifc", ".dxf"), "scenes and drawings"),
    **dict.fromkeys((".pcd", ".las", ".laz", ".e57", ".pts", ".xyz"), "clouds of points"),
}  # fmt: skip
_REMEDY = {
    "CAD": "export it from the CAD program as STL or OBJ, in millimetres with `scale: 0.001`",
    "scenes and drawings": "export the solid as glTF, STL, OBJ or PLY, e.g. from Blender",
    "clouds of points": "make a closed surface of it first, and save that as PLY or STL",
}
_MESHIO = (".inp", ".bdf", ".fem", ".nas", ".su2", ".vtk", ".xml", ".mdpa", ".f3grid", ".dat", ".tec", ".ugrid", ".avs",
           ".wkt", ".vol", ".post", ".dato", ".mesh", ".meshb")  # fmt: skip
"""what meshio reads of one file alone: XDMF names files of arrays, and others are packed, of any size"""


def read_mesh_file(path: str, data: bytes) -> MeshFile:
    """Points and cells of a file; raises MeshError where it is not whole, or of a format that is not read."""
    try:
        return _by_format(path, data)
    except LargePolygon as error:
        raise MeshError(f"{path}: {error}") from None


def _by_format(path: str, data: bytes) -> MeshFile:
    suffix = PurePosixPath(path.replace("\\", "/")).suffix.lower()
    if not data.strip():
        raise MeshError(f"{path}: the file is empty; export it again")
    if data.startswith(b"version https://git-lfs."):
        raise MeshError(f"{path}: is a pointer of Git LFS in place of the mesh; fetch it by `git lfs pull`")
    head = data[:4096]
    for pattern, reader in _BY_CONTENT:
        if pattern.match(head):
            return reader(path, data)
    if re.match(rb"\s*#\s*vtk DataFile", head, re.I) and legacy_dataset(data) in ("POLYDATA", "UNSTRUCTURED_GRID"):
        return read_legacy(path, data)
    if suffix in _BY_SUFFIX:
        return _BY_SUFFIX[suffix](path, data)
    if suffix in _OTHERS:
        raise MeshError(
            f"{path}: {suffix} is a format of {_OTHERS[suffix]}, which is not read; {_REMEDY[_OTHERS[suffix]]}"
        )
    if suffix not in _MESHIO:
        raise MeshError(_unread(path, suffix, ""))
    return _by_meshio(path, suffix, _alone(path, data) if suffix == ".inp" else data)


def _alone(path: str, data: bytes) -> bytes:
    """Abaqus' file in ASCII, in which a line is what it is in any encoding; raises MeshError where meshio would
    take one for an *INCLUDE, as it does without the star, too."""
    text = data.decode("ascii", "replace")
    for number, line in enumerate(io.StringIO(text, newline=None), 1):
        keyword, _, rest = line.partition(",")
        if keyword.replace("*", "").strip().upper() == "INCLUDE":
            raise MeshError(
                f"{path}:{number}: *INCLUDE of {rest.rpartition('=')[2].strip()!r}: a mesh is read from one file; put "
                "what is included in its place"
            )
    return text.encode("ascii", "replace")


def _unread(path: str, suffix: str, reason: str) -> str:
    return (
        f"{path}: cannot be read as {suffix or 'a mesh'}{f' ({reason})' if reason else ''}; save it in one of the "
        f"formats that are read: {READ}"
    )


def _by_meshio(path: str, suffix: str, data: bytes) -> MeshFile:
    """What meshio reads. Its readers fail on malformed input with whatever their parsing trips over, SystemExit
    included, and print as they go; all of it means the same to a user."""
    import meshio  # a third of a second, for meshes alone

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"mesh{suffix}"
        file.write_bytes(data)
        said = io.StringIO()
        try:
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                return from_meshio(meshio.read(file))
        except (Exception, SystemExit) as error:
            text = said.getvalue() if isinstance(error, SystemExit) else str(error)
            lines = text.replace(str(file), path).splitlines()
            reason = next((line.strip() for line in lines if re.search(r"[A-Za-z]{3}", line)), "")
            raise MeshError(_unread(path, suffix, reason)) from error
