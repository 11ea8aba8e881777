"""A solid of tetrahedra whose corners are particles, from a file or of a block: what PBD moves by their strains, or in
its classic form by their volumes and edges."""

import math
from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from softseam_protocol.scene.models import CLASSIC_PBD, PbdSpec
from softseam_protocol.scene.particles import MOST_PARTICLES, TetMeshBody
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Vector
from softseam_services.body.body import Floats, Ints
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.errors import MeshError
from softseam_services.body.mesh_io import read_tetrahedra
from softseam_services.body.particles import CLASSIC, Bends, ParticleBody, Solid, assemble, placed, springs_of
from softseam_services.body.skin import solid_skin
from softseam_services.body.tetrahedral_surface import outer_faces
from softseam_services.body.units import check_extent

_FACES = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


class _Raw(NamedTuple):
    """n points and m tetrahedra of a solid, in place."""

    x_rest: Floats
    """(n, 3) [m]"""
    mass: Floats
    """(n,) [kg]"""
    tetrahedra: Ints
    """(m, 4)"""
    triangles: Ints
    """of the surface, counter-clockwise from outside (k, 3)"""


def build_tet_mesh(scene: Scene, spec: TetMeshBody, files: Mapping[str, bytes]) -> ParticleBody:
    """The solid of a scene. Raises MeshError."""
    raw = _of_block(spec) if spec.path is None else _of_file(spec, spec.path, files)
    corners = raw.x_rest[raw.tetrahedra]
    elastic = ElasticConstants.from_young_poisson(spec.young, spec.poisson)
    wave_speed = math.sqrt((elastic.lambda_ + 2.0 * elastic.mu) / spec.density)
    edges = np.unique(np.sort(raw.tetrahedra[:, _EDGES].reshape(-1, 2), axis=1), axis=0)
    lengths = np.linalg.norm(raw.x_rest[edges[:, 1]] - raw.x_rest[edges[:, 0]], axis=1)
    held = edges if _is_classic(scene.models.pbd) else edges[:0]
    return assemble(
        scene,
        spec,
        x_rest=raw.x_rest,
        mass=raw.mass,
        springs=springs_of(raw.x_rest, held, np.ones(len(held))),
        bends=Bends(np.zeros((0, 4), dtype=np.int32), np.zeros((0, 4)), np.zeros(0)),
        skin=solid_skin(raw.triangles),
        spacing=float(lengths.min()),
        reach=float(np.ptp(raw.x_rest, axis=0).max()),
        radius=0.0,
        self_contact=False,
        self_friction=0.0,
        solid=Solid(
            raw.tetrahedra,
            elastic,
            _least_height(corners) / wave_speed,
            CLASSIC if _is_classic(scene.models.pbd) else spec.law,
        ),
    )


def _is_classic(spec: PbdSpec) -> bool:
    """Whether edges and volumes hold it, of no stiffness in physical units."""
    return spec.method == CLASSIC_PBD


def _of_file(spec: TetMeshBody, path: str, files: Mapping[str, bytes]) -> _Raw:
    """A corner has a quarter of the mass of each tetrahedron at it. Raises MeshError."""
    if path not in files:
        raise MeshError(f"{path}: the file is missing; give its path relative to the scene file")
    raw = read_tetrahedra(path, files[path], spec.part)
    if len(raw.points) > MOST_PARTICLES:
        raise MeshError(f"{path}: {len(raw.points):,} corners, more than {MOST_PARTICLES:,}; mesh it more coarsely")
    scale, axis = spec.scale or 1.0, "xyz".index(spec.up or "z")
    points = scale * raw.points[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]
    check_extent(path, points, scale)
    x_rest = placed(spec, points - 0.5 * (points.min(axis=0) + points.max(axis=0)))
    mass = np.zeros(len(x_rest))
    np.add.at(mass, raw.cells, (0.25 * spec.density * _volumes(x_rest[raw.cells]))[:, None])
    return _Raw(x_rest, mass, raw.cells, raw.triangles)


def _of_block(spec: TetMeshBody) -> _Raw:
    """Its points are a lattice."""
    assert spec.size is not None and spec.divisions is not None  # as the scene was checked
    points, tetrahedra, share = tet_block(spec.size, spec.divisions)
    outer = outer_faces(tetrahedra.astype(np.int64))[1].astype(np.int32)
    return _Raw(placed(spec, points), spec.density * math.prod(spec.size) * share, tetrahedra, outer)


def _volumes(corners: Floats) -> Floats:
    """Of tetrahedra (m, 4, 3) [m^3]."""
    return np.asarray(np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0)


def _least_height(corners: Floats) -> float:
    """Least height of any of the tetrahedra (m, 4, 3): three times its volume over its largest face [m]."""
    faces = corners[:, _FACES]
    area = 0.5 * np.linalg.norm(np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0]), axis=2)
    return float((3.0 * _volumes(corners) / area.max(axis=1)).min())


FIVE = np.array(
    [
        [[0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 1, 1]],
        [[1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 0, 1]],
        [[0, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 1]],
        [[0, 0, 1], [0, 1, 1], [1, 0, 1], [0, 0, 0]],
        [[1, 1, 1], [0, 1, 1], [1, 1, 0], [1, 0, 1]],
    ]
)
"""corners of the tetrahedra of a cube whose place is even: a regular one in the middle, and four in corners"""


class TetBlock(NamedTuple):
    """n points and m tetrahedra."""

    points: Floats
    """about the middle, z fastest (n, 3) [m]"""
    tetrahedra: Ints
    """of positive volume (m, 4)"""
    share: Floats
    """of the block's mass at each point: an eighth of each cube's at its corners (n,) [1]"""


def tet_block(size: Vector, divisions: tuple[int, int, int]) -> TetBlock:
    """A block of this size [m] in so many cubes along x, y and z.

    A quarter of each tetrahedron's mass at its corners would give five neighbours' mass to every other point; so mass
    is lumped by cubes.
    """
    counts = np.array(divisions)
    lines = [np.arange(count + 1) for count in divisions]
    place = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    step = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    cubes = place[(place < counts).all(axis=1)]
    odd = cubes.sum(axis=1) % 2 == 1
    corners = np.where(odd[:, None, None, None], 1 - FIVE, FIVE)
    tetrahedra = ((cubes[:, None, None] + corners) @ step).reshape(-1, 4)
    mirrored = np.repeat(odd, len(FIVE))
    tetrahedra[mirrored] = tetrahedra[mirrored][:, [0, 2, 1, 3]]
    share = np.zeros(len(place))
    for corner in product((0, 1), repeat=3):
        np.add.at(share, (cubes + corner) @ step, 0.125 / len(cubes))
    return TetBlock((place / counts - 0.5) * np.array(size), tetrahedra.astype(np.int32), share)
