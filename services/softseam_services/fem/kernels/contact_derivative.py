"""Derivatives of what contact comes to in a step, by all that it follows from; eqs. (1) and (3) of kernels/contact.py.

Of a touching point at x with gap g and normal n, H = dn/dx, T = I - n n^T, multiplier l, penalty r, carried part c, and
the way y = x - X + s from where it would stick, X being the tool's place when the step ends and s = (its place before)
- (the anchor, or the point's place before where it has none):
  a = l . n,  p = c max(0, a) - r g,  q = l - r y,  t = T q                                                      (1)
  stick: tau = t, anchor = x - c T y;   slip: e = t/|t|, tau = mu p e, anchor = x                                (2)
  dp = (c [a > 0] l . H - r n) . dx + c [a > 0] n . dl - g dr
  dt = (-r T - n (q^T H) - (n . q) H) dx + T (dl - r ds - y dr)
  d(p n + tau) = n dp + p H dx + dtau,   slip: dtau = mu e dp + mu p/|t| (I - e e^T) dt + p e dmu                  (3)
X moves force and anchor as -dx does, but for the anchor's own place. H of a flat side is 0; of what is round it is the
central difference of normals. A point that came from far meets a plane (m, b) in the tool's frame, with the gap
m . (x - X) - b, which follows from where it comes from and where it flies to: there H is 0, and
  dp = -r ((x - X) . dm - db),   dt = -m (q . dm) - (m . q) dm                                                   (4)
Where a state is about to change, these are of the side that the run is on; `margin` says how near that is.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.shapes.branches import CYLINDER, PLANE
from softseam_services.tools.kernels import SLOW, patch_press, rotate, tool_gap

from .candidates import SEVERAL, find_holders, firmness, meets
from .contact import coefficient, patch_edges, point_position
from .contact_columns import EDGED, GAP, NORMAL, OPEN, PRESSURE, SLIP, SLOPE, SWEPT, TRIAL
from .tangent_product import APART

BY_PENALTY, BY_FRICTION = 0, 1
"""columns of `numbers`"""


@njit(cache=True, error_model="numpy")
def differentiate_contacts(x0, v0, dt, x, contact, model, parameters, tools, count, work, out):
    """Fill out (`differential.ContactSlopes`) by eq. (3) for candidates that `evaluate_contacts` saw at x.

    x0, v0 (n, 3), contact (p, t, 9): at the start of the step.
    """
    inertia = 1.0 / (dt * dt)
    xp, G, H, edges = np.empty(3), np.zeros(3), np.zeros((3, 3)), np.empty((2, 3))
    holder = find_holders(model, contact, len(x0))
    hardest = _hardest(count, len(tools.kind), work)
    for c in range(count):
        point, tool = work.pair[c, 0], work.pair[c, 1]
        friction = coefficient(parameters, point, tool)
        out.place[c], out.multiplier[c], out.since[c], out.numbers[c] = 0.0, 0.0, 0.0, 0.0
        out.penalty[c] = 0.0
        point_position(x, model, parameters, point, xp)
        out.margin[c] = _margin(c, xp, friction, hardest[tool], work)
        if work.state[c] == OPEN:
            continue
        alone, touched = True, False
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            alone = alone and holder[model.point_node[entry]] != SEVERAL
        for i in range(3):
            touched = touched or contact[point, tool, i] != 0.0
        out.anchored[c] = alone and touched
        out.edges[c], out.lean[c] = 0.0, 0.0
        if work.side[c] == EDGED:
            patch_edges(x, model, parameters, point, edges)
            _differentiate_patch(c, xp, edges, friction, parameters.edge, tools, work, G, H, out)
        else:
            _bend(c, xp, parameters.edge, tools, work, G, H)
        _differentiate(c, xp, G, H, friction, work, out)
        out.met[c] = 0.0
        if work.side[c] == SWEPT:
            _differentiate_met(c, x0, v0, dt, xp, model, parameters, tools, work, out)
        out.penalty[c] = 0.0 if work.hold[c, 1] == 1.0 and firmness(model, parameters, point, inertia) > 1.0 else 1.0
        out.penalty[c] *= work.hold[c, 0]


@njit(cache=True, error_model="numpy")
def _hardest(count, n_tools, work):
    """Largest pressure on any point of each tool (t,) [N]."""
    hardest = np.zeros(n_tools)
    for c in range(count):
        if work.state[c] != OPEN:
            tool = work.pair[c, 1]
            hardest[tool] = max(hardest[tool], work.contact[c, PRESSURE])
    return hardest


@njit(cache=True, error_model="numpy")
def _margin(c, xp, friction, hardest, work):
    """Relative change of forces with which this candidate opens, closes, sticks or slips."""
    row, f = work.contact[c], work.multiplier[c]
    if work.state[c] == OPEN:
        # normals are known of what touches; an open one that carries no force opens and closes with its gap
        way = 0.0
        for i in range(3):
            way += (xp[i] - work.begun[c, i]) ** 2
        carried = work.hold[c, 1] * np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
        lacking = abs(work.hold[c, 0] * row[GAP] - carried)
        return lacking / max(hardest, work.hold[c, 0] * np.sqrt(way), 1e-300)
    opens = row[PRESSURE] / hardest
    bound = friction * row[PRESSURE]
    return opens if bound == 0.0 else min(opens, abs(row[TRIAL] - bound) / bound)


@njit(cache=True, error_model="numpy")
def _bend(c, xp, edge, tools, work, G, H):
    """G (3,) [1], H (3, 3) [1/m] <- derivatives of a candidate's gap and normal by its point's place xp, in place."""
    row, tool = work.contact[c], work.pair[c, 1]
    for i in range(3):
        G[i] = row[NORMAL + i]
    H[:] = 0.0
    kind = tools.kind[tool]
    if work.side[c] != -1 or kind == PLANE:
        return
    shape, position, turn = tools.shape[tool], tools.position_next[tool], tools.orientation_next[tool]
    apart = APART * edge
    for j in range(3):
        at = xp[j]
        xp[j] = at + apart
        far, fx, fy, fz = tool_gap(kind, shape, position, turn, xp)
        xp[j] = at - apart
        near, nx, ny, nz = tool_gap(kind, shape, position, turn, xp)
        xp[j] = at
        H[0, j], H[1, j], H[2, j] = (fx - nx) / (2 * apart), (fy - ny) / (2 * apart), (fz - nz) / (2 * apart)
        if kind > CYLINDER:  # of a grid the normal is near the gap's slope, no more
            G[j] = (far - near) / (2 * apart)


@njit(cache=True, error_model="numpy")
def _differentiate_patch(c, xp, edges, friction, edge, tools, work, G, H, out):
    """`_bend` of a patch that is looked at in parts, and out.edges and out.lean of it, in place: central differences of
    eq. (2) of tools/kernels/patch.py."""
    by_edges, lean = out.edges[c], out.lean[c]
    row, tool, r, apart = work.contact[c], work.pair[c, 1], work.hold[c, 0], APART * edge
    sag, places = work.hold[c, 4], tools.places[tool]
    shape = tools.kind[tool], tools.shape[tool], tools.position_next[tool], tools.orientation_next[tool]
    q, e, dn, dt = np.empty(3), np.zeros(3), np.empty(3), np.empty(3)
    across, slips = 0.0, work.state[c] == SLIP
    for i in range(3):
        q[i] = work.multiplier[c, i] - r * (xp[i] - work.begun[c, i] + work.offset[c, i])
        across += q[i] * row[NORMAL + i]
    squeeze = friction * row[PRESSURE] / row[TRIAL] if slips and row[TRIAL] > 0.0 else 1.0
    if slips and row[TRIAL] > 0.0:
        for i in range(3):
            e[i] = (q[i] - across * row[NORMAL + i]) / row[TRIAL]
    for which in range(3):
        moved = xp if which == 2 else edges[which]
        for j in range(3):
            at = moved[j]
            moved[j] = at + apart
            far, _, fx, fy, fz, fs, ft = patch_press(*shape, xp, edges[0], edges[1], sag, places)[:7]
            moved[j] = at - apart
            near, _, nx, ny, nz, ns, nt = patch_press(*shape, xp, edges[0], edges[1], sag, places)[:7]
            moved[j] = at
            lean[0, which, j], lean[1, which, j] = (fs - ns) / (2.0 * apart), (ft - nt) / (2.0 * apart)
            dp = r * (far - near) / (2.0 * apart)
            dn[0], dn[1], dn[2] = (fx - nx) / (2.0 * apart), (fy - ny) / (2.0 * apart), (fz - nz) / (2.0 * apart)
            if which == 2:
                G[j] = -dp / row[SLOPE]
                for i in range(3):
                    H[i, j] = dn[i]
                continue
            turned = along = 0.0
            for i in range(3):
                along += q[i] * dn[i]
            for i in range(3):
                dt[i] = -row[NORMAL + i] * along - across * dn[i]
                turned += e[i] * dt[i]
            for i in range(3):
                by_edges[which, i, j] = (row[NORMAL + i] + friction * e[i]) * dp + row[PRESSURE] * dn[i]
                by_edges[which, i, j] += squeeze * (dt[i] - turned * e[i])


@njit(cache=True, error_model="numpy")
def _differentiate(c, xp, G, H, friction, work, out):
    """Eq. (3) of one touching candidate, in place."""
    row, l = work.contact[c], work.multiplier[c]  # noqa: E741 as in the equation
    r, carry, pressure = work.hold[c, 0], work.hold[c, 1], row[PRESSURE]
    slips = work.state[c] == SLIP
    n, y, q, e = np.empty(3), np.empty(3), np.empty(3), np.zeros(3)
    across = along = ahead = 0.0
    for i in range(3):
        n[i] = row[NORMAL + i]
        y[i] = xp[i] - work.begun[c, i] + work.offset[c, i]
        q[i] = l[i] - r * y[i]
        along += l[i] * n[i]
        across += n[i] * q[i]
        ahead += n[i] * y[i]
    inside = (pressure - carry * max(0.0, along)) / r
    squeeze = 0.0
    if slips and row[TRIAL] > 0.0:
        squeeze = friction * pressure / row[TRIAL]
        for i in range(3):
            e[i] = (q[i] - across * n[i]) / row[TRIAL]
    dp, qH, yH, dt = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    for j in range(3):
        lH = qH[j] = yH[j] = 0.0
        for i in range(3):
            lH += l[i] * H[i, j]
            qH[j] += q[i] * H[i, j]
            yH[j] += y[i] * H[i, j]
        dp[j] = (carry * lH if along > 0.0 else 0.0) - row[SLOPE] * G[j]
    place, by_l, by_s, numbers = out.place[c], out.multiplier[c], out.since[c], out.numbers[c]
    for i in range(3):
        for j in range(3):
            T = (1.0 if i == j else 0.0) - n[i] * n[j]
            dt[i, j] = -r * T - n[i] * qH[j] - across * H[i, j]
    for i in range(3):
        normal_part = n[i] + (friction * e[i] if slips else 0.0)
        turned = 0.0
        for j in range(3):
            T = (1.0 if i == j else 0.0) - n[i] * n[j]
            through, moved = T, dt[i, j]
            if slips:
                through = squeeze * (T - e[i] * e[j])
                moved = 0.0
                for k in range(3):
                    moved += squeeze * ((1.0 if i == k else 0.0) - e[i] * e[k]) * dt[k, j]
            place[i, j] = normal_part * dp[j] + pressure * H[i, j] + moved
            by_l[i, j] = through + (normal_part * carry * n[j] if along > 0.0 else 0.0)
            by_s[i, j] = -r * through
            turned -= through * y[j]
            place[3 + i, j] = 1.0 if i == j else 0.0
            if not slips:
                place[3 + i, j] -= carry * (T - ahead * H[i, j] - n[i] * yH[j])
                by_s[3 + i, j] = -carry * T
        numbers[i, BY_PENALTY] = inside * normal_part + turned
        numbers[i, BY_FRICTION] = pressure * e[i] if slips else 0.0


@njit(cache=True, error_model="numpy")
def _differentiate_met(c, x0, v0, dt, xp, model, parameters, tools, work, out):
    """Eq. (4) of a candidate that meets a plane: force by where its point comes from and by where it flies to."""
    row, point, tool = work.contact[c], work.pair[c, 0], work.pair[c, 1]
    ends, plane, other = np.empty((2, 3)), np.empty(4), np.empty(4)
    point_position(x0, model, parameters, point, ends[0])
    point_position(v0, model, parameters, point, ends[1])
    across = along = 0.0
    q, dq, e = np.empty(3), np.empty(3), np.zeros(3)
    r, friction, slips = work.hold[c, 0], coefficient(parameters, point, tool), work.state[c] == SLIP
    squeeze = friction * row[PRESSURE] / row[TRIAL] if slips and row[TRIAL] > 0.0 else 1.0
    for i in range(3):
        ends[1, i] = ends[0, i] + dt * ends[1, i]
        q[i] = work.multiplier[c, i] - r * (xp[i] - work.begun[c, i] + work.offset[c, i])
        across += q[i] * row[NORMAL + i]
    if slips and row[TRIAL] > 0.0:
        for i in range(3):
            e[i] = (q[i] - across * row[NORMAL + i]) / row[TRIAL]
    apart, slow = APART * parameters.edge, SLOW * tools.reach[tool]
    for which in range(2):
        for j in range(3):
            at = ends[which, j]
            for i in range(4):
                plane[i] = other[i] = work.plane[c, i]
            ends[which, j] = at + apart
            meets(tools, tool, ends[0], ends[1], slow, plane)
            ends[which, j] = at - apart
            meets(tools, tool, ends[0], ends[1], slow, other)
            ends[which, j] = at
            for i in range(4):
                plane[i] = (plane[i] - other[i]) / (2.0 * apart)
            plane[0], plane[1], plane[2] = rotate(tools.orientation[tool], plane[0], plane[1], plane[2])
            gap, along = -plane[3], 0.0
            for i in range(3):
                gap += plane[i] * (xp[i] - tools.position_next[tool, i])
                along += plane[i] * q[i]
            turned = 0.0
            for i in range(3):
                dq[i] = -row[NORMAL + i] * along - across * plane[i]
                turned += e[i] * dq[i]
            for i in range(3):
                moved = squeeze * (dq[i] - turned * e[i]) if slips else dq[i]
                normal_part = row[NORMAL + i] + (friction * e[i] if slips else 0.0)
                out.met[c, which, i, j] = -row[SLOPE] * gap * normal_part + row[PRESSURE] * plane[i] + moved
