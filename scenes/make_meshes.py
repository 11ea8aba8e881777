"""Make the meshes of the food scenes: `python scenes/make_meshes.py` writes them beside it, in millimetres.

sausage.obj, dumpling.obj and strawberry.obj are tubes of rings between two poles, closed and counter-clockwise from
outside; bowl.obj is a tool, a shell round z;
calamari.vtk is a ring of quadratic hexahedra, pudding.vtk a stump of tetrahedra.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def tube(n_rings: int, n_around: int, section: Callable[[float, Floats], Floats]) -> tuple[Floats, NDArray[np.int64]]:
    """Vertices (n, 3) and triangles (T, 3) of a closed tube.

    section(u, angle) gives points (n_around, 3) of the ring at u in [-1, 1]; at u = -1 and 1 they fall together. Angles
    turn counter-clockwise about +x, from +y to +z.
    """
    u = -np.cos(np.pi * np.arange(n_rings + 2) / (n_rings + 1))  # denser at the ends, where the tube closes
    angle = 2.0 * np.pi * np.arange(n_around) / n_around
    rings = [section(float(value), angle) for value in u[1:-1]]
    poles = [section(end, angle).mean(axis=0, keepdims=True) for end in (-1.0, 1.0)]
    vertices = np.concatenate([*rings, *poles])
    here = np.arange(n_around)
    following = (here + 1) % n_around
    triangles = []
    for ring in range(n_rings - 1):
        a, b = ring * n_around + here, ring * n_around + following
        c, d = b + n_around, a + n_around
        triangles += [np.stack([a, c, d], axis=1), np.stack([a, b, c], axis=1)]
    first, last = n_rings * n_around, n_rings * n_around + 1
    end = (n_rings - 1) * n_around
    triangles.append(np.stack([np.full(n_around, first), following, here], axis=1))
    triangles.append(np.stack([np.full(n_around, last), end + here, end + following], axis=1))
    return vertices, np.concatenate(triangles)


def sausage() -> tuple[Floats, NDArray[np.int64]]:
    """A sausage 120 mm long and 22 mm thick, bent by 6 mm in the plane of the table."""
    length, radius, bend = 120.0, 11.0, 6.0

    def section(u: float, angle: Floats) -> Floats:
        r = radius * np.sqrt(max(0.0, 1.0 - abs(u) ** 6)) * (1.0 + 0.03 * np.sin(5.0 * u))
        middle = bend * (1.0 - u * u)
        return np.stack([np.full_like(angle, 0.5 * length * u), middle + r * np.cos(angle), r * np.sin(angle)], axis=1)

    return tube(38, 20, section)


def dumpling() -> tuple[Floats, NDArray[np.int64]]:
    """A half-moon 80 mm long: a full belly on a flat base, closed at the top by a pleated seam; no two sides alike."""
    length, width, height, bend, pleats = 80.0, 34.0, 36.0, 9.0, 5.0

    def section(u: float, angle: Floats) -> Floats:
        open_ = np.sqrt(max(0.0, 1.0 - u * u))
        tall = height * open_**0.8 * (1.0 + 0.05 * u)
        wide = width * open_ * (1.0 - 0.06 * np.sin(3.0 * u))
        rise = 0.5 * (1.0 + np.sin(angle))  # 0 at the base, 1 at the seam
        side = 0.5 * wide * np.cos(angle) * (1.0 - 0.72 * rise**1.5)
        # Both sides of the seam swing together, so pleats never fold the wall into itself.
        pleat = 2.6 * open_ * rise**4 * np.sin(2.0 * np.pi * pleats * 0.5 * (u + 0.1 * u * u))
        y = side + pleat + bend * u * u
        z = tall * np.maximum(rise, 0.08) + (height - tall) * 0.12
        return np.stack([np.full_like(angle, 0.5 * length * u), y, z], axis=1)

    return tube(46, 24, section)


def strawberry() -> tuple[Floats, NDArray[np.int64]]:
    """A strawberry that lies, 36 mm long and 28 mm thick at its shoulders, without its leaves; no two sides alike."""
    length, radius = 36.0, 14.0

    def section(u: float, angle: Floats) -> Floats:
        r = radius * np.sqrt(max(0.0, 1.0 - u * u)) * (1.0 - 0.28 * u) * 0.96
        y, z = r * (1.0 + 0.03 * np.cos(2.0 * angle)) * np.cos(angle), r * np.sin(angle)
        return np.stack([np.full_like(angle, 0.5 * length * u), y + 0.8 * u * u, z], axis=1)

    return tube(14, 18, section)


def bowl() -> tuple[Floats, NDArray[np.int64]]:
    """A bowl 240 mm wide and 90 mm high, with a wall of 6 mm and a flat foot."""
    n_around, n_up = 36, 10
    angle = 2.0 * np.pi * np.arange(n_around) / n_around
    t = np.linspace(0.0, 1.0, n_up)
    inside = np.stack([40.0 + 74.0 * np.sin(0.5 * np.pi * t), 6.0 + 84.0 * (1.0 - np.cos(0.5 * np.pi * t))], axis=1)
    outside = np.stack([inside[:, 0] + 6.0, np.maximum(inside[:, 1] - 6.0 * (1.0 - t), 0.0)], axis=1)
    profile = np.concatenate([inside[::-1], outside])  # from the rim down, and up again outside
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full_like(angle, z)], axis=1) for r, z in profile]
    here, n = np.arange(n_around), len(profile)
    following, triangles = (here + 1) % n_around, []
    for ring in range(n):
        if ring == n_up - 1:
            continue  # the foot, inside and outside, is closed by two discs
        a, b = ring * n_around + here, ring * n_around + following
        c, d = (ring + 1) % n * n_around + here, (ring + 1) % n * n_around + following
        triangles += [np.stack([a, d, c], axis=1), np.stack([a, b, d], axis=1)]
    foot, vertices = (n_up - 1) * n_around, np.concatenate(rings)
    for first, at, turn in ((foot, profile[n_up - 1, 1], 1), (foot + n_around, profile[n_up, 1], -1)):
        vertices = np.concatenate([vertices, [[0.0, 0.0, at]]])
        sides = np.stack([np.full(n_around, len(vertices) - 1), first + here, first + following], axis=1)
        triangles.append(sides[:, ::turn])
    return vertices, np.concatenate(triangles)


def calamari() -> tuple[Floats, NDArray[np.int64]]:
    """A ring of squid about y, 40 mm across, 12 mm wide, 7 mm thick: points, and 16 x 2 x 1 cells of 27 nodes."""
    around, through, along = 16, 2, 1
    k, j, i = np.meshgrid(np.arange(2 * around), np.arange(2 * through + 1), np.arange(2 * along + 1), indexing="ij")
    angle, radius = np.pi * k.ravel() / around, 13.0 + 7.0 * j.ravel() / (2 * through)
    # a little egg-shaped, and thinner on one side, as squid is
    radius *= 1.0 + 0.03 * np.cos(angle) * j.ravel() / (2 * through)
    points = np.stack([radius * np.sin(angle), 6.0 - 6.0 * i.ravel() / along, 20.0 - radius * np.cos(angle)], axis=1)
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 2], [2, 0, 2], [2, 2, 2], [0, 2, 2]])
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    faces = [(0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 1, 2, 3), (4, 5, 6, 7)]
    middles = [corners[list(group)].sum(axis=0) // len(group) for group in (*edges, *faces)]
    local = np.concatenate([corners, middles, [[1, 1, 1]]])  # i along y, j outwards, k around
    cells = []
    for turn in range(around):
        for layer in range(through):
            i, j, k = (local + np.array([0, 2 * layer, 2 * turn])).T
            cells.append(i + (2 * along + 1) * (j + (2 * through + 1) * (k % (2 * around))))
    return points, np.array(cells)


def pudding() -> tuple[Floats, NDArray[np.int64]]:
    """A pudding turned out of its mould, 64 mm wide below, 44 above, 40 high: points, and 6 tetrahedra a cube."""
    n, tall = 6, 4
    k, j, i = (each.ravel() for each in np.meshgrid(np.arange(tall + 1), *2 * [np.arange(n + 1)], indexing="ij"))
    x, y, z = 2.0 * i / n - 1.0, 2.0 * j / n - 1.0, k / tall
    # Between a square and a disc: a disc would flatten the tetrahedra at the square's corners.
    round_x, round_y = x * np.sqrt(1.0 - 0.5 * y * y), y * np.sqrt(1.0 - 0.5 * x * x)
    radius = 32.0 - 10.0 * z + 2.0 * np.sin(np.pi * z)
    points = np.stack([radius * (0.25 * x + 0.75 * round_x), radius * (0.25 * y + 0.75 * round_y), 40.0 * z], axis=1)
    corner = np.flatnonzero((i < n) & (j < n) & (k < tall))
    step = np.array([1, n + 1, (n + 1) ** 2])
    cells = []
    for order in permutations(range(3)):  # Kuhn's: from one corner of a cube to the other along its edges
        way = corner[:, None] + np.concatenate([[0], np.cumsum(step[list(order)])])
        even = np.linalg.det(np.eye(3)[list(order)]) > 0.0
        cells.append(way if even else way[:, [0, 2, 1, 3]])
    return points, np.concatenate(cells)


MESHES = {"sausage.obj": sausage, "dumpling.obj": dumpling, "strawberry.obj": strawberry, "bowl.obj": bowl}


def obj_text(name: str) -> str:
    """One mesh as Wavefront OBJ, coordinates to 0.1 um."""
    vertices, triangles = MESHES[name]()
    lines = [f"# {name}: made by make_meshes.py, millimetres"]
    # + 0.0 turns a negative zero, which a rounding may leave, into zero.
    lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in np.round(vertices, 4) + 0.0]
    lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    return "\n".join(lines) + "\n"


SOLIDS = {"calamari.vtk": (calamari, 29), "pudding.vtk": (pudding, 10)}
"""and the numbers that VTK gives to their cells"""


def vtk_text(name: str) -> str:
    """One solid in VTK's legacy format, coordinates to 0.1 um."""
    make, number = SOLIDS[name]
    points, cells = make()
    corners = cells.shape[1]
    lines = ["# vtk DataFile Version 3.0", "made by make_meshes.py, millimetres", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines += [f"POINTS {len(points)} double"]
    lines += [f"{x:.4f} {y:.4f} {z:.4f}" for x, y, z in np.round(points, 4) + 0.0]
    lines += [f"CELLS {len(cells)} {(corners + 1) * len(cells)}"]
    lines += [f"{corners} " + " ".join(map(str, cell)) for cell in cells.tolist()]
    lines += [f"CELL_TYPES {len(cells)}", *[str(number)] * len(cells)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    for mesh_name in MESHES:
        (Path(__file__).parent / mesh_name).write_text(obj_text(mesh_name), encoding="ascii")
    for mesh_name in SOLIDS:
        (Path(__file__).parent / mesh_name).write_text(vtk_text(mesh_name), encoding="ascii")
