"""Which octants of a body's cells are of which of its materials.

An octant of a box cell is wholly of the material at its centre: one block of PBD, one integration point of FEM's hex27,
so both models see the same body. Borders follow the octants: where a border lies on faces of cells, both are exact;
elsewhere the body is that with the border moved by up to a quarter of a cell. Hexahedra of other shapes, of a file or
graded, are each of the one material at their centre.
"""

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.materials import InclusionSpec
from softseam_protocol.scene.parts import PartSpec
from softseam_services.body.body import SAME, Floats, Ints
from softseam_services.body.errors import MeshError
from softseam_services.shapes import SHAPES
from softseam_services.shapes.distance import shape_gaps

_SIDES = np.array([(i, j, k) for k in (-1, 1) for j in (-1, 1) for i in (-1, 1)])


def octant_centres(cell_centres: Floats, edges: Floats, axes: Floats | None = None) -> Floats:
    """Centres of the octants (C, 8, 3) [m] of boxes with these centres (C, 3) and edges (3,) along axes (3, 3), those
    of the scene where None."""
    offsets = 0.25 * edges * _SIDES
    return np.asarray(cell_centres[:, None, :] + (offsets if axes is None else offsets @ axes.T))


def materials_at(spec: BodySpec, places: Floats, cell: float) -> Ints:
    """Number of the material at each place (..., 3) [m]: 0 the body's own, 1 + i that of the last inclusion i there.

    Raises MeshError where an inclusion holds none of the places; the text gives cell [m] then.
    """
    found = np.zeros(places.shape[:-1], dtype=np.int32)
    for i, inclusion in enumerate(spec.inclusions):
        inside = holds(inclusion.shape, places)
        if not inside.any():
            raise _empty(i, inclusion, places, cell)
        found[inside] = 1 + i
    return found


def holds(part: PartSpec, places: Floats) -> NDArray[np.bool_]:
    """Whether the places (..., 3) [m] are inside a part or on its face."""
    shape = SHAPES[part.kind]
    geometry = shape.build(part, {})
    points = np.ascontiguousarray(places.reshape(-1, 3))
    gap = np.empty(len(points))
    shape_gaps(points, shape.number, geometry.numbers, np.array(part.position), geometry.orientation, gap)
    return np.asarray(gap.reshape(places.shape[:-1]) <= SAME * geometry.reach)


def _empty(i: int, inclusion: InclusionSpec, places: Floats, cell: float) -> MeshError:
    flat = places.reshape(-1, 3)
    return MeshError(
        f"body.inclusions.{i}.shape: the {inclusion.shape.kind} at {list(inclusion.shape.position)} holds no octant's "
        f"centre: it is smaller than half a cell, whose edge is {1e3 * cell:.3g} mm, or beside the body, whose octants "
        f"have theirs from {flat.min(axis=0).round(4).tolist()} to {flat.max(axis=0).round(4).tolist()} m: make `cell` "
        "smaller, or move or enlarge the inclusion"
    )
