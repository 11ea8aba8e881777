"""Contact of surface points with rigid tools: augmented Lagrangian, Coulomb friction with true stick and slip.

A candidate is a pair (point, tool) that may touch in this step. With the multiplier f of the last step split along the
tool's normal n into lambda_n = f . n and lambda_t, the gap g at the end of the step, the tangential displacement D of
the point relative to the tool over the step, its offset d from its anchor before it, and the penalty r [N/m]:
  p = max(0, lambda_n - r g),   t = lambda_t - r (d + D),   tau = t min(1, mu p/|t|)                            (1)
and p n + tau is both the force on the body and the next multiplier: in a hold the gap and the offset tend to zero.
Tangent -df/dx, symmetric and positive definite, dp/dx in the friction bound dropped:
  stick  r I,    slip  r (B/|t|)(I - n n^T - q e e^T) + r n n^T,   B = mu p,  e = t/|t|                         (2)
with q = 1/2 where the same contact slipped the same way in the iterate before, else 0.

The anchor goes with the tool's material, and with a tool that turns lambda_t does. Where a point slips the anchor is
where the point is, so that the force stays in a hold; where it sticks the offset is, with the part c of the multiplier
that is carried over, 1 or 0 (below),
  d_next = c (d + D)                                                                                            (3)
so that t = -r x/(1 - c) of the whole way x since it stuck: at c = 1 it comes back, at c = 0 it is held by a spring.
Of points that hang on a node through which two tools hold the body none keeps an offset: both ask for a place, the
places differ by what is left of either offset, and multipliers that followed both would grow against each other until
one slips.

A point meets the side of a box that it faces when the step begins: at the step's end another side may be nearer, and a
plate that is raised would push down what it holds, one that comes fast would pinch what it should press.

Inside faces and on embedded surfaces there are more points than a face has freedoms, and a gap of zero at all of them
would flatten what curves within a cell. There nothing is carried over, c = 0: p = -r g is the slope of an energy of the
point's place, and the anchor holds by a spring.

A multiplier that is carried over follows the gap one step late: a point of mass m that implicit Euler moves in steps h
gains energy in contact where r h^2 < m, and keeps less of an oscillation the larger r h^2/m is (0.42 a step at 20). So
short steps have a stiffer r (`firmness`) where c = 1.

Inside faces F of tools/kernels/patch.py takes the place of -r g in p, and its slope that of r in what n n^T has in
eq. (2); under tools with edges the force acts beside the point on its patch, where work.lean says, and moves there.
What n n^T has is spread over the patch then, work.spread: of a point's weights W and those of its patch's edges U, V
  w w^T + c_ss U U^T + c_st (U V^T + V U^T) + c_tt V V^T,   w = W + s' U + t' V                                   (4)
take the place of W W^T, with eq. (3) there.

A point that comes by much in a step, and through a tool of which it faces no side, meets the plane at which it met the
tool on its way: no tool is too thin for a fast body.

A step that is a part of the one asked for takes out only that part of the penetration and of the offset that it starts
with: all of it in a shorter time would throw the body off. There g is g - (1 - pace) g_0, and pace d takes the place of
d in (1), which leaves d_next = c D + (1 - pace (1 - c)) d.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import patch_press, plane_gap, press, side_gap, tool_gap

from .contact_columns import (
    EDGED,
    GAP,
    HELD,
    NORMAL,
    OPEN,
    PRESSURE,
    RELAXED,
    SLIDE,
    SLIP,
    SLOPE,
    STICK,
    SWEPT,
    TO_HOLD,
    TRACTION,
    TRIAL,
)

_STUCK = 0.999
"""of the bound: a multiplier below that did not slip"""


@njit(cache=True, error_model="numpy")
def point_position(x, model, parameters, point, out):
    """out (3,) <- position of a surface point, the weighted sum of its nodes."""
    out[0] = out[1] = out[2] = 0.0
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        node, weight = model.point_node[entry], parameters.point_weight[entry]
        out[0] += weight * x[node, 0]
        out[1] += weight * x[node, 1]
        out[2] += weight * x[node, 2]


@njit(cache=True, error_model="numpy")
def patch_edges(x, model, parameters, point, edges):
    """edges (2, 3) [m] <- those of the patch of a point inside a face, where nodes are at x (n, 3)."""
    edges[:] = 0.0
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        node = model.point_node[entry]
        for which in range(2):
            for i in range(3):
                edges[which, i] += parameters.point_tilt[entry, which] * x[node, i]


@njit(cache=True, error_model="numpy", forceinline=True)
def acting_weight(c, entry, parameters, work):
    """Weight of a node at the place where a candidate's force acts: its point, or beside it on its patch."""
    tilt, lean = parameters.point_tilt, work.lean
    return parameters.point_weight[entry] + lean[c, 0] * tilt[entry, 0] + lean[c, 1] * tilt[entry, 1]


@njit(cache=True, error_model="numpy")
def acting_place(c, x, model, parameters, work, out):
    """out (3,) <- where a candidate's force acts, of nodes at x (n, 3)."""
    point = work.pair[c, 0]
    out[0] = out[1] = out[2] = 0.0
    for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
        node, weight = model.point_node[entry], acting_weight(c, entry, parameters, work)
        out[0] += weight * x[node, 0]
        out[1] += weight * x[node, 1]
        out[2] += weight * x[node, 2]


@njit(cache=True, error_model="numpy", forceinline=True)
def coefficient(parameters, point, tool):
    """mu of eq. (1) of a tool at a surface point [1]."""
    return parameters.friction[tool] * parameters.friction_factor[point]


@njit(cache=True, error_model="numpy")
def evaluate_contacts(x, model, parameters, tools, count, work):
    """Eq. (1) for every candidate: fills work.contact, work.state, work.turned and work.gone.

    Returns how many candidates touch whose stiffness the factor does not have.
    """
    xp, edges = np.empty(3), np.empty((2, 3))
    missing = turned = gone = left = 0
    for c in range(count):
        point, tool = work.pair[c, 0], work.pair[c, 1]
        row = work.contact[c]
        point_position(x, model, parameters, point, xp)
        orientation = tools.orientation_next[tool]
        stiffness, carry, sag = work.hold[c, 0], work.hold[c, 1], work.hold[c, 4]
        inside, slope = 0.0, 1.0
        if work.side[c] == SWEPT:
            gap, nx, ny, nz = plane_gap(work.plane[c], tools.position_next[tool], orientation, xp)
        elif work.side[c] == EDGED:
            patch_edges(x, model, parameters, point, edges)
            pressed = patch_press(
                *(tools.kind[tool], tools.shape[tool], tools.position_next[tool], orientation),
                *(xp, edges[0], edges[1], sag, tools.places[tool]),
            )
            inside, slope, nx, ny, nz, work.lean[c, 0], work.lean[c, 1] = pressed[:7]
            for i in range(5):
                work.spread[c, i] = pressed[7 + i]
            gap = -inside / slope
        elif work.side[c] < 0:
            gap, nx, ny, nz = tool_gap(tools.kind[tool], tools.shape[tool], tools.position_next[tool], orientation, xp)
        else:
            gap, nx, ny, nz = side_gap(work.side[c], tools.shape[tool], tools.position_next[tool], orientation, xp)
        f = work.multiplier[c]
        along = f[0] * nx + f[1] * ny + f[2] * nz
        if work.side[c] != EDGED:
            inside = -gap
        inside += work.hold[c, 2]
        if work.side[c] != EDGED and sag > 0.0 and inside > 0.0:
            inside, slope = press(inside, sag)
        row[SLOPE] = slope * stiffness
        pressure = carry * max(0.0, along) + stiffness * inside
        was = work.state[c]
        row[GAP] = gap
        mu = coefficient(parameters, point, tool)
        stuck = False
        if was == TO_HOLD and along > 0.0:
            least = _STUCK * mu * along
            stuck = least > 0.0 and f[0] * f[0] + f[1] * f[1] + f[2] * f[2] - along * along < least * least
        if pressure <= 0.0 and not stuck:
            row[PRESSURE:SLOPE] = 0.0
            work.state[c] = OPEN
            turned += was != OPEN
            gone += work.factored_state[point, tool] != OPEN
            left += work.factored_state[point, tool] != OPEN and work.side[c] == EDGED
            continue
        dx, dy, dz = xp[0] - work.begun[c, 0], xp[1] - work.begun[c, 1], xp[2] - work.begun[c, 2]
        across = dx * nx + dy * ny + dz * nz
        dx, dy, dz = dx - across * nx, dy - across * ny, dz - across * nz
        pace, offset = work.hold[c, 3], work.offset[c]
        across = offset[0] * nx + offset[1] * ny + offset[2] * nz
        tx = f[0] - along * nx - stiffness * (dx + pace * (offset[0] - across * nx))
        ty = f[1] - along * ny - stiffness * (dy + pace * (offset[1] - across * ny))
        tz = f[2] - along * nz - stiffness * (dz + pace * (offset[2] - across * nz))
        size = np.sqrt(tx * tx + ty * ty + tz * tz)
        bound = mu * pressure
        sticks = size <= bound
        held = stuck and not sticks
        scale = 1.0 if sticks or held else bound / size
        same_way = row[TRACTION] * tx + row[TRACTION + 1] * ty + row[TRACTION + 2] * tz > 0.0
        row[RELAXED] = 0.5 if (not sticks and was == SLIP and same_way) else 0.0
        row[PRESSURE] = pressure
        row[NORMAL], row[NORMAL + 1], row[NORMAL + 2] = nx, ny, nz
        row[TRACTION], row[TRACTION + 1], row[TRACTION + 2] = scale * tx, scale * ty, scale * tz
        row[TRIAL] = size
        row[SLIDE], row[SLIDE + 1], row[SLIDE + 2] = dx, dy, dz
        work.state[c] = HELD if held else (STICK if sticks else SLIP)
        turned += was != work.state[c] or (was == SLIP and not same_way)
        missing += work.factored_state[point, tool] == OPEN
    work.turned[0], work.gone[0], work.gone[1] = turned, gone, left
    return missing


@njit(cache=True, error_model="numpy")
def hold_what_stuck(count, work):
    """Have points that stuck in the last step stick in the next evaluation, however far their tool has gone since.

    Where tools start, stop or turn, all points seem to slip, or to be left, before the body has followed, and their
    force is bounded; held, they take the body along in the first iteration, and slip or open after it where they must.
    What slides is not: drawn back by a tool it would jump to other places in contact.
    """
    for c in range(count):
        work.state[c] = TO_HOLD


@njit(cache=True, error_model="numpy")
def any_held(count, work):
    """Whether a point sticks beyond its bound."""
    for c in range(count):
        if work.state[c] == HELD:
            return True
    return False


@njit(cache=True, error_model="numpy")
def lets_go(parameters, tools, count, work):
    """Whether most points that a followed tool pressed as the step began are open, or slip though they stuck.

    The ground does not count: what is pushed over it and begins to slide shall slide.
    """
    carried = lost = 0
    for c in range(count):
        f, row, point, tool = work.multiplier[c], work.contact[c], work.pair[c, 0], work.pair[c, 1]
        square = f[0] * f[0] + f[1] * f[1] + f[2] * f[2]
        if square == 0.0 or not tools.followed[tool]:
            continue
        carried += 1
        if work.state[c] == SLIP:
            along = f[0] * row[NORMAL] + f[1] * row[NORMAL + 1] + f[2] * row[NORMAL + 2]
            least = _STUCK * coefficient(parameters, point, tool) * along
            lost += least > 0.0 and square - along * along < least * least
        else:
            lost += work.state[c] == OPEN
    return 2 * lost > carried


@njit(cache=True, error_model="numpy")
def add_contact_forces(model, parameters, count, work, r):
    """r <- r + p n + tau on the nodes of each touching point, in elimination order; r updated in place."""
    for c in range(count):
        if work.state[c] == OPEN:
            continue
        row = work.contact[c]
        point = work.pair[c, 0]
        fx = row[PRESSURE] * row[NORMAL] + row[TRACTION]
        fy = row[PRESSURE] * row[NORMAL + 1] + row[TRACTION + 1]
        fz = row[PRESSURE] * row[NORMAL + 2] + row[TRACTION + 2]
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            place = model.point_place[entry]
            if place >= 0:
                weight = acting_weight(c, entry, parameters, work)
                r[3 * place] += weight * fx
                r[3 * place + 1] += weight * fy
                r[3 * place + 2] += weight * fz


@njit(cache=True, error_model="numpy")
def firm_way(count, work):
    """Way [m] that all touching points would have to go to change the sum of their pressures by all of it: sum p/sum r;
    infinite where nothing touches."""
    pressure = stiffness = 0.0
    for c in range(count):
        if work.state[c] != OPEN:
            pressure += work.contact[c, PRESSURE]
            stiffness += work.contact[c, SLOPE]
    return pressure / stiffness if stiffness > 0.0 else np.inf


@njit(cache=True, error_model="numpy")
def next_anchor(c, xp, work, anchor):
    """anchor (3,) [m] <- that of candidate c, whose point is at xp (3,) when the step ends; eq. (3)."""
    row, carry, pace, offset = work.contact[c], work.hold[c, 1], work.hold[c, 3], work.offset[c]
    sticks = work.state[c] == STICK
    across = offset[0] * row[NORMAL] + offset[1] * row[NORMAL + 1] + offset[2] * row[NORMAL + 2]
    for i in range(3):
        anchor[i] = xp[i]
        if sticks:
            left = offset[i] - across * row[NORMAL + i]
            anchor[i] -= carry * row[SLIDE + i] + (1.0 - pace * (1.0 - carry)) * left


@njit(cache=True, error_model="numpy")
def augment(count, work):
    """Take the forces as multipliers where penetration is to vanish; returns the deepest one there [m]."""
    deepest = 0.0
    for c in range(count):
        row = work.contact[c]
        if work.hold[c, 1] < 1.0:
            continue
        deepest = max(deepest, -row[GAP])
        for i in range(3):
            work.multiplier[c, i] = row[PRESSURE] * row[NORMAL + i] + row[TRACTION + i]
    return deepest
