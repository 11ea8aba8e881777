"""glTF 2.0 (.gltf with its buffers in it, .glb): triangles where the scene's nodes have them, in metres, y up.

Source: Khronos Group 2021, glTF 2.0 Specification, ISO/IEC 12113. Materials, morphs and animations are left out.
"""

import base64
import json
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells, MeshFile
from softseam_services.body.formats.placed import MOST_PLACED, Placed, placed_file
from softseam_services.body.formats.polygons import strip_triangles

_NUMBERS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_LARGEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}
"""of integers that stand for up to 1 where an accessor is normalized"""
_WIDTH = {"SCALAR": 1, "VEC3": 3}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_HARMLESS = ("KHR_materials", "KHR_texture", "KHR_lights", "KHR_mesh_quantization", "EXT_texture", "EXT_lights")
"""beginnings of the extensions that change no shape, or that are read"""


def read_gltf(path: str, data: bytes) -> MeshFile:
    """Triangles of the scene; raises MeshError where the file is not whole, or packed in a way that is not read."""
    try:
        document, chunk = _opened(data)
        needed = [name for name in document.get("extensionsRequired", []) if not name.startswith(_HARMLESS)]
        if needed:
            raise MeshError(f"{path}: needs {', '.join(needed)}, which is not read: export it without compression")
        return placed_file(list(_Reader(document, chunk).placed()), 1.0, "y")
    except MeshError:
        raise
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError, struct.error) as error:
        reason = "it ends too early" if isinstance(error, struct.error) else error
        reason = f"it has no {error}" if isinstance(error, KeyError) else reason
        raise MeshError(f"{path}: is no whole glTF file ({reason}): export it again, or as STL") from None


def _opened(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The document, and the binary chunk of a .glb. Raises ValueError and struct.error."""
    if not data.startswith(b"glTF"):
        return json.loads(data), b""
    chunks: dict[bytes, bytes] = {}
    version, at = struct.unpack_from("<I", data, 4)[0], 12
    if version != 2:
        raise ValueError(f"it is of version {version}, and 2 is read")
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<I4s", data, at)
        chunks.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    return json.loads(chunks[b"JSON"]), chunks.get(b"BIN\0", b"")


class _Reader:
    """A document with its buffers."""

    def __init__(self, document: dict[str, Any], chunk: bytes) -> None:
        self._of = document
        self._buffers = [_buffer(each, chunk) for each in document.get("buffers", [])]

    def placed(self) -> Iterator[Placed]:
        """Meshes of the scene's nodes. Raises MeshError, and what a broken file trips over."""
        nodes = self._of.get("nodes", [])
        scenes = self._of.get("scenes") or [{"nodes": list(range(len(nodes)))}]
        todo = [(number, np.eye(4)) for number in scenes[self._of.get("scene", 0)].get("nodes", [])]
        for _ in range(MOST_PLACED):
            if not todo:
                return
            number, above = todo.pop(0)
            node = nodes[number]
            to_scene = above @ _matrix(node)
            todo += [(child, to_scene) for child in node.get("children", [])]
            if "skin" in node:
                raise ValueError("it has a skin, which is not read: apply it")
            if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
                raise ValueError("it has instances by EXT_mesh_gpu_instancing, which are not read: apply them")
            if "mesh" in node:
                mesh = self._of["meshes"][node["mesh"]]
                for primitive in mesh["primitives"]:
                    yield self._primitive(primitive, node.get("name") or mesh.get("name", ""), to_scene)
        if todo:
            raise ValueError(f"its scene places more than {MOST_PLACED:,} nodes")

    def _primitive(self, primitive: dict[str, Any], name: str, to_scene: Floats) -> Placed:
        points = self._accessor(primitive["attributes"]["POSITION"], "VEC3").astype(np.float64)
        if "indices" in primitive:
            flat = self._accessor(primitive["indices"], "SCALAR").ravel().astype(np.int64)
        else:
            flat = np.arange(len(points))
        corners = _triangles(flat, primitive.get("mode", _TRIANGLES)).ravel()
        return Placed(name, points, corners, np.full(len(corners) // 3, 3), to_scene)

    def _accessor(self, number: int, shape: str) -> np.ndarray:
        """Its numbers (count, width). Raises ValueError where they are not stored, each in its place."""
        accessor = self._of["accessors"][number]
        if accessor["type"] != shape or "sparse" in accessor or "bufferView" not in accessor:
            raise ValueError(f"accessor {number} is sparse, empty, or no {shape}")
        view = self._of["bufferViews"][accessor["bufferView"]]
        dtype, width = np.dtype(_NUMBERS[accessor["componentType"]]), _WIDTH[shape]
        count, stride = accessor["count"], view.get("byteStride", width * dtype.itemsize)
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        end = start + stride * (count - 1) + width * dtype.itemsize
        buffer = self._buffers[view["buffer"]]
        if min(count, start, stride) < 0 or end > len(buffer):
            raise ValueError(f"accessor {number} ends at byte {end:,} of {len(buffer):,}")
        if not count:
            return np.zeros((0, width))
        found: np.ndarray = np.ndarray((count, width), dtype, buffer, start, (stride, dtype.itemsize))
        return found / _LARGEST[accessor["componentType"]] if accessor.get("normalized") else found


def _buffer(stated: dict[str, Any], chunk: bytes) -> bytes:
    """Content of a buffer. Raises ValueError where it is in another file."""
    uri = stated.get("uri")
    if uri is None:
        return chunk
    head, _, text = uri.partition(",")
    if not head.startswith("data:"):
        raise ValueError(f"its buffer {uri[:80]!r} is another file: export it as .glb")
    return base64.b64decode(text)


def _matrix(node: dict[str, Any]) -> Floats:
    """From a node's frame to that which it hangs in (4, 4): its matrix, by columns, or translation, rotation, scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    turn = np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
    found = np.eye(4)
    found[:3, :3] = turn * np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    found[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return found


def _triangles(flat: Cells, mode: int) -> Cells:
    """Triangles (T, 3) of the corners of a primitive; points and lines have none."""
    if mode == _TRIANGLES:
        return flat.reshape(-1, 3)
    if mode == _STRIP:
        return strip_triangles(flat, np.zeros(0, dtype=np.int64))
    if mode == _FAN:
        return np.stack([np.broadcast_to(flat[:1], len(flat) - 2), flat[1:-1], flat[2:]], axis=1)
    return np.zeros((0, 3), dtype=np.int64)
