"""Small scenes of COLLADA, glTF and USD: a box of 4 x 3 x 2 in the frame of each node."""

from __future__ import annotations

import base64
import json
import struct
from typing import Any

import numpy as np
from solids import box

POINTS, TRIANGLES = box((4.0, 3.0, 2.0))


def collada(nodes: str, unit: str = "", up: str = "Z_UP", head: str = "") -> bytes:
    """The box is the geometry `#g`."""
    at, corners = (" ".join(str(each) for each in array.ravel()) for array in (POINTS, TRIANGLES))
    return f"""<?xml version="1.0"?>{head}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g" name="box"><mesh>
<source id="p"><float_array id="pa" count="24">{at}</float_array><technique_common>
<accessor source="#pa" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></triangles>
</mesh></geometry></library_geometries>
<library_nodes><node id="twice"><translate>0 0 7</translate><instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


def gltf(nodes: list[dict[str, Any]], binary: bool, uri: str | None = None, **changes: Any) -> bytes:
    """The box is mesh 0, its 36 corners apart, as exporters write them for their normals; changes: of the document."""
    buffer = POINTS[TRIANGLES].astype("<f4").tobytes() + np.arange(36, dtype="<u2").tobytes()
    inside = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(buffer)} | ({} if binary else {"uri": uri or inside})],
        "bufferViews": [
            {"buffer": 0, "byteLength": 432},
            {"buffer": 0, "byteOffset": 432, "byteLength": 72},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 36, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
    } | changes
    text = json.dumps(document).encode()
    if not binary:
        return text
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def usd(prims: str, metres: float = 1.0, up: str = "Z") -> bytes:
    return f'#usda 1.0\n(\n metersPerUnit = {metres}\n upAxis = "{up}"\n)\n{prims}\n'.encode()


def usd_box(name: str, place: str = "", within: str = "") -> str:
    """A mesh prim with a transform, e.g. `double3 xformOp:translate = (1, 0, 0)`."""
    order = f'uniform token[] xformOpOrder = ["{place.split()[1]}"]' if place else ""
    counts, corners = [3] * 12, TRIANGLES.ravel().tolist()
    points = ", ".join(f"({x}, {y}, {z})" for x, y, z in POINTS.tolist())
    return (
        f'def Mesh "{name}" {{\n int[] faceVertexCounts = {counts}\n int[] faceVertexIndices = {corners}\n'
        f" point3f[] points = [{points}]\n {place}\n {order}\n{within}\n}}\n"
    )
