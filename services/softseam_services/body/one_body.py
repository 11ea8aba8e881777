"""One body of a surface that has several: which there are, and which is taken."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from softseam_services.body.body import Floats, Ints
from softseam_services.body.errors import MeshError
from softseam_services.body.mesh_io import named_parts
from softseam_services.body.repair import edges_of
from softseam_services.body.surface_check import nesting, orient

DUST = 1e-6
"""of the largest body's volume"""
_MAIN = 0.25
"""of an open piece's extent: a closed body that is shorter is not the one that is meant"""
_MOST_OPEN = 100
"""open pieces that are measured"""
_MOST = 5
"""bodies that a message lists"""


@dataclass(frozen=True)
class Bodies:
    """The closed bodies of a surface, the largest first."""

    triangles: tuple[NDArray[np.int64], ...]
    """numbers of the triangles of each, of its cavities too"""
    volumes: tuple[float, ...]
    """inside the outermost shell of each [m^3]"""
    names: tuple[str, ...]
    """of the part that each belongs to alone, else \"\""""
    n_open: int
    """pieces that are not closed"""
    extent: float
    """of the largest [m]"""
    open_extent: float
    """the largest of open pieces [m]"""

    def listed(self) -> str:
        """The first ones by number, volume and name."""
        found = [
            f"{number}: {1e6 * volume:.3g} cm^3" + (f" ({name})" if name else "")
            for number, (volume, name) in enumerate(zip(self.volumes[:_MOST], self.names, strict=False), 1)
        ]
        return ", ".join(found) + (", ..." if len(self.volumes) > _MOST else "")


def closed_bodies(
    path: str, vertices: Floats, triangles: Ints, part: NDArray[np.int64], names: Sequence[str]
) -> Bodies:
    """Find them. Raises MeshError where a surface is one-sided.

    vertices (n, 3) [m], triangles (T, 3), part (T,) the number of each triangle's name
    """
    _, count, number, _ = edges_of(triangles)
    at = np.arange(len(number)) // 3
    links = coo_array((np.ones(len(at)), (at, len(triangles) + number)), shape=(len(triangles) + len(count),) * 2)
    _, piece = connected_components(links, directed=False)
    piece = piece[: len(triangles)]
    n_pieces = int(piece.max()) + 1
    sound = np.ones(n_pieces, dtype=np.bool_)
    sound[piece[at[count[number] != 2]]] = False
    closed = np.flatnonzero(sound[piece])
    open_pieces = np.flatnonzero(~sound)
    if not len(closed):
        return Bodies((), (), (), len(open_pieces), 0.0, 0.0)
    turned, _, shell = orient(path, vertices, triangles[closed])
    found = nesting(vertices, turned, shell)
    outer = sorted(found.outer, key=lambda s: -abs(found.volumes[s]))
    owner = np.array(found.owner)[shell]
    members = tuple(closed[owner == s] for s in outer)
    called = [np.unique(part[each]) for each in members]
    return Bodies(
        members,
        tuple(abs(found.volumes[s]) for s in outer),
        tuple(names[int(each[0])] if len(each) == 1 else "" for each in called),
        len(open_pieces),
        _extent(vertices[triangles[members[0]]]),
        max((_extent(vertices[triangles[piece == each]]) for each in open_pieces[:_MOST_OPEN]), default=0.0),
    )


def _extent(x: Floats) -> float:
    return float(np.ptp(x.reshape(-1, 3), axis=0).max())


def without_dust(bodies: Bodies, n_triangles: int) -> tuple[NDArray[np.int64], list[str]]:
    """Numbers of the triangles without bodies too small to matter beside the largest, and a note on these."""
    tiny = [
        each for each, volume in zip(bodies.triangles, bodies.volumes, strict=True) if volume < DUST * bodies.volumes[0]
    ]
    if not tiny:
        return np.arange(n_triangles), []
    kept = np.ones(n_triangles, dtype=np.bool_)
    kept[np.concatenate(tiny)] = False
    return np.flatnonzero(kept), [f"{len(tiny)} bodies of less than a millionth of the volume were left out"]


def take_body(path: str, bodies: Bodies, wanted: int) -> tuple[NDArray[np.int64], list[str]]:
    """Numbers of the triangles of the body of a number, counted from 1, and what is left out; raises MeshError."""
    n = len(bodies.volumes)
    if wanted > n:
        raise MeshError(
            f"{path}: has no body {wanted}: {f'by size they are {bodies.listed()}' if n else 'none is closed'}"
        )
    left = [f"{n - 1} other bodies"] if n > 1 else []
    left += [f"{bodies.n_open} open pieces"] if bodies.n_open else []
    notes = [f"{' and '.join(left)} of the file were left out"] if left else []
    return bodies.triangles[wanted - 1], notes


def choices(bodies: Bodies, part: NDArray[np.int64], names: Sequence[str]) -> str:
    """What `part` could take, as the end of a message; "" where there is no choice."""
    choice = len(bodies.volumes) > 1 or (bodies.volumes and bodies.n_open)
    if choice and bodies.extent > _MAIN * bodies.open_extent:
        return f"; `part: 1` takes the largest closed body alone (by size {bodies.listed()})"
    used = [names[number] for number in np.unique(part).tolist() if names[number]]
    return f"; `part` takes one of the file's parts alone: {named_parts(used)}" if len(used) > 1 else ""
