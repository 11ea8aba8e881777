"""Which octants of a body's cells are of which of its materials.

An octant of a box cell is wholly of the material at its centre: one block of PBD, one integration point of FEM's hex27,
so both models see the same body. Borders follow the octants: where a border lies on faces of cells, both are exact;
elsewhere the body is that with the border moved by up to a quarter of a cell. Hexahedra of other shapes, of a file or
graded, are each of the one material at their centre.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.materials import BoxPart, CapsulePart, CylinderPart, InclusionSpec, SpherePart
from softseam_services.body.body import Floats, Ints
from softseam_services.body.errors import MeshError

_ON_FACE = 1e-9
"""a centre this close to an inclusion's face, relative to the inclusion's extent, is inside"""
_SIDES = np.array([(i, j, k) for k in (-1, 1) for j in (-1, 1) for i in (-1, 1)])


def octant_centres(cell_centres: Floats, edges: Floats) -> Floats:
    """Centres of the octants (C, 8, 3) [m] of boxes with these centres (C, 3) and edges (3,)."""
    return np.asarray(cell_centres[:, None, :] + 0.25 * edges * _SIDES)


def materials_at(spec: BodySpec, places: Floats, cell: float) -> Ints:
    """Number of the material at each place (..., 3) [m]: 0 the body's own, 1 + i that of the last inclusion i there.

    Raises MeshError where an inclusion holds none of the places; cell [m] is told then.
    """
    found = np.zeros(places.shape[:-1], dtype=np.int32)
    for i, inclusion in enumerate(spec.inclusions):
        inside = holds(inclusion.shape, places)
        if not inside.any():
            raise _empty(i, inclusion, places, cell)
        found[inside] = 1 + i
    return found


def holds(part: BoxPart | SpherePart | CapsulePart | CylinderPart, places: Floats) -> NDArray[np.bool_]:
    """Whether the places (..., 3) [m] are inside a part or on its face."""
    away = places - np.array(part.position)
    if isinstance(part, BoxPart):
        half = 0.5 * np.array(part.size)
        own = away @ _turn(np.array(part.rotation))
        return np.asarray((np.abs(own) <= half * (1.0 + _ON_FACE)).all(axis=-1))
    if isinstance(part, SpherePart):
        return np.asarray(np.linalg.norm(away, axis=-1) <= part.radius * (1.0 + _ON_FACE))
    axis = np.array(part.axis) / np.linalg.norm(part.axis)
    along = away @ axis
    half_length = 0.5 * part.length
    if isinstance(part, CapsulePart):
        along = along - np.clip(along, -half_length, half_length)
        beside = away - (away @ axis)[..., None] * axis
        return np.asarray(np.hypot(along, np.linalg.norm(beside, axis=-1)) <= part.radius * (1.0 + _ON_FACE))
    beside = away - along[..., None] * axis
    within = np.abs(along) <= half_length * (1.0 + _ON_FACE)
    return np.asarray(within & (np.linalg.norm(beside, axis=-1) <= part.radius * (1.0 + _ON_FACE)))


def part_volume(part: BoxPart | SpherePart | CapsulePart | CylinderPart) -> float:
    """[m^3], also of what reaches beyond the body."""
    if isinstance(part, BoxPart):
        return part.size[0] * part.size[1] * part.size[2]
    ball = 4.0 / 3.0 * np.pi * part.radius**3
    if isinstance(part, SpherePart):
        return float(ball)
    tube = np.pi * part.radius**2 * part.length
    return float(tube + ball if isinstance(part, CapsulePart) else tube)


def _turn(rotation: Floats) -> Floats:
    """Matrix of a turn, axis times angle (3,) [rad], by Rodrigues' formula: row vectors times it are turned back."""
    angle = float(np.linalg.norm(rotation))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = rotation / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def _empty(i: int, inclusion: InclusionSpec, places: Floats, cell: float) -> MeshError:
    flat = places.reshape(-1, 3)
    return MeshError(
        f"body.inclusions.{i}.shape: the {inclusion.shape.kind} at {list(inclusion.shape.position)} holds no octant's "
        f"centre: it is smaller than half a cell, whose edge is {1e3 * cell:.3g} mm, or beside the body, whose octants "
        f"have theirs from {flat.min(axis=0).round(4).tolist()} to {flat.max(axis=0).round(4).tolist()} m: make `cell` "
        "smaller, or move or enlarge the inclusion"
    )
