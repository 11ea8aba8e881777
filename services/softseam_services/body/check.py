"""What a body looks like before anything is simulated: sizes, masses, fills."""

from dataclasses import dataclass

import numpy as np

from softseam_services.body.body import Body
from softseam_services.body.interpolate import rest_points
from softseam_services.body.own_shapes import cell_volumes
from softseam_services.body.surface_check import enclosed_volume, triangle_areas

_SLIVER = 0.02


@dataclass(frozen=True)
class Part:
    """What the cells make of an inclusion."""

    young: float
    """[Pa]"""
    poisson: float
    density: float
    """[kg/m^3]"""
    octants: int
    """that are of its material"""
    volume: float
    """of these, as far as the body fills them [m^3]"""


@dataclass(frozen=True)
class BodyCheck:
    """Measures of a body."""

    n_cells: int
    n_nodes: int
    n_points: int
    n_contact_points: int
    n_triangles: int
    n_fixed: int
    size: tuple[float, float, float]
    """extents of the surface [m]"""
    edges: tuple[float, float, float]
    """edges of a cell, or the shortest of all where cells are no boxes [m]"""
    boxes: bool
    turned: float
    """angle between the axes of its boxes and the scene's [degrees]"""
    volume: float
    """inside the surface [m^3]"""
    area: float
    """of the surface [m^2]"""
    mass: float
    """[kg]"""
    centre: tuple[float, float, float]
    """centre of mass [m]"""
    wave_speed: float
    """P-wave speed, the fastest of its materials [m/s]"""
    full_cells: int
    smallest_fill: float
    """of a cell [1]"""
    slivers: int
    """cells less than 2 % full"""
    parts: tuple[Part, ...]
    """the inclusions"""


def check_body(body: Body) -> BodyCheck:
    """Measure a body; never fails for one that was built."""
    points = rest_points(body)
    triangles = body.surface.triangles
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    fill = body.fill.mean(axis=1)
    volume = enclosed_volume(points, triangles) if body.boxes else float(cell_volumes(body).sum())
    slivers = int((fill < _SLIVER).sum())
    size = np.ptp(points, axis=0)
    return BodyCheck(
        n_cells=body.n_cells,
        n_nodes=body.n_nodes,
        n_points=len(points),
        n_contact_points=int((body.surface.area > 0.0).sum()),
        n_triangles=len(triangles),
        n_fixed=int(body.fixed.sum()),
        size=_triple(size),
        edges=_triple(body.edges),
        boxes=body.boxes,
        turned=float(np.degrees(np.arccos(np.clip(0.5 * (np.trace(body.axes) - 1.0), -1.0, 1.0)))),
        volume=volume,
        area=float(np.linalg.norm(triangle_areas(points, triangles), axis=1).sum()),
        mass=float(mass.sum()),
        centre=_triple(mass @ body.x_rest / mass.sum()),
        wave_speed=body.wave_speed,
        full_cells=int((body.fill == 1.0).all(axis=1).sum()),
        smallest_fill=float(fill.min()),
        slivers=slivers,
        parts=parts_of(body),
    )


def parts_of(body: Body) -> tuple[Part, ...]:
    """What the cells make of each inclusion."""
    volume = np.prod(body.edges) / 8.0 * body.fill
    if not body.boxes:
        volume = np.repeat(cell_volumes(body)[:, None] / 8.0, 8, axis=1)
    found = []
    for number, material in enumerate(body.materials[1:], start=1):
        mine = body.octant_material == number
        found.append(
            Part(
                young=material.young,
                poisson=material.elastic.poisson,
                density=material.density,
                octants=int(np.count_nonzero(mine & (body.fill > 0.0))),
                volume=float(volume[mine].sum()),
            )
        )
    return tuple(found)


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
