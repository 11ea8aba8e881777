"""OFF (Geomview), in text: vertices and polygons; normals, colours and texture are left out."""

import re

import numpy as np

from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import MeshFile, polygon_file
from softseam_services.body.formats.text import decoded, list_starts, numbers, quoted

_HEAD = re.compile(r"\s*(?:ST)?C?N?OFF(?![A-Za-z])", re.ASCII)


def read_off(path: str, data: bytes) -> MeshFile:
    """Vertices and polygons, one a line; raises MeshError with the line where one is wrong."""
    text = decoded(data)
    lines = [
        (number, words)
        for number, line in enumerate(_HEAD.sub("", text, count=1).splitlines(), 1)
        if (words := line.partition("#")[0].split())
    ]
    if lines and lines[0][1][0].upper() == "BINARY":
        raise MeshError(f"{path}: OFF in binary is not read: save it as text, or as PLY")
    number, words, what = 1, [], "the numbers of vertices, faces and edges"
    points, corners, sizes = [], [], []
    try:
        number, words = lines[0]
        n_points, n_faces = int(words[0]), int(words[1])
        what = f"{n_points} vertices and {n_faces} faces, as it says"
        if len(lines) < 1 + n_points + n_faces:
            raise ValueError
        for line in lines[1 : 1 + n_points]:
            number, words = line
            what = "three numbers"
            points.append((float(words[0]), float(words[1]), float(words[2])))
        for line in lines[1 + n_points : 1 + n_points + n_faces]:
            number, words = line
            what = f"the number of corners, then each below {n_points}"
            face = [int(word) for word in words[1 : 1 + int(words[0])]]
            if len(face) != int(words[0]) or not all(0 <= corner < n_points for corner in face):
                raise ValueError
            corners += face
            sizes.append(len(face))
    except (ValueError, IndexError):
        loose = _without_lines([word for _, words in lines for word in words])
        if loose is not None:
            return loose
        raise MeshError(f"{path}:{number}: {quoted(words)} is no line of OFF here: give {what}") from None
    return polygon_file(
        np.array(points, dtype=np.float64).reshape(-1, 3),
        np.array(corners, dtype=np.int64),
        np.array(sizes, dtype=np.int64),
    )


def _without_lines(words: list[str]) -> MeshFile | None:
    """Vertices and faces of three numbers and of their corners alone, wherever lines end; None where these are not all
    that there is."""
    try:
        values = numbers(" ".join(words))
        n_points, n_faces = int(values[0]), int(values[1])
        points, rest = values[3 : 3 + 3 * n_points].reshape(n_points, 3), values[3 + 3 * n_points :].astype(np.int64)
        starts = list_starts(rest, n_faces)
        corners = np.delete(rest, starts)
        if len(corners) and not 0 <= corners.min() <= corners.max() < n_points:
            return None
        return polygon_file(points, corners, rest[starts])
    except (ValueError, IndexError):
        return None
