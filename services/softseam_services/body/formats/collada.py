"""COLLADA (.dae), as robots' packages and modellers write it, by pycollada: polygons where the scene's nodes have them.

Materials, pictures, cameras and animations are taken out first, so that no file is read that it names; skins are
refused.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import MeshFile
from softseam_services.body.formats.placed import MOST_PLACED, Placed, placed_file

_LEFT_OUT = re.compile(
    r".*\}(library_(effects|materials|images|cameras|lights|animations|animation_clips|controllers|physics_.*)"
    r"|bind_material|instance_camera|instance_light|extra)"
)


def read_collada(path: str, data: bytes) -> MeshFile:
    """Polygons of the scene; raises MeshError where the file is not whole, has skins, or entities of XML."""
    if re.search(rb"<!(DOCTYPE|ENTITY)", data):
        raise MeshError(f"{path}: has a DOCTYPE, which COLLADA has not: export it again")
    import collada  # for such files alone

    try:
        root = ElementTree.fromstring(data)
        if any(each.tag.endswith("}instance_controller") for each in root.iter()):
            raise MeshError(f"{path}: has a skin, which is not read: apply it, and export the solid alone")
        for parent in list(root.iter()):
            for child in [each for each in parent if _LEFT_OUT.fullmatch(each.tag)]:
                parent.remove(child)
        file = collada.Collada(io.BytesIO(ElementTree.tostring(root)), ignore=[collada.common.DaeUnsupportedError])
        placed = [] if file.scene is None else [each for node in file.scene.nodes for each in _placed(node, np.eye(4))]
        unit = file.assetInfo.unitmeter or 1.0
        return placed_file(placed, float(unit), str(file.assetInfo.upaxis)[0].lower())
    except MeshError:
        raise
    except Exception as error:  # its parser fails on malformed input with whatever it trips over
        raise MeshError(f"{path}: is no whole COLLADA file ({error}): export it again, or as STL") from None


def _placed(node: Any, to_scene: Floats) -> Iterator[Placed]:
    """The meshes of a node and of what hangs on it. Raises ValueError where they are too many."""
    import collada

    todo, n_seen = [(node, to_scene, "")], 0
    while todo:
        each, matrix, name = todo.pop()
        n_seen += 1
        if n_seen > MOST_PLACED:
            raise ValueError(f"its scene places more than {MOST_PLACED:,} nodes")
        if isinstance(each, collada.scene.GeometryNode):
            yield from _primitives(each.geometry, name, matrix)
        elif isinstance(each, collada.scene.NodeNode):
            todo.append((each.node, matrix, name))
        elif isinstance(each, collada.scene.Node):
            here, called = matrix @ each.matrix.astype(np.float64), each.name or each.id or name
            todo += [(child, here, called) for child in reversed(each.children)]


def _primitives(geometry: Any, name: str, to_scene: Floats) -> Iterator[Placed]:
    """Triangles and polygons of a geometry; lines are left out."""
    import collada

    for primitive in geometry.primitives:
        if primitive.vertex is None or isinstance(primitive, collada.lineset.LineSet):
            continue
        if isinstance(primitive, collada.triangleset.TriangleSet):
            sizes = np.full(len(primitive.vertex_index), 3)
        else:
            sizes = np.asarray(primitive.vcounts)
        corners = np.asarray(primitive.vertex_index, dtype=np.int64).ravel()
        yield Placed(
            name or geometry.name or geometry.id,
            np.asarray(primitive.vertex, dtype=np.float64).reshape(-1, 3),
            corners,
            sizes.astype(np.int64),
            to_scene,
        )
