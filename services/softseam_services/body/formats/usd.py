"""USD (.usd, .usda, .usdc, .usdz) by usd-core: polygons of the meshes of a stage, where its transforms have them.

What the stage composes must be in the one file; materials, subdivision, skins and animations are left out.
"""

import posixpath
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import MeshFile
from softseam_services.body.formats.placed import MOST_PLACED, Placed, placed_file

_NO_MESHES = ("Capsule", "Capsule_1", "Cone", "Cube", "Cylinder", "Cylinder_1", "NurbsPatch", "Plane",
              "PointInstancer", "Sphere", "TetMesh")  # fmt: skip
"""prims that fill a place, and are no polygons where they stand"""


def read_usd(path: str, data: bytes) -> MeshFile:
    """Polygons of the stage; raises MeshError where it is not whole, or refers to other files."""
    try:
        from pxr import Sdf, Tf, Usd, UsdGeom
    except ModuleNotFoundError:
        raise MeshError(
            f"{path}: USD is read by usd-core, which is not installed: pip install 'softseam[usd]', or export the "
            "solid as STL or OBJ"
        ) from None
    with tempfile.TemporaryDirectory() as folder:
        suffix = ".usdz" if data.startswith(b"PK\3\4") else ".usd"  # text or crate, as the content says
        file = Path(folder) / f"mesh{suffix}"
        file.write_bytes(data)
        try:
            if others := _others(file):
                raise MeshError(
                    f"{path}: refers to {others[0]!r}, which is another file: flatten it (usdcat --flatten)"
                )
            stage = Usd.Stage.Open(Sdf.Layer.FindOrOpen(str(file)))
            found = list(_placed(stage))
            return placed_file(found, UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage).lower())
        except MeshError:
            raise
        except (Tf.ErrorException, zipfile.BadZipFile, ValueError, AttributeError) as error:
            reason = _said(error).replace(str(file), path).rpartition(" : '")[2].strip().removesuffix("'")
            raise MeshError(f"{path}: is no whole USD file ({reason}): export it again, or as STL") from None


def _said(error: Exception) -> str:
    """Its text, which may cite what is no text."""
    try:
        return str(error)
    except UnicodeDecodeError as undecoded:
        return str(undecoded)


def _others(file: Path) -> list[str]:
    """What its layers refer to that is not in the file: of a package, in none of its entries. None of it is opened."""
    from pxr import Sdf

    entries, layers = {""}, {"": str(file)}
    if file.suffix == ".usdz":
        entries = set(zipfile.ZipFile(file).namelist())
        layers = {entry: f"{file}[{entry}]" for entry in entries if PurePosixPath(entry).suffix.startswith(".usd")}
    found = set()
    for entry, name in layers.items():
        needed = Sdf.Layer.FindOrOpen(name).GetCompositionAssetDependencies()
        found |= {
            each for each in needed if posixpath.normpath(posixpath.join(posixpath.dirname(entry), each)) not in entries
        }
    return sorted(found - {""})


def _placed(stage: Any) -> Iterator[Placed]:
    """The stage's meshes that are shown, each called as its prim. Raises ValueError where they are too many."""
    from pxr import Usd, UsdGeom

    first = Usd.TimeCode.EarliestTime()
    cache = UsdGeom.XformCache(first)
    for number, prim in enumerate(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())):
        if number > MOST_PLACED:
            raise ValueError(f"its stage has more than {MOST_PLACED:,} prims")
        shown, kind = UsdGeom.Imageable(prim), prim.GetTypeName()
        if kind not in ("Mesh", *_NO_MESHES) or shown.ComputePurpose() in ("guide", "proxy"):
            continue
        if shown.ComputeVisibility(first) == UsdGeom.Tokens.invisible:
            continue
        if kind in _NO_MESHES:
            raise ValueError(f"{prim.GetName()!r} is a {kind}, which is not read: make a mesh of it")
        mesh = UsdGeom.Mesh(prim)
        points, corners, sizes = (
            each.Get(first)
            for each in (mesh.GetPointsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetFaceVertexCountsAttr())
        )
        if points and corners and sizes:
            flip = mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded
            order = slice(None, None, -1 if flip else 1)
            yield Placed(
                prim.GetName(),
                np.array(points, dtype=np.float64),
                np.array(corners, dtype=np.int64)[order],
                np.array(sizes, dtype=np.int64)[order],
                np.array(cache.GetLocalToWorldTransform(prim)).T,
            )
