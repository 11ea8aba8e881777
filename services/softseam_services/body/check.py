"""What a body looks like before anything is simulated: sizes, masses, fills, and what is worth a warning."""

from dataclasses import dataclass

import numpy as np

from softseam_services.body.body import Body, Material
from softseam_services.body.interpolate import rest_points
from softseam_services.body.own_shapes import cell_volumes
from softseam_services.body.surface_check import enclosed_volume, triangle_areas

_SLIVER = 0.02
_SOFTEST = 100.0
"""the softest gels that stand [Pa]; 20 or 50 are likely kPa"""
_STRETCHED = 3.0
_INCOMPRESSIBLE = 0.495
_COARSE = 8
_SMALL, _LARGE = 1e-3, 5.0
"""extent of what tools press [m]"""
_SINKS = 0.5
"""rho g h/E, from which on a body hardly stands [1]"""


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
    """Quality and plausibility of a body; `warnings` are sentences, empty where nothing is odd."""

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
    warnings: tuple[str, ...]


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
    warnings = list(body.notes)
    if body.edges.max() > _STRETCHED * body.edges.min():
        warnings.append(
            f"body.cell: they are stretched {body.edges.max() / body.edges.min():.1f} to 1: substeps follow the "
            "shortest edge; choose more even ones"
        )
    # What rounding a wanted cell edge to a divisor of the body leaves open is worth knowing when it is one cell.
    if body.boxes and (np.ptp(body.along_axes(points), axis=0) < 1.5 * body.edges).any():
        warnings.append("body.cell: one cell through the thickness: bending is coarse; make it half as large")
    if not _SMALL <= size.max() <= _LARGE:
        warnings.append(f"body.shape: {size.max():.3g} m from end to end is unlike what a hand grips; is the unit m?")
    for number, each in enumerate(body.materials):
        warnings += _doubts(each, "body.material" if number == 0 else f"body.inclusions.{number - 1}.material")
    weight = body.material.density * float(np.ptp(points @ body.gravity)) / body.material.young
    if weight > _SINKS and body.material.young >= _SOFTEST:
        warnings.append(
            f"body.material.young: {body.material.young:g} Pa; the body would sink by some {100.0 * weight:.0f} % of "
            "its height under its own weight; are the units Pa, m and kg/m^3?"
        )
    if body.fixed.all():
        warnings.append("body.fixed: all of the body is clamped, and nothing moves; make the boxes smaller")
    parts = _parts(body)
    for number, part in enumerate(parts):
        if 0 < part.octants < _COARSE:
            warnings.append(
                f"body.inclusions.{number}: it is {part.octants} octants of cells, a coarse picture: shorten `cell`"
            )
        if part.octants == 0:
            warnings.append(
                f"body.inclusions.{number}: it is hidden by later ones, or where the body is empty: leave it out"
            )
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
        parts=parts,
        warnings=tuple(warnings),
    )


def _parts(body: Body) -> tuple[Part, ...]:
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


def _doubts(material: Material, key: str) -> list[str]:
    """What is unlike any soft solid, of the material at this key."""
    doubts = []
    poisson = material.elastic.poisson
    if poisson > _INCOMPRESSIBLE:
        doubts.append(f"{key}.poisson: {poisson:.4g} is nearly 0.5: the wave speed is {material.wave_speed:.0f} m/s")
    if not 10.0 <= material.density <= 25_000.0:
        doubts.append(f"{key}.density: {material.density:g} kg/m^3 is unlike any solid; is the unit kg/m^3?")
    if not _SOFTEST <= material.young <= 1e9:
        doubts.append(f"{key}.young: {material.young:g} Pa is unlike any soft solid; is the unit Pa?")
    return doubts


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
