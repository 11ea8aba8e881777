"""COLLADA (.dae), as robots' packages and modellers write it: polygons where the scene's nodes have them.

Source: Khronos Group 2008, COLLADA 1.4.1 and 1.5.0 specifications. Nothing but positions is read, so that normals,
materials and pictures that are missing or broken do not matter; skins are refused.
"""

from collections.abc import Iterator
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells, MeshFile
from softseam_services.body.formats.placed import MOST_PLACED, Placed, placed_file
from softseam_services.body.formats.polygons import strip_triangles
from softseam_services.body.formats.text import numbers

_Element = ElementTree.Element
_PLACED = ("node", "instance_node", "instance_geometry")
_SURFACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def read_collada(path: str, data: bytes) -> MeshFile:
    """Polygons of the scene; raises MeshError where the file is not whole, or has skins."""
    try:
        root = ElementTree.fromstring(data)
        for each in root.iter():
            each.tag = each.tag.rpartition("}")[2]  # of whichever version
        if root.find(".//instance_controller") is not None:
            raise MeshError(f"{path}: has a skin, which is not read: apply it, and export the solid alone")
        unit, up = root.find("asset/unit"), root.findtext("asset/up_axis", "").strip().lower()
        metres = 1.0 if unit is None else float(unit.get("meter", "1").replace(",", "."))
        return placed_file(list(_placed(root)), metres, up[0] if up in ("x_up", "z_up") else "y")
    except MeshError:
        raise
    except (ValueError, OverflowError, ElementTree.ParseError) as error:
        raise MeshError(f"{path}: is no whole COLLADA file ({error}): export it again, or as STL") from None


class _Names:
    """What is in an element, by what it is called: names of sources are those of one geometry alone."""

    def __init__(self, element: _Element) -> None:
        self._called = {(each.tag, each.get("id")): each for each in element.iter() if each.get("id")}

    def found(self, tag: str, url: str | None) -> _Element:
        """Raises ValueError where there is none of that name."""
        name = (url or "").removeprefix("#")
        found = self._called.get((tag, name), self._called.get((tag, unquote(name))))
        if found is None:
            raise ValueError(f"it has no {tag} {url!r}")
        return found


def _placed(root: _Element) -> Iterator[Placed]:
    """Meshes of the scene's nodes; of all scenes where none is chosen, of the library where there is none. Raises
    ValueError where they are too many, or something is missing."""
    names = _Names(root)
    scenes = [names.found("visual_scene", each.get("url")) for each in root.iter("instance_visual_scene")]
    roots = scenes or list(root.iter("visual_scene")) or list(root.iter("geometry"))
    todo = [(each, np.eye(4), "") for each in roots]
    for _ in range(MOST_PLACED):
        if not todo:
            return
        each, to_scene, name = todo.pop(0)
        if each.tag.startswith("instance_"):
            each = names.found(each.tag.removeprefix("instance_"), each.get("url"))
        if each.tag == "geometry":
            yield from _polygons(each, name or each.get("name") or each.get("id") or "", to_scene)
            continue
        if each.tag == "node":
            name = each.get("name") or each.get("id") or name
        for child in each:
            to_scene = to_scene @ _matrix(child)
        todo += [(child, to_scene, name) for child in each if child.tag in _PLACED]
    if todo:
        raise ValueError(f"its scene places more than {MOST_PLACED:,} nodes")


def _polygons(geometry: _Element, name: str, to_scene: Floats) -> Iterator[Placed]:
    """Polygons of a geometry; its lines are left out. Raises ValueError."""
    names = _Names(geometry)
    for primitive in geometry.iter():
        if primitive.tag in _SURFACES:
            corners, sizes, vertices = _corners(primitive)
            if len(corners) or len(sizes):
                yield Placed(name, _points(names, vertices), corners, sizes, to_scene)


def _points(names: _Names, vertices: str | None) -> Floats:
    """Positions (n, 3) of a list of vertices. Raises ValueError."""
    positions = names.found("vertices", vertices).find("input[@semantic='POSITION']")
    source = names.found("source", None if positions is None else positions.get("source"))
    values, accessor = numbers(source.findtext("float_array", "")), source.find(".//accessor")
    stated = {} if accessor is None else accessor.attrib
    first, stride = int(stated.get("offset", 0)), int(stated.get("stride", 3))
    if stride < 3 or first < 0:
        raise ValueError(f"its positions have {stride} numbers each")
    values = values[first:]
    values = values[: len(values) // stride * stride].reshape(-1, stride)[:, :3]
    # Modellers have single precision: what they write of one point twice may differ in the eighth digit.
    return values.astype(np.float32).astype(np.float64)


def _corners(primitive: _Element) -> tuple[Cells, Cells, str | None]:
    """Corners (k,), how many each polygon has (m,), and what its vertices are called. Raises ValueError."""
    inputs = {each.get("semantic"): each for each in primitive.findall("input")}
    width = 1 + max((int(each.get("offset", 0)) for each in primitive.findall("input")), default=0)
    if "VERTEX" not in inputs:
        raise ValueError(f"its {primitive.tag} have no vertices")
    if primitive.find("ph/h") is not None:
        raise ValueError("a polygon has holes, which are not read")
    at, kind = int(inputs["VERTEX"].get("offset", 0)), primitive.tag
    lists = [_integers(each.text).reshape(-1, width)[:, at] for each in primitive.iter("p")]
    if kind == "tristrips":
        lists = [strip_triangles(each, np.zeros(0, dtype=np.int64)).ravel() for each in lists]
    if kind == "trifans":
        lists = [np.stack([np.full_like(each[2:], each[0]), each[1:-1], each[2:]], axis=1).ravel()
                 for each in lists if len(each) > 2]  # fmt: skip
    corners = np.concatenate([np.zeros(0, dtype=np.int64), *lists])
    if kind == "polylist":
        sizes = _integers(primitive.findtext("vcount"))
    else:
        sizes = np.array(
            [len(each) for each in lists] if kind == "polygons" else [3] * (len(corners) // 3), dtype=np.int64
        )
    return corners, sizes, inputs["VERTEX"].get("source")


def _integers(text: str | None) -> Cells:
    return numbers(text or "").astype(np.int64)


def _matrix(element: _Element) -> Floats:
    """What a child of a node does to the node's frame (4, 4): nothing where it is no transform. Raises ValueError."""
    found = np.eye(4)
    if element.tag not in ("matrix", "translate", "rotate", "scale", "skew", "lookat"):
        return found
    given = numbers(element.text or "")
    if element.tag == "matrix":
        return given.reshape(4, 4)
    if element.tag == "translate":
        found[:3, 3] = given
    elif element.tag == "scale":
        found[:3, :3] = np.diag(given)
    elif element.tag == "rotate":
        axis, angle = given[:3] / max(float(np.linalg.norm(given[:3])), 1e-300), np.radians(given[3])
        cross = np.cross(np.eye(3), axis).T
        found[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross  # Rodrigues
    elif element.tag == "lookat":
        eye, at, up = given.reshape(3, 3)
        across = np.cross(up, eye - at)
        axes = np.stack([across, np.cross(eye - at, across), eye - at], axis=1)
        found[:3] = np.column_stack([axes / np.linalg.norm(axes, axis=0), eye])
    else:
        raise ValueError("a node is skewed, which is not read: apply it")
    return found
