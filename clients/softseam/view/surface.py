"""The body's true surface, ready to draw: crisp edges, region of each triangle, stress at each vertex.

Notation: P surface points, V display vertices (points, split where the surface has an edge), T triangles, C cells.
"""

import numpy as np
from numpy.typing import NDArray

from softseam.observation import von_mises
from softseam_protocol.messages.recording import SurfaceMesh
from softseam_protocol.messages.session import Frame

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CREASE = 40.0
"""angle between triangles from which on their edge is drawn sharp [degrees]"""


class DisplaySurface:
    """Built once from the rest state, then asked for every frame."""

    def __init__(self, mesh: SurfaceMesh) -> None:
        triangles = mesh.triangles.astype(np.int64)
        self.vertex_point, self.triangles = _split_creases(mesh.point_rest, triangles)
        """surface point of each display vertex (V,); corners as display vertices (T, 3)"""
        self._octant_ids, self._octant_weights = _in_one_material(mesh, *_octant_stencil(mesh))
        self._triangle_cell = _cells_of(mesh, mesh.point_rest[triangles].mean(axis=1))
        self.cell_lines = _cell_lines(mesh, triangles)
        """ends of the lines where cells' faces meet a flat surface, as surface points (L, 2)"""
        self.border_lines = mesh.border_lines.astype(np.int64)
        """ends of the lines along borders of materials, as nodes (B, 2)"""
        self.extent = float(np.ptp(mesh.point_rest, axis=0).max()) if len(mesh.point_rest) else 1.0
        """longest side of the bounding box at rest [m]"""
        boxes = mesh.fill.mean(axis=1) * float(np.prod(mesh.edges))
        self._cell_volume = mesh.cell_volume if len(mesh.cell_volume) else boxes
        self._in_cells = len(mesh.cell_center) > 0
        self.load_label, self.load_factor = ("von Mises stress [kPa]", 1e-3) if self._in_cells else ("stretch [%]", 1e2)
        """what `load` gives, and the factor to the unit that it is shown in"""

    def vertices(self, point_x: Floats) -> Floats:
        """Positions of the display vertices (V, 3) [m]."""
        return np.asarray(point_x[self.vertex_point])

    def normals(self, vertices: Floats) -> Floats:
        """Outward unit normals of the display vertices, weighted by area (V, 3)."""
        a, b, c = (vertices[self.triangles[:, i]] for i in range(3))
        face = np.cross(b - a, c - a)
        normal = np.zeros_like(vertices)
        for axis in range(3):
            spread = np.repeat(face[:, axis], 3)
            normal[:, axis] = np.bincount(self.triangles.ravel(), weights=spread, minlength=len(vertices))
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))

    def near(self, cell_near: NDArray[np.int8]) -> NDArray[np.bool_]:
        """Which triangles belong to the near region (T,)."""
        if not self._in_cells:
            return np.zeros(len(self.triangles), dtype=np.bool_)
        return np.asarray(cell_near[self._triangle_cell] != 0)

    def load(self, frame: Frame) -> Floats:
        """What the body bears at its surface points: von Mises stress [Pa], or a sheet's stretch [1] (P,); 0 where
        its model reports none."""
        if self._in_cells:
            return self.at_points(von_mises(frame.cauchy))
        return frame.point_strain if len(frame.point_strain) else np.zeros(len(frame.point_x))

    def at_points(self, octant_values: Floats) -> Floats:
        """A value per octant (C, 8), interpolated to the surface points (P,)."""
        flat = octant_values.reshape(-1)
        return np.asarray((flat[self._octant_ids] * self._octant_weights).sum(axis=1))

    def energy_density(self, cell_energy: Floats) -> Floats:
        """Energy of each cell (C,) [J] over its filled volume, interpolated to the surface points (P,) [J/m^3].

        Zero where a recording has no energies.
        """
        if not len(cell_energy) or len(cell_energy) != len(self._cell_volume):
            return np.zeros(len(self._octant_ids))
        return self.at_points(np.repeat((cell_energy / np.maximum(self._cell_volume, 1e-300))[:, None], 8, axis=1))


def error_energy(frame: Frame) -> Floats:
    """Energy by which each cell is off, model and mesh together (C,) [J]; empty where nobody asked for it."""
    indicators = frame.indicators
    return np.zeros(0) if indicators is None else indicators.model_error + indicators.mesh_error


def _split_creases(points: Floats, triangles: Ints) -> tuple[Ints, Ints]:
    """Give each point one vertex for every smooth patch of triangles around it.

    Corners of triangles are joined when their triangles share an edge at that point that is not sharp.
    """
    n = len(triangles)
    face = np.cross(
        points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    )
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-300)
    # half edges, brought together in pairs
    start, stop = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    triangle = np.repeat(np.arange(n), 3)
    key = np.minimum(start, stop) * (len(points) + 1) + np.maximum(start, stop)
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = order[pair], order[pair + 1]
    smooth = np.einsum("ij,ij->i", face[triangle[first]], face[triangle[second]]) > np.cos(np.radians(CREASE))
    first, second = first[smooth], second[smooth]
    # a half edge h of triangle t runs from corner h to the next; both ends are corners of both triangles
    following = np.arange(3 * n).reshape(n, 3)[:, [1, 2, 0]].ravel()
    same = start[first] == start[second]
    joined = np.concatenate(
        [
            np.stack([first, np.where(same, second, following[second])], axis=1),
            np.stack([following[first], np.where(same, following[second], second)], axis=1),
        ]
    )
    label = _components(3 * n, joined)
    _, corner, vertex = np.unique(label, return_index=True, return_inverse=True)
    return start[corner], vertex.reshape(n, 3)


def _components(n: int, edges: Ints) -> Ints:
    """Smallest member of each node's connected component, by repeated minimum over edges (n,)."""
    label = np.arange(n)
    while True:
        low = np.minimum(label[edges[:, 0]], label[edges[:, 1]])
        lowered = label.copy()
        np.minimum.at(lowered, edges[:, 0], low)
        np.minimum.at(lowered, edges[:, 1], low)
        lowered = lowered[lowered]
        if np.array_equal(lowered, label):
            return label
        label = lowered


def _octant_stencil(mesh: SurfaceMesh) -> tuple[Ints, Floats]:
    """Trilinear weights of the filled octants around each surface point: ids (P, 8), weights (P, 8) that sum to 1."""
    if not len(mesh.cell_center):
        return np.zeros((len(mesh.point_rest), 8), dtype=np.int64), np.zeros((len(mesh.point_rest), 8))
    if len(mesh.point_octants):
        there = mesh.point_octants >= 0
        return np.maximum(mesh.point_octants, 0).astype(np.int64), there / there.sum(axis=1, keepdims=True)
    step, (center, point) = 0.5 * mesh.edges, (at @ mesh.axes for at in (mesh.cell_center, mesh.point_rest))
    origin = center.min(axis=0) - mesh.edges
    cell = np.rint((center - origin) / mesh.edges - 1.0).astype(np.int64)
    local = np.array([[o & 1, o >> 1 & 1, o >> 2 & 1] for o in range(8)])
    octant = (2 * cell[:, None, :] + local + 1).reshape(-1, 3)  # one empty layer all around
    counts = octant.max(axis=0) + 3
    table = np.full(counts, -1, dtype=np.int64)
    filled = mesh.fill.reshape(-1) > 0.0
    table[tuple(octant[filled].T)] = np.flatnonzero(filled)
    # centre of octant index i lies at origin + edges / 2 + (i - 1/2) step
    at = (point - origin - 0.5 * mesh.edges) / step + 0.5
    low = np.clip(np.floor(at).astype(np.int64), 0, counts - 2)
    part = np.clip(at - low, 0.0, 1.0)
    corner = low[:, None, :] + local
    ids = table[corner[..., 0], corner[..., 1], corner[..., 2]]
    weights = np.where(local == 1, part[:, None, :], 1.0 - part[:, None, :]).prod(axis=2)
    weights = np.where(ids >= 0, np.maximum(weights, 1e-9), 0.0)
    total = weights.sum(axis=1, keepdims=True)
    return np.maximum(ids, 0), weights / np.where(total > 0.0, total, 1.0)


def _in_one_material(mesh: SurfaceMesh, ids: Ints, weights: Floats) -> tuple[Ints, Floats]:
    """The stencil without octants of another material than the nearest one's: stress jumps where materials meet."""
    if not len(mesh.octant_material):
        return ids, weights
    material = mesh.octant_material.reshape(-1)[ids]
    nearest = np.take_along_axis(material, weights.argmax(axis=1)[:, None], axis=1)
    weights = np.where(material == nearest, weights, 0.0)
    return ids, weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)


def _cell_lines(mesh: SurfaceMesh, triangles: Ints) -> Ints:
    """Edges of triangles that lie on two planes of the cell grid: one is the surface, the other cuts it."""
    if not len(mesh.cell_center):
        return np.zeros((0, 2), dtype=np.int64)
    if len(mesh.point_octants):
        return mesh.cell_lines.astype(np.int64)
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    least = (mesh.cell_center @ mesh.axes).min(axis=0) - 0.5 * mesh.edges
    at = (mesh.point_rest @ mesh.axes - least) / mesh.edges
    first, second = at[ends[:, 0]], at[ends[:, 1]]
    on_plane = (np.abs(first - np.rint(first)) < 1e-6) & (np.abs(first - second) < 1e-6)
    return np.asarray(ends[on_plane.sum(axis=1) >= 2])


def _cells_of(mesh: SurfaceMesh, at: Floats) -> Ints:
    """The cell that holds, or else is nearest to, each position at rest (n,)."""
    if not len(mesh.cell_center):
        return np.zeros(len(at), dtype=np.int64)
    if len(mesh.point_octants):
        return np.asarray([int(np.argmin(((mesh.cell_center - x) ** 2).sum(axis=1))) for x in at], dtype=np.int64)
    center, at = mesh.cell_center @ mesh.axes, at @ mesh.axes
    origin = center.min(axis=0)
    grid = np.rint((center - origin) / mesh.edges).astype(np.int64)
    counts = grid.max(axis=0) + 1
    table = np.full(counts, -1, dtype=np.int64)
    table[tuple(grid.T)] = np.arange(len(grid))
    index = np.clip(np.rint((at - origin) / mesh.edges).astype(np.int64), 0, counts - 1)
    found = table[tuple(index.T)]
    for lost in np.flatnonzero(found < 0):
        found[lost] = int(np.argmin(((center - at[lost]) ** 2).sum(axis=1)))
    return np.asarray(found)
