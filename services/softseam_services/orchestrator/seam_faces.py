"""The tie of a cut body: its seam's faces, handed to the coupling."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.mortar import SeamTie, identity_tie, mortar_tie
from softseam_services.body.body import Body
from softseam_services.body.interpolate import Functions
from softseam_services.orchestrator.parts import Parts

_LATTICE = np.arange(27).reshape(3, 3, 3)  # [k, j, i]
_OCTANTS = np.arange(8).reshape(2, 2, 2)


def _sheet(cube: NDArray[np.int64], face: int) -> NDArray[np.int64]:
    """Local ids on a face -x +x -y +y -z +z, the lower remaining axis fastest."""
    axis, last = divmod(face, 2)
    return np.asarray(np.take(cube, -1 if last else 0, axis=2 - axis)).reshape(-1)


def face_corners(face: int) -> NDArray[np.int64]:
    """Local ids of the four corners of a face -x +x -y +y -z +z (4,)."""
    return _sheet(_LATTICE, face)[[0, 2, 6, 8]]


def seam_faces(
    body: Body, parts: Parts, neighbours: NDArray[np.int32]
) -> Iterator[tuple[int, NDArray[np.int32], NDArray[np.int32]]]:
    """For each face -x +x -y +y -z +z: the cells of the first part that have one of the second beyond it, and
    these."""
    a, b = parts.names
    beyond = np.zeros(body.n_cells, dtype=np.bool_)
    beyond[parts.cells[b]] = True
    for face in range(6):
        cells = parts.cells[a]
        others = neighbours[cells, face]
        meets = (others >= 0) & beyond[others]
        yield face, cells[meets], others[meets]


def tie_parts(body: Body, parts: Parts, neighbours: NDArray[np.int32], functions: Mapping[str, Functions]) -> SeamTie:
    """How the two parts' seam nodes belong together.

    The seam's faces are rectangles, and each is a whole face of both its cells.
    neighbours (C, 6) as in `CellGrid`; functions: what each model interpolates with
    """
    of = [functions[model] for model in parts.models.values()]
    if len(set(of)) < 2:
        return identity_tie(len(parts.seam))
    of_a, of_b = of
    faces, edges, fill, facing = [], [], [], []
    for face, cells, others in seam_faces(body, parts, neighbours):
        facing.append(np.full(len(cells), face, dtype=np.int32))
        faces.append(body.cell_nodes[cells][:, _sheet(_LATTICE, face)])
        along = [axis for axis in range(3) if axis != face // 2]
        corners = body.x_rest[body.cell_nodes[cells][:, face_corners(face)]]
        sides_of = np.linalg.norm(corners[:, 1:3] - corners[:, :1], axis=2)
        edges.append(np.tile(body.edges[along], (len(cells), 1)) if body.boxes else sides_of)
        own_fill = body.fill[cells][:, _sheet(_OCTANTS, face)]
        other_fill = body.fill[others][:, _sheet(_OCTANTS, face ^ 1)]
        fill.append(0.5 * (own_fill + other_fill))
    return mortar_tie(
        np.concatenate(faces),
        np.concatenate(edges),
        np.concatenate(fill),
        of_a,
        of_b,
        parts.seam,
        body.x_rest,
        np.concatenate(facing),
    )
