"""OBJ (Wavefront, appendix B1), as modellers, CAD programs and scanners write it.

A corner of `f` is v, v/vt, v//vn or v/vt/vn, counts from 1, or back from the last vertex where it is negative; polygons
have any number of corners; a line goes on after a backslash. Objects (`o`) name parts, or groups (`g`) where there are
none. Texture, normals, colours, materials, lines and points are left out.
"""

from collections.abc import Iterator

import numpy as np

from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells, MeshFile, polygon_file
from softseam_services.body.formats.text import decoded, quoted

_FREE_FORM = frozenset({"curv", "curv2", "surf", "cstype"})


def read_obj(path: str, data: bytes) -> MeshFile:
    """Vertices and polygons; raises MeshError with the line where one is wrong."""
    points: list[tuple[float, float, float]] = []
    corners: list[int] = []
    sizes: list[int] = []
    lines: list[int] = []
    begun: dict[str, list[tuple[int, str]]] = {"o": [], "g": []}
    for number, words in _lines(decoded(data)):
        kind = words[0]
        if kind in _FREE_FORM:
            raise MeshError(f"{path}:{number}: {kind}: free-form curves and surfaces are not read: export polygons")
        try:
            if kind == "v":
                points.append((float(words[1]), float(words[2]), float(words[3])))
            elif kind in ("f", "fo"):
                given = [int(word.partition("/")[0]) for word in words[1:]]
                if len(given) < 3 or 0 in given:
                    raise ValueError
                corners += [corner - 1 if corner > 0 else len(points) + corner for corner in given]
                sizes.append(len(given))
                lines.append(number)
            elif kind in begun:
                begun[kind].append((len(sizes), " ".join(words[1:])))
        except (ValueError, IndexError):
            what = "three numbers, e.g. v 0.1 0 0" if kind == "v" else "three corners or more, counted from 1"
            raise MeshError(f"{path}:{number}: {kind!r} is followed by {quoted(words[1:])}: give {what}") from None
    flat, counts = np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64)
    wrong = np.flatnonzero((flat < 0) | (flat >= len(points)))
    if len(wrong):
        line = lines[int(np.searchsorted(np.cumsum(counts), wrong[0], side="right"))]
        raise MeshError(
            f"{path}:{line}: a face has vertex {flat[wrong[0]] + 1}, but the file has {len(points)}: export it again"
        )
    part, names = _parts(begun["o"] or begun["g"], len(sizes))
    return polygon_file(np.array(points, dtype=np.float64).reshape(-1, 3), flat, counts, part, names)


def _parts(begun: list[tuple[int, str]], n_faces: int) -> tuple[Cells, list[str]]:
    """Number of each face's name (m,), and the names; what comes before the first name has none."""
    numbers = {name: number for number, name in enumerate(dict.fromkeys(["", *(name for _, name in begun)]))}
    first = [0, *(face for face, _ in begun), n_faces]
    return np.repeat([0, *(numbers[name] for _, name in begun)], np.diff(first)), list(numbers)


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """Number and words of each line that says something, those that go on as one."""
    begun, kept = 0, ""
    for number, line in enumerate(text.splitlines(), 1):
        if "#" in line:
            line = line.partition("#")[0]
        if "\\" in line and line.rstrip().endswith("\\"):
            begun, kept = begun or number, kept + line.rstrip()[:-1] + " "
            continue
        words = (kept + line).split()
        if words:
            yield begun or number, words
        begun, kept = 0, ""
