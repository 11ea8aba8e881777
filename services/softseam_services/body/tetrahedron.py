"""A cell that is a tetrahedron: which of a cell's nodes and octants it has, and its functions.

It is one of the six tetrahedra that Kuhn divides a cell's cube into, with corners at (0, 0, 0), (2, 0, 0), (2, 2, 0)
and (2, 2, 2) of the lattice: these and the middles of its edges are the ten lattice nodes with i >= j >= k, and no
other is there. Middles of edges divide it into eight tetrahedra of one volume: one at each corner, and four around the
diagonal from the middle of 03, node (1, 1, 1), to that of 12. Four octants of the cube have one or three of these, the
others are empty. With barycentric coordinates L the ten quadratic functions are
  L_a (2 L_a - 1) at corners,  4 L_a L_b in the middle of the edge a b                                            (1)
and the linear ones of the eight, with p = L0 + L1 - L2 - L3, q = L0 + L2 - L1 - L3, r = L0 + L3 - L1 - L2,
  2 L_a - 1 at a and 2 L_b in the middle of a b where L_a >= 1/2;  else p+, p-, q+, q- in the middles of 01, 23, 02, 13
  and (1 - |p| - |q| + r)/2, (1 - |p| - |q| - r)/2 in those of 03, 12                                             (2)
"""

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.lattice import LOCAL

NODES = np.array([0, 2, 8, 26, 1, 5, 4, 13, 14, 17], dtype=np.int32)
"""local ids of its corners, and of the middles of the edges 01 12 02 03 13 23 (10,)"""
CORNERS, MIDDLES = NODES[:4], NODES[4:]
CENTRE = 7
"""place among NODES of the middle of 03, the centre of the cell's cube"""
ENDS = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
"""corners at the ends of the edges in that order (6, 2)"""
PARTS = np.array(
    [[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3], [7, 5, 8, 4], [7, 5, 9, 8], [7, 5, 6, 9], [7, 5, 4, 6]]
)
"""places among NODES of the corners of the eight tetrahedra, with positive volume (8, 4)"""
OF_PARTS = np.array([0, 1, 3, 7, 1, 3, 3, 1])
"""octant that each is in (8,)"""
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""corners of the face that lacks each, counter-clockwise from outside (4, 3)"""
SHARES = np.array([1.0, 3.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0]) / 8.0
"""of its volume in each octant (8,)"""
FILL = np.sign(SHARES)
"""octants that have some of it (8,)"""
_PLACES: Floats = LOCAL[CORNERS].astype(np.float64) - 1.0


def _samples() -> Floats:
    near, far = (5.0 + 3.0 * np.sqrt(5.0)) / 20.0, (5.0 - np.sqrt(5.0)) / 20.0
    found = np.full((8, 4), 0.25)
    for corner, octant in enumerate((0, 1, 3, 7)):
        one = octant in (0, 7)
        found[octant] = far if one else (near + 5.0 * far) / 6.0
        found[octant, corner] = near if one else 0.5 * (near + far)
    return found


SAMPLES = _samples()
"""barycentric coordinates of the place whose stress each octant reports, of tet10's points by their shares: of a linear
stress it is exact (8, 4)"""


def shape_functions(barycentric: Floats) -> tuple[Floats, Floats]:
    """Eq. (1) at points (n, 4): values (n, 10), and slopes by the second to fourth coordinate (n, 10, 3)."""
    slope, (a, b) = np.concatenate([-np.ones((1, 3)), np.eye(3)]), ENDS.T
    corners, middles = barycentric * (2.0 * barycentric - 1.0), 4.0 * barycentric[:, a] * barycentric[:, b]
    along = (4.0 * barycentric - 1.0)[:, :, None] * slope
    across = 4.0 * (barycentric[:, a, None] * slope[b] + barycentric[:, b, None] * slope[a])
    return np.concatenate([corners, middles], axis=1), np.concatenate([along, across], axis=1)


def linear_functions(barycentric: Floats) -> Floats:
    """Eq. (2) at points (n, 4): (n, 10)."""
    value = np.zeros((len(barycentric), 10))
    p, q, r = (barycentric @ np.array([[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0], [1.0, -1.0, -1.0, 1.0]]).T).T
    rest = 1.0 - np.abs(p) - np.abs(q)
    value[:, 4:] = np.stack([p, 0.5 * (rest - r), q, 0.5 * (rest + r), -q, -p], axis=1)
    value[:, [4, 6, 8, 9]] = np.maximum(value[:, [4, 6, 8, 9]], 0.0)
    for corner in range(4):
        at = barycentric[:, corner] >= 0.5
        value[at] = 0.0
        value[at, corner] = 2.0 * barycentric[at, corner] - 1.0
        for edge in np.flatnonzero((ENDS == corner).any(axis=1)):
            value[at, 4 + edge] = 2.0 * barycentric[at, ENDS[edge].sum() - corner]
    return value


def barycentric_of(local: Floats) -> Floats:
    """Barycentric coordinates (n, 4) of places in the cell's cube, local (n, 3) in [-1, 1]."""
    t = 0.5 * (local + 1.0)
    return np.stack([1.0 - t[:, 0], t[:, 0] - t[:, 1], t[:, 1] - t[:, 2], t[:, 2]], axis=1)


def local_of(barycentric: Floats) -> Floats:
    """The places in the cell's cube (n, 3) of barycentric coordinates (n, 4)."""
    return np.asarray(barycentric @ _PLACES)
