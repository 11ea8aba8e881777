"""The body in cells: what both models share, built once from a scene and never changed.

Local order. A cell has 27 nodes on a 3 x 3 x 3 lattice, a = i + 3 j + 9 k with i, j, k in {0, 1, 2} along x, y, z, and
8 octants, o = i + 2 j + 4 k with i, j, k in {0, 1}. Octant (i, j, k) has the 8 corner nodes
(i + ci) + 3 (j + cj) + 9 (k + ck). FEM takes a cell as one hex27; PBD takes it as 8 hex8 blocks, one an octant:
same nodes, same masses, same energy density. A cell that is a tetrahedron has ten of these nodes (`tetrahedron`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.friction_field import EVEN, FrictionField

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SAME = 1e-9
"""relative: places, ways, times and masses that differ by less are the same, for files and sums are rounded"""
ALIKE = 1e-6
"""relative: what is fitted, or found by iteration, is alike where it differs by less"""


STEADIES = 0.1
"""how much of a branch's modulus counts in the matrix that steadies points of reduced quadrature, and does not fade"""


@dataclass(frozen=True)
class Material:
    """Elastic constants, and the kernels' view of them (`materials.point`)."""

    kind: str
    """as in the scene file"""
    mu: float
    """shear modulus [Pa]"""
    lambda_: float
    """first Lame constant [Pa]"""
    density: float
    """at rest [kg/m^3]"""
    number: int
    """of the law in `materials.point`"""
    parameters: Floats
    """of the law, in its own order (MAX_PARAMETERS,)"""
    splits: bool = False
    """mu/2 I1 splits off the energy, see `materials.Law`"""
    small: bool = False
    """the law holds for small strains only"""
    retardation_time: float = 0.0
    """viscosity over stiffness, of the whole body [s]"""
    n_state: int = 0
    """numbers that the law remembers; 0 of an elastic one"""
    respond: int = 0
    """of a law with state, whose `number` is 0, as of `materials.with_state`"""
    relaxation: tuple[tuple[float, float], ...] = ()
    """share of mu that fades [1], and the time in which it does [s], of each branch"""
    yielding: float = 0.0
    """share of mu that yields [1]"""
    strength: float = inf
    """von Mises stress at which it would break, inf where nobody says [Pa]"""

    @property
    def n_branches(self) -> int:
        """Springs beside the law that relax or yield."""
        return len(self.relaxation) + (self.yielding > 0.0)

    @property
    def elastic(self) -> ElasticConstants:
        """Of a quick load."""
        return ElasticConstants(self.mu, self.lambda_)

    @property
    def lasting(self) -> ElasticConstants:
        """Of a load that is held for long."""
        return self.elastic.relaxed(self.yielding + sum(share for share, _ in self.relaxation))

    @property
    def steadying(self) -> float:
        """Shear modulus with which what steadies an element counts [Pa], see `STEADIES`."""
        return self.lasting.mu + STEADIES * (self.mu - self.lasting.mu)

    @property
    def wave_speed(self) -> float:
        """P-wave speed at rest [m/s]."""
        return self.elastic.pressure_speed(self.density)

    @property
    def young(self) -> float:
        """Young's modulus [Pa]."""
        return self.elastic.young


@dataclass(frozen=True)
class Surface:
    """Points of the true surface: contact, display and stress read-out happen here (P points, T triangles).

    On a block the points are the lattice nodes of the surface (each weight is one node). On a surface that runs through
    cells tools press points that are corners of no triangle, and edges of the solid (`surface_points`).
    """

    cell: Ints
    """cell that carries each point (P,)"""
    local: Floats
    """coordinates in that cell, each in [-1, 1] (P, 3)"""
    area: Floats
    """rest area that the point stands for in contact [m^2]; 0 where it is for display only (P,)"""
    normal: Floats
    """outward unit normal at rest (P, 3)"""
    triangles: Ints
    """counter-clockwise from outside (T, 3)"""


@dataclass(frozen=True)
class Body:
    """N nodes, C cells."""

    x_rest: Floats
    """(N, 3) [m]"""
    cell_nodes: Ints
    """global node ids in local order (C, 27)"""
    cell_grid: Ints
    """indices of each cell in the grid (C, 3); of a file's hexahedra only where they lie, roughly"""
    edges: Floats
    """edge lengths of a cell (3,) [m], see `boxes`; a PBD block is half of that"""
    fill: Floats
    """filled fraction of each octant, in (0, 1], or 0 (C, 8)"""
    cell_mass: Floats
    """mass that each cell gives to each of its nodes, all > 0 where a filled octant touches the node (C, 27) [kg]"""
    fixed: NDArray[np.bool_]
    """clamped nodes (N,)"""
    materials: tuple[Material, ...]
    """the body's own, then those of its inclusions, all of one law (m,)"""
    octant_material: Ints
    """number of each octant's material (C, 8)"""
    surface: Surface
    gravity: Floats
    """(3,) [m/s^2]"""
    v_initial: Floats
    """(N, 3) [m/s]"""
    moments: Floats = field(default_factory=lambda: np.zeros((0, 8, 27)))
    """M_pqr of the part of each octant that the shape fills, see `filled`; (0, 8, 27) where all are full (C, 8, 27)"""
    boxes: bool = True
    """cells are boxes with `edges`; else hexahedra of any shape, wholly filled, or tetrahedra: `edges` has the shortest
    edge of all"""
    axes: Floats = field(default_factory=lambda: np.eye(3))
    """unit vectors along which boxes have these edges, as columns (3, 3)"""
    tetrahedra: bool = False
    """cells are tetrahedra, with the nodes and octants that `tetrahedron` says; their other places repeat a node"""
    damping: float = 0.0
    """drag of still air: force over mass and velocity [1/s]"""
    friction_field: FrictionField = EVEN
    """factor on friction with every tool"""
    notes: tuple[str, ...] = ()
    """what the importer repaired or wants to say"""
    made_of: ClassVar[Literal["cells"]] = "cells"
    has_cells: ClassVar[Literal[True]] = True
    radius: ClassVar[float] = 0.0
    """distance that tools keep from its surface [m]"""

    @property
    def material(self) -> Material:
        """The body's own, which every octant outside inclusions has."""
        return self.materials[0]

    @property
    def relaxes(self) -> bool:
        """Whether branches that relax or yield are beside the law of any of its materials."""
        return any(material.n_branches for material in self.materials)

    @property
    def cut(self) -> bool:
        """Whether its surface runs through cells: then their nodes may be outside, and do not bound it."""
        return len(self.moments) > 0

    @property
    def wave_speed(self) -> float:
        """The fastest P-wave speed of its materials [m/s]."""
        return max(material.wave_speed for material in self.materials)

    @property
    def mean_density(self) -> float:
        """[kg/m^3]"""
        if len(self.materials) == 1:
            return self.material.density
        weight = self.fill if self.boxes else np.ones_like(self.fill)
        return float(np.average(self.of_octants([material.density for material in self.materials]), weights=weight))

    def of_octants(self, values: Sequence[float]) -> Floats:
        """One value a material (m,) as one an octant (C, 8)."""
        return np.asarray(values, dtype=np.float64)[self.octant_material]

    @property
    def n_nodes(self) -> int:
        return len(self.x_rest)

    @property
    def n_cells(self) -> int:
        return len(self.cell_nodes)

    @property
    def n_points(self) -> int:
        """Surface points."""
        return len(self.surface.cell)

    @property
    def total_mass(self) -> float:
        """[kg]"""
        return float(self.cell_mass.sum())

    def along_axes(self, vectors: Floats) -> Floats:
        """Components of vectors (..., 3) along the axes of its boxes."""
        return np.asarray(vectors @ self.axes)

    def from_axes(self, components: Floats) -> Floats:
        """Vectors (..., 3) with these components along the axes of its boxes."""
        return np.asarray(components @ self.axes.T)

    @property
    def resolution(self) -> float:
        """Least edge of a cell [m]."""
        return float(self.edges.min())


@dataclass(frozen=True)
class Region:
    """Some cells of a body, numbered on their own: what a participant computes with (n nodes, c cells, p points)."""

    cells: Ints
    """global cell ids, ascending (c,)"""
    nodes: Ints
    """global node ids, ascending (n,)"""
    cell_nodes: Ints
    """local node ids (c, 27)"""
    mass: Floats
    """mass of this region's cells only (n,) [kg]"""
    fixed: NDArray[np.bool_]
    seam: Ints
    """local ids of the seam nodes, in the order of the request (s,)"""
    points: Ints
    """global ids of the surface points carried by these cells, ascending (p,)"""
    point_cell: Ints
    """local cell ids (p,)"""
    point_local: Floats
    """coordinates in that cell, each in [-1, 1], but beyond a seam of points that its owner carries (p, 3)"""
