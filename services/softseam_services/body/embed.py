"""A closed surface embedded in cells that it fills partly."""

from dataclasses import dataclass

import numpy as np

from softseam_services.body.body import ALIKE, SAME, Floats, Ints, Surface
from softseam_services.body.errors import MeshError
from softseam_services.body.filled import FULL_MOMENTS
from softseam_services.body.kernels.fill import octant_moments
from softseam_services.body.lattice import divide, number_nodes
from softseam_services.body.mass import lump
from softseam_services.body.mesh_io import read_surface
from softseam_services.body.one_body import choices, closed_bodies, take_body, without_dust
from softseam_services.body.repair import repair
from softseam_services.body.surface_check import Unmended, check_surface
from softseam_services.body.surface_points import contact_points, refine
from softseam_services.body.unite import mend
from softseam_services.body.units import check_extent, unit_guess

DROPPED = 1e-6
"""cells emptier than this that carry no surface point are left out; their mass is spread over the others"""
_MOST_CELLS = 200_000
DRAWN = 0.5
"""longest edge of the surface's triangles, in edges of a cell"""
SPACING = 0.25
"""the same where tools press it: so many points that none of a cell's freedoms passes between them (docs/decisions/45);
where a file has more, those closer than half of that count as one"""


@dataclass(frozen=True)
class Embedded:
    """Arrays of a body, see `Body`; the grid begins at a corner of the box around it that lies along `axes`."""

    x_rest: Floats
    cell_nodes: Ints
    cell_grid: Ints
    edges: Floats
    moments: Floats
    """M_pqr of the filled part of each octant, see kernels.fill (C, 8, 27)"""
    spread: float
    """volume over that of the cells that are kept: dropped slivers count with the rest [1]"""
    surface: Surface
    axes: Floats

    def lumped(self, density: Floats) -> tuple[Floats, Floats]:
        """Fill (C, 8) and mass (C, 27) [kg] for densities (C, 8) [kg/m^3], see `lump`."""
        fill, mass = lump(self.moments, self.edges, density)
        return fill, self.spread * mass


def read_solid(
    path: str, data: bytes, scale: float | None, up: str | None, part: str | int | None = None
) -> tuple[Floats, Ints, tuple[str, ...]]:
    """Vertices (n, 3) [m] with the base's centre at the origin, outward triangles (T, 3), notes on what was repaired;
    raises MeshError. Arguments as of `read_in_place`."""
    vertices, triangles, notes = read_in_place(path, data, scale, up, part)
    return vertices - base_of(vertices), triangles, notes


def base_of(vertices: Floats) -> Floats:
    """Centre of the base of a bounding box (3,) [m]."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])


def read_in_place(
    path: str, data: bytes, scale: float | None, up: str | None, part: str | int | None = None
) -> tuple[Floats, Ints, tuple[str, ...]]:
    """The same where the file has it.

    scale: metres per unit of the file, None: as it states
    up: the axis of the file that points up, None: as it states; axes are turned cyclically, so nothing is mirrored
    part: of the file's parts the one of this name, or of its bodies the one of this number by size, from 1
    """
    raw = read_surface(path, data, part)
    scale, axis = raw.unit if scale is None else scale, "xyz".index(raw.up if up is None else up)
    vertices = scale * raw.vertices[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]
    check_extent(path, vertices, scale)
    surface = repair(vertices, raw.triangles, raw.part)
    if not len(surface.triangles):
        raise MeshError(f"{path}: encloses nothing ({'; '.join(surface.notes)}): export it again")
    vertices, triangles, whose, notes = surface.vertices, surface.triangles, surface.part, [*raw.notes, *surface.notes]
    bodies = closed_bodies(path, vertices, triangles, whose, raw.names)
    if isinstance(part, int) and raw.volume is None:
        kept, left_out = take_body(path, bodies, part)
    else:
        kept, left_out = without_dust(bodies, len(triangles))
    triangles, whose = triangles[kept], whose[kept]
    notes += left_out
    used, numbers = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], numbers.reshape(-1, 3).astype(np.int32)
    try:
        vertices, triangles, volume, turned = _checked(path, vertices, triangles, mends=raw.volume is None)
    except MeshError as error:
        others = choices(bodies, whose, raw.names) if part is None else ""
        before = f" (before that, {'; '.join(surface.notes)})" if surface.notes else ""
        raise MeshError(f"{error}{others}{before}") from None
    if raw.volume is not None and abs(raw.volume * scale**3 - volume) > ALIKE * volume:
        raise MeshError(
            f"{path}: the cells sum to {raw.volume * scale**3:.6g} m^3, but their boundary encloses {volume:.6g} m^3; "
            "cells overlap, remesh"
        )
    return vertices, triangles, (*notes, *turned, *unit_guess(vertices, scale))


def _checked(path: str, vertices: Floats, triangles: Ints, mends: bool) -> tuple[Floats, Ints, float, tuple[str, ...]]:
    """Vertices, and what `check_surface` returns; where it crosses itself or is several bodies, and may be mended, of
    what comes of that."""
    try:
        return vertices, *check_surface(path, vertices, triangles)
    except Unmended as error:
        if not mends:
            raise
        try:
            mended = mend(path, vertices, triangles)
            if mended is None:
                raise error
            vertices, triangles, expected, note = mended
            triangles, volume, notes = check_surface(path, vertices, triangles)
        except MeshError:
            raise error from None
        if abs(volume - expected) > ALIKE * expected:
            raise
        return vertices, triangles, volume, (note, *notes)


def embed(path: str, vertices: Floats, triangles: Ints, cell: Floats, axes: Floats | None = None) -> Embedded:
    """Cells over the bounding box of a solid, moments of the filled part of each octant, surface points.

    vertices (n, 3) [m], triangles (T, 3) closed and outward, cell: wanted edges (3,) [m]; axes (3, 3): unit vectors
    along which box and cells lie, as columns, those of the scene where None
    """
    axes = np.eye(3) if axes is None else axes
    vertices = vertices @ axes
    corner, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
    counts, edges = divide(size, cell)
    if int(counts.prod()) > _MOST_CELLS:
        box = " x ".join(f"{edge:.3g}" for edge in size)
        raise MeshError(
            f"{path}: {int(counts.prod()):,} cells in a box of {box} m, more than {_MOST_CELLS:,}: "
            "make `cell` larger, or set `scale` (0.001 for a file in mm)"
        )
    moments = moments_of(vertices, triangles, counts)
    fill = moments[..., 0]
    vertices, triangles = refine(vertices, triangles, DRAWN * float(edges.min()))
    points, area, normal, vertex_of = contact_points(vertices, triangles, SPACING * float(edges.min()))
    cell_fill = fill_of_cells(fill)
    kept = cell_fill > DROPPED
    carrier, local = _carry(points, corner, size, counts, cell_fill)
    # inside a concave fold the middle of what a point stands for is outside the solid, where there may be no cell
    stray = ~kept[carrier[:, 0], carrier[:, 1], carrier[:, 2]]
    carrier[stray], local[stray] = _carry(vertex_of[stray], corner, size, counts, cell_fill)
    kept[carrier[:, 0], carrier[:, 1], carrier[:, 2]] = True

    cell_grid, cell_nodes, node_grid = number_nodes(kept)
    number = np.full(kept.shape, -1, dtype=np.int32)
    number[cell_grid[:, 0], cell_grid[:, 1], cell_grid[:, 2]] = np.arange(len(cell_grid))
    carries = number[carrier[:, 0], carrier[:, 1], carrier[:, 2]]
    by_cell = np.argsort(carries, kind="stable")  # kernels take the points of a cell together
    triangles = np.argsort(by_cell).astype(np.int32)[triangles]
    octants_of = moments.reshape(counts[0], 2, counts[1], 2, counts[2], 2, 27).transpose(0, 2, 4, 5, 3, 1, 6)
    in_cells = octants_of[cell_grid[:, 0], cell_grid[:, 1], cell_grid[:, 2]].reshape(-1, 8, 27)

    surface = Surface(carries[by_cell], local[by_cell], area[by_cell], normal[by_cell] @ axes.T, triangles)
    x_rest = (corner + size * (node_grid / (2.0 * counts))) @ axes.T
    spread = float(fill.sum()) / float(in_cells[:, :, 0].sum())
    return Embedded(x_rest, cell_nodes, cell_grid, edges, in_cells, spread, surface, axes)


def moments_of(vertices: Floats, triangles: Ints, counts: Ints) -> Floats:
    """M_pqr of the filled part of each octant (2 nx, 2 ny, 2 nz, 27), of so many cells (3,) over the bounding box."""
    octants = 2 * counts.astype(np.int64)
    lattice = (vertices - vertices.min(axis=0)) * (octants / np.ptp(vertices, axis=0))
    moments = octant_moments(np.ascontiguousarray(np.clip(lattice, 0.0, octants)), triangles, octants)
    fill = moments[..., 0]
    moments[fill < SAME] = 0.0
    moments[fill > 1.0 - SAME] = FULL_MOMENTS
    return np.asarray(moments)


def fill_of_cells(fill: Floats) -> Floats:
    """Filled fraction of each cell (nx, ny, nz) from that of its octants (2 nx, 2 ny, 2 nz)."""
    nx, ny, nz = (n // 2 for n in fill.shape)
    return np.asarray(fill.reshape(nx, 2, ny, 2, nz, 2).mean(axis=(1, 3, 5)))


def _carry(points: Floats, corner: Floats, size: Floats, counts: Ints, cell_fill: Floats) -> tuple[Ints, Floats]:
    """Cell (n, 3) that carries each point and local coordinates (n, 3) in [-1, 1].

    A point on a plane between cells goes to the fuller one, so that no empty cell is kept for its sake.
    """
    position = np.clip((points - corner) * (counts / size), 0.0, counts)
    best_cell = np.zeros((len(points), 3), dtype=np.int32)
    best_fill = np.full(len(points), -1.0)
    for shift in np.ndindex(2, 2, 2):
        moved = position + SAME * (1.0 - 2.0 * np.array(shift))
        cell = np.clip(np.floor(moved), 0, counts - 1).astype(np.int32)
        fill = cell_fill[cell[:, 0], cell[:, 1], cell[:, 2]]
        better = fill > best_fill
        best_cell[better], best_fill[better] = cell[better], fill[better]
    return best_cell, np.clip(2.0 * (position - best_cell) - 1.0, -1.0, 1.0)
