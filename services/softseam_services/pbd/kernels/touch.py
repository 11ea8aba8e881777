"""What touches what in a pile as a step begins: points of either surface near faces of the other, each a row.

A row is of a point and a triangle: the point x_p and the corners x_i, as rows of the pile's xw, with the weights s of
the corners and the normal n out of the triangle, kept over the step; `between` solves it. Where surfaces are not both
of nodes that are as far apart, only one of them presses, by points that follow its nodes, and rows, of points and
corners as the surfaces count them, are for `gather`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interfaces.contact import REACH
from softseam_services.body.body import Floats, Ints
from softseam_services.jit import njit, record

POINT, CORNER, SIDE, PLACE, RANK = 0, 1, 4, 5, 6
N_INTS = 7
"""of a row: point and three corners, as rows of the pile's xw, or points of their surfaces where these meet by patches;
2 m + k of the points of the k-th body in meeting m; place of the point among forces; 0 where a force is carried or the
point is inside, else 1"""
SHARE, NORMAL, SOFT, GIVES, RUB = 0, 3, 6, 7, 8
N_NUMBERS = 9
"""of a row: s (3,), n (3,), alpha [m/N], c/h^2 [1/kg], mu, see `between`"""
AREA, GAP, FADE = 6, 7, 8
"""of one for patches in place of the last three: what the point stands for [m^2], how far it is from the triangle as
the step begins [m], and how much it counts for how far it will be [1]"""

LISTED, LISTED_OF_MESHES = 16, 64
"""triangles that are listed for a point at most, also where there are surfaces through cells; where more come into
question, all are tried"""
MARGIN = REACH / 2
"""of the points' spacing: how far bodies move against one another before triangles are listed again [1]"""


@record
class Touch(NamedTuple):
    """What touches what in a pile: b bodies, its own and then guests, s surfaces: of each body's nodes, of guests, and
    of own bodies by points that follow their nodes; p points of these in all, t triangles, m meetings of two surfaces,
    f points that press in all meetings, k forces, r rows."""

    body: Ints
    """of each surface (s,)"""
    first: Ints
    """of the points of each surface (s + 1,)"""
    node: Ints
    """of each point that is one, in its body (p,)"""
    row: Ints
    """of each own body's first node in the pile's xw"""
    number: Ints
    """of each row there among the nodes that its body's surface is of, or follows"""
    follow: Ints
    """first of the nodes that each point of the last surfaces follows, and the end of the last"""
    follows: Ints
    """these, in their bodies"""
    by: Floats
    """and their weights [1]"""
    first_triangle: Ints
    """(s + 1,)"""
    corners: Ints
    """of triangles, points of their surface, counted from its first (t, 3)"""
    rounded: NDArray[np.bool_]
    """see `SampledFaces` (t, 3)"""
    upon: Ints
    """likewise (p, 3)"""
    upon_share: Floats
    """(p, 3)"""
    curved: NDArray[np.bool_]
    """surfaces for which these say more than that each triangle, and each point, has its own normal (s,)"""
    area: Floats
    """that each point stands for (p,) [m^2]"""
    inverse_mass: Floats
    """of each that is a node (p,) [1/kg]"""
    yields: Floats
    """how far each surface sinks in under a pressure (s,) [m/Pa]"""
    octant: Floats
    """see `bulges.Lattice` (p, 3)"""
    rise: Floats
    """(p, 3) [m]"""
    spread: Floats
    """(p, 3) [m^2]"""
    mean: Floats
    """(p,) [1/m]"""
    light: Floats
    """q of eq. (1) of `flattening` (s,) [1]"""
    spacing: Floats
    """of its nodes (s,) [m]"""
    pair: Ints
    """bodies that meet (m, 2)"""
    sides: Ints
    """and which of their surfaces do (m, 2)"""
    friction: Floats
    """(m,)"""
    visits: NDArray[np.bool_]
    """whether what they find is for patches (m,)"""
    around: Ints
    """around nodes of which of the two these are, 0 or 1 (m,)"""
    presses: Floats
    """how much of its area each of the two presses with (m, 2) [1]"""
    place: Ints
    """first of the points of each of the two, among all f (m, 2)"""
    held: Ints
    """first of the forces on each, among all k, and the end of the last (m, 2, 2)"""
    # where bodies are
    guest_at: Floats
    """points of guests as the step begins (q, 3) [m]"""
    guest_to: Floats
    """and as it ends"""
    at: Floats
    """points as the step begins (p, 3) [m]"""
    to: Floats
    """and as it ends, if all goes on"""
    out: Floats
    """unit vectors out of the surface then (p, 3)"""
    faces: Floats
    """triangles then, see `look_at_surface` (t, N_OF_FACE)"""
    fresh: NDArray[np.bool_]
    """of which surfaces these two were found in this step (s,)"""
    box: Floats
    """lower and upper corner of the box around the points then (s, 6) [m]"""
    halo: Floats
    """and of a box so much larger that nothing in the step reaches bodies whose own is apart (s, 6)"""
    way: Floats
    """of each surface, see `_find_way` (s, 4)"""
    middle: Floats
    """m of eq. (1) of each surface, and its s (s, 4) [m]"""
    # what was found when a meeting was searched
    since: Floats
    """m_0 and s_0 of eq. (1); not a number where it was not (m, 4)"""
    n_close: Ints
    """points of each body that have triangles listed (m, 2)"""
    close: Ints
    """these, ascending, from each one's `place` on (f,)"""
    counts: Ints
    """of triangles listed for each, or `EVERY` (f,)"""
    listed: Ints
    """triangles of the other surface, counted from its first (f, LISTED), or as many as for meshes"""
    last: Ints
    """the nearest in the last step, or -1 (f,)"""
    # scratch, of one body's points
    share: Floats
    beside: Floats
    moved: Floats
    # what comes of it
    start: Ints
    """first row of each meeting (m + 1,)"""
    ints: Ints
    """(r, N_INTS)"""
    rows: Floats
    """(r, N_NUMBERS)"""
    forces: Floats
    """on points, or patches, as the committed step left them, and as the tentative one does, which is which changes
    (2, k, 3) [N]"""
    carries: NDArray[np.bool_]
    """whether a meeting has any in either (2, m)"""
    asleep: Ints
    """see `asleep` (b,)"""
    stands: NDArray[np.bool_]
    """meetings whose forces are the same before and after the step, as both bodies sleep (m,)"""


@njit(cache=True, error_model="numpy")
def stand(touch, meeting, now, share):
    """The forces that a meeting ends with are a share of those that it began with."""
    held, kept = touch.forces[now], touch.forces[1 - now]
    for side in range(2):
        begin, end = touch.held[meeting, side, 0], touch.held[meeting, side, 1]
        if share == 0.0:
            kept[begin:end] = 0.0
            continue
        for i in range(begin, end):
            for c in range(3):
                kept[i, c] = share * held[i, c]
    touch.carries[1 - now, meeting] = share > 0.0 and touch.carries[now, meeting]
