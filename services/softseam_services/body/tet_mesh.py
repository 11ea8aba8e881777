"""A solid of tetrahedra whose corners are particles, from a file: what PBD moves by constraints on their strains."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from softseam_protocol.scene.particles import MOST_PARTICLES, TetMeshBody
from softseam_protocol.scene.scene import Scene
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.errors import MeshError
from softseam_services.body.mesh_io import read_tetrahedra
from softseam_services.body.particles import Bends, ParticleBody, Solid, Springs, assemble, placed
from softseam_services.body.skin import solid_skin
from softseam_services.body.units import check_extent

_FACES = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


def build_tet_mesh(scene: Scene, spec: TetMeshBody, files: Mapping[str, bytes]) -> ParticleBody:
    """The solid of a scene; a corner has a quarter of the mass of each tetrahedron at it. Raises MeshError."""
    if spec.path not in files:
        raise MeshError(f"{spec.path}: the file is missing; give its path relative to the scene file")
    raw = read_tetrahedra(spec.path, files[spec.path], spec.part)
    if len(raw.points) > MOST_PARTICLES:
        raise MeshError(
            f"{spec.path}: {len(raw.points):,} corners, more than {MOST_PARTICLES:,}; mesh it more coarsely"
        )
    axis = "xyz".index(spec.up)
    points = spec.scale * raw.points[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]
    check_extent(spec.path, points, spec.scale)
    x_rest = placed(spec, points - 0.5 * (points.min(axis=0) + points.max(axis=0)))
    corners = x_rest[raw.cells]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    mass = np.zeros(len(x_rest))
    np.add.at(mass, raw.cells, (0.25 * spec.density * volume)[:, None])
    elastic = ElasticConstants.from_young_poisson(spec.young, spec.poisson)
    wave_speed = math.sqrt((elastic.lambda_ + 2.0 * elastic.mu) / spec.density)
    edges = np.linalg.norm(corners[:, _EDGES[:, 1]] - corners[:, _EDGES[:, 0]], axis=2)
    none = np.zeros((0, 4), dtype=np.int32)
    return assemble(
        scene,
        spec,
        x_rest=x_rest,
        mass=mass,
        springs=Springs(none[:, :2], np.zeros(0), np.zeros(0)),
        bends=Bends(none, np.zeros((0, 4)), np.zeros(0)),
        skin=solid_skin(raw.triangles),
        spacing=float(edges.min()),
        reach=float(np.ptp(x_rest, axis=0).max()),
        radius=0.0,
        self_contact=False,
        self_friction=0.0,
        solid=Solid(raw.cells, elastic, _least_height(corners, volume) / wave_speed, spec.law),
    )


def _least_height(corners: np.ndarray, volume: np.ndarray) -> float:
    """Least height of any of the tetrahedra (m, 4, 3): three times its volume over its largest face [m]."""
    faces = corners[:, _FACES]
    area = 0.5 * np.linalg.norm(np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0]), axis=2)
    return float((3.0 * volume / area.max(axis=1)).min())
