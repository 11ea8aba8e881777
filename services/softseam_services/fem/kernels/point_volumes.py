"""-mu ln J where a cell loses volume between the points of split quadrature: hex27 and hex27_reduced on the fast path.

Split quadrature has mu/2 I1 at 27 points and -mu ln J, which balances it at rest, at 8. Where a tool's edge presses, a
corner of a cell can shrink to nothing that these 8 do not see: its stiffness then is negative. With e(J) = -ln J, the 8
points k, the 27 points q of `FemParameters.full`, and N_k the trilinear function that is 1 at k and 0 at the others,
  d_q = e(J_q) - sum_k N_k(q) e(J_k),   U = sum_q w_q mu_q phi(d_q)                                               (1)
  phi' = 0 up to FIRST, 1 from LAST on, r^2 (3 - 2 r) with r = (d - FIRST)/(LAST - FIRST) between
Where phi' = 1, what U adds at the 27 points it takes away at the 8, as sum_q w_q N_k(q) = w_k in a box of one material.
It is an energy of the places of nodes, with no memory; smooth cells have none of it. With h = cof F grad N, and
c = w mu phi' at q and -sum_q c_q N_k(q) at k, both kinds counted as points p:
  f_ia = sum_p c e' h_ia,   K_ia,kb = sum_p c [(e'' + e'/J) h_ia h_kb - e'/J h_ka h_ib] + sum_q w mu phi'' g_ia g_kb
  g = dd_q = e'(J_q) h_q - sum_k N_k(q) e'(J_k) h_k                                                               (2)
"""

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.materials.neo_hookean import J_MIN, volumetric
from softseam_services.jit import njit

from .cells import deformation
from .fronts import LANES, add_block_row
from .lapack import product

FIRST, LAST = 0.15, 0.35
# A step counts the cells that are as far as this when it begins, and those that get as far as FIRST.
WATCHED = 0.1
N_FULL, N_SPLIT = 27, 8
N_POINTS = N_FULL + N_SPLIT


def _interpolation() -> Floats:
    """N_k(q) (27, 8), x fastest in both."""
    three = np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.6)
    one = 0.5 * (1.0 + np.sqrt(3.0) * np.outer(three, [-1.0, 1.0]))  # (point, side)
    return np.ascontiguousarray(np.einsum("xi,yj,zk->zyxkji", one, one, one).reshape(N_FULL, N_SPLIT))


INTERPOLATION = _interpolation()
# sum of what is negative in N_k(q) at a corner
_BEYOND = float(np.abs(np.minimum(INTERPOLATION[0], 0.0)).sum())


@njit(cache=True, error_model="numpy")
def watch_cells(least, x, model, parameters, work):
    """Set work.watched (c,) where some d exceeds this at x (n, 3), and add to its count work.watches; returns how many
    cells there are more. work.xe and work.F are scratch; places that were looked at last are not looked at again."""
    if not _is_known(x, work):
        deformation(x, model, parameters, work)
        _look(x, model, parameters, work)
    before = work.watches[0]
    for cell in range(len(model.cell_nodes)):
        if model.whole[cell] and not work.watched[cell] and work.excess[cell] > least:
            work.watched[cell] = True
            work.watches[0] += 1
    return work.watches[0] - before


@njit(cache=True, error_model="numpy")
def _is_known(x, work):
    """Whether work.excess is of these places: a step begins where the last one looked as it ended."""
    for node in range(len(x)):
        for i in range(3):
            if x[node, i] != work.excess_at[node, i]:
                return False
    return True


@njit(cache=True, error_model="numpy")
def _look(x, model, parameters, work):
    """work.excess (c,) <- the largest d of each cell at x (n, 3), WATCHED where it is no more than that; from work.F as
    cells.py leaves it."""
    F, J, e, d, _, _ = _scratch()
    for cell in range(len(model.cell_nodes)):
        found = WATCHED
        if model.whole[cell] and _exceeds(WATCHED, x, model, parameters, work, cell, F, J, e, d):
            found = d.max()
        work.excess[cell] = found
    work.excess_at[:] = x


@njit(cache=True, error_model="numpy")
def _exceeds(excess, x, model, parameters, work, cell, F, J, e, d):
    """Whether some d of eq. (1) exceeds this; in place F (44, 3, 3), transposed deformation gradients and scratch,
    J (35,), and if so e (35, 3) with its slope and curvature, d (27,); from x (n, 3) and work.F."""
    centre, places = model.cell_nodes[cell, 13], F[N_POINTS:].reshape(-1)
    for a in range(27):
        node = model.cell_nodes[cell, a]
        for i in range(3):
            places[3 * a + i] = x[node, i] - x[centre, i]
    gradient = parameters.full.gradient[parameters.full.shape[cell], 0].reshape(-1)
    product(3, 3 * N_FULL, 27, 1, places, 0, 3, gradient, 0, 27, False, False, F.reshape(-1), 0, 3, work.ints)
    for k in range(N_SPLIT):
        for i in range(3):
            for j in range(3):
                F[N_FULL + k, j, i] = work.F[cell, i, 3 * k + j]
    for p in range(N_POINTS):
        J[p] = (
            F[p, 0, 0] * (F[p, 1, 1] * F[p, 2, 2] - F[p, 1, 2] * F[p, 2, 1])
            + F[p, 0, 1] * (F[p, 1, 2] * F[p, 2, 0] - F[p, 1, 0] * F[p, 2, 2])
            + F[p, 0, 2] * (F[p, 1, 0] * F[p, 2, 1] - F[p, 1, 1] * F[p, 2, 0])
        )
    return _may_exceed(excess, J) and _excess(J, e, d) > excess


@njit(cache=True, error_model="numpy")
def _may_exceed(excess, J):
    """Whether some d of eq. (1) can exceed this: where all J are positive it is at most
    ln(most of the 8 / least of the 27) + _BEYOND ln(most of the 8 / least of them)."""
    least, low, high = J[:N_FULL].min(), J[N_FULL:].min(), J[N_FULL:].max()
    return not (least > 0.0 and low > 0.0 and np.log(high / least) + _BEYOND * np.log(high / low) < excess)


@njit(cache=True, error_model="numpy")
def _excess(J, e, d):
    """d (27,) of eq. (1) and e (35, 3) with its slope and curvature, in place; returns the largest d."""
    for p in range(N_POINTS):
        e[p, 0], e[p, 1], e[p, 2] = volumetric(J[p], 1.0, 0.0)
    largest = -np.inf
    for q in range(N_FULL):
        d[q] = e[q, 0]
        for k in range(N_SPLIT):
            d[q] -= INTERPOLATION[q, k] * e[N_FULL + k, 0]
        largest = max(largest, d[q])
    return largest


@njit(cache=True, error_model="numpy")
def _scratch():
    """F, J, e, d of `_exceeds`; of `_pulls` c (35,) and (27,)."""
    F, J, e, d = np.empty((N_POINTS + 9, 3, 3)), np.empty(N_POINTS), np.empty((N_POINTS, 3)), np.empty(N_FULL)
    return F, J, e, d, np.empty(N_POINTS), np.empty(N_FULL)


@njit(cache=True, error_model="numpy")
def _phi(d):
    """phi of eq. (1), its slope and its curvature."""
    span = LAST - FIRST
    r = (d - FIRST) / span
    if r <= 0.0:
        return 0.0, 0.0, 0.0
    if r >= 1.0:
        return span * (r - 0.5), 1.0, 0.0
    return span * r * r * r * (1.0 - 0.5 * r), r * r * (3.0 - 2.0 * r), 6.0 * r * (1.0 - r) / span


@njit(cache=True, error_model="numpy")
def _pulls(model, parameters, cell, part, d, c, curvature):
    """c (35,) and w mu phi'' (27,) of eq. (2), times part, in place; returns U."""
    c[N_FULL:] = 0.0
    energy = 0.0
    for q in range(N_FULL):
        density, slope, bend = _phi(d[q])
        weight = part * parameters.full.weight[cell, q] * parameters.full.moduli[parameters.full.blend[cell], q, 0]
        c[q], curvature[q] = weight * slope, weight * bend
        energy += weight * density
        if slope > 0.0:
            for k in range(N_SPLIT):
                c[N_FULL + k] -= c[q] * INTERPOLATION[q, k]
    return energy


@njit(cache=True, error_model="numpy")
def _volume_gradient(F, model, parameters, cell, p, n, nodes, h):
    """h[i, b] of eq. (2) at point p for the first n of the nodes, in place; F (3, 3): the transpose there."""
    f00, f10, f20 = F[0, 0], F[0, 1], F[0, 2]
    f01, f11, f21 = F[1, 0], F[1, 1], F[1, 2]
    f02, f12, f22 = F[2, 0], F[2, 1], F[2, 2]
    h00, h01, h02 = f11 * f22 - f12 * f21, f12 * f20 - f10 * f22, f10 * f21 - f11 * f20
    h10, h11, h12 = f02 * f21 - f01 * f22, f00 * f22 - f02 * f20, f01 * f20 - f00 * f21
    h20, h21, h22 = f01 * f12 - f02 * f11, f02 * f10 - f00 * f12, f00 * f11 - f01 * f10
    split = parameters.gradient if model.cut[cell] < 0 else parameters.cut_gradient[model.cut[cell]]
    G, at = parameters.full.gradient[parameters.full.shape[cell], 0], 3 * (p - N_FULL)
    for b in range(n):
        a = nodes[b]
        if p < N_FULL:
            g0, g1, g2 = G[p, 0, a], G[p, 1, a], G[p, 2, a]
        else:
            g0, g1, g2 = split[a, at], split[a, at + 1], split[a, at + 2]
        h[0, b] = h00 * g0 + h01 * g1 + h02 * g2
        h[1, b] = h10 * g0 + h11 * g1 + h12 * g2
        h[2, b] = h20 * g0 + h21 * g1 + h22 * g2


@njit(cache=True, error_model="numpy")
def subtract_forces(x, model, parameters, work, r):
    """r <- r - f of eq. (2), in elimination order, from work.F as cells.py leaves it."""
    F, J, e, d, c, curvature = _scratch()
    h, f, nodes = np.empty((3, 27)), np.empty((3, 27)), np.arange(27)
    for cell in range(len(model.cell_nodes)):
        if not (work.watched[cell] and _exceeds(FIRST, x, model, parameters, work, cell, F, J, e, d)):
            continue
        _pulls(model, parameters, cell, work.part[cell], d, c, curvature)
        f[:] = 0.0
        for p in range(N_POINTS):
            s = c[p] * e[p, 1]
            if s != 0.0:
                _volume_gradient(F[p], model, parameters, cell, p, 27, nodes, h)
                for i in range(3):
                    for a in range(27):
                        f[i, a] += s * h[i, a]
        for a in range(27):
            place = model.cell_order[cell, a]
            if place >= 0:
                for i in range(3):
                    r[3 * place + i] -= f[i, a]


@njit(cache=True, error_model="numpy")
def add_cell_tangents(x, model, parameters, tree, work):
    """Add K of eq. (2) to the fronts in work.values, updated in place, from work.F as cells.py leaves it; nodes of a
    cell in elimination order. work.row is overwritten."""
    F, J, e, d, c, curvature = _scratch()
    A, B, row = np.empty(N_POINTS), np.empty(N_POINTS), work.row
    h, g = np.zeros((N_POINTS, 3, LANES)), np.zeros((N_FULL, 3, LANES))
    for cell in range(len(model.cell_nodes)):
        if not (work.watched[cell] and _exceeds(FIRST, x, model, parameters, work, cell, F, J, e, d)):
            continue
        _pulls(model, parameters, cell, work.part[cell], d, c, curvature)
        n_free, local = tree.cell_free[cell], tree.cell_local[cell]
        for p in range(N_POINTS):
            divisor = J[p] if abs(J[p]) > 1e-3 else (1e-3 if J[p] >= 0.0 else -1e-3)
            A[p], B[p] = c[p] * (e[p, 2] + e[p, 1] / divisor), -c[p] * e[p, 1] / divisor
            if J[p] >= J_MIN:
                A[p] = 0.0  # but for rounding
            if c[p] != 0.0 or p >= N_FULL:
                _volume_gradient(F[p], model, parameters, cell, p, n_free, local, h[p])
        for q in range(N_FULL):
            if curvature[q] > 0.0:
                _gradient_of_excess(q, e, h, g[q])
        for a in range(n_free):
            _block_row(a, h, g, A, B, curvature, row)
            add_block_row(tree, work.values, cell, a, row, LANES)


@njit(cache=True, error_model="numpy")
def _gradient_of_excess(q, e, h, g):
    """g (3, LANES) of eq. (2) at q, in place."""
    for i in range(3):
        for b in range(LANES):
            g[i, b] = e[q, 1] * h[q, i, b]
        for k in range(N_SPLIT):
            s = INTERPOLATION[q, k] * e[N_FULL + k, 1]
            for b in range(LANES):
                g[i, b] -= s * h[N_FULL + k, i, b]


@njit(cache=True, error_model="numpy")
def _block_row(a, h, g, A, B, curvature, row):
    """row[(3 i + k) LANES + b] <- K of eq. (2) for all b."""
    for b in range(9 * LANES):
        row[b] = 0.0
    for p in range(N_POINTS):
        if B[p] != 0.0:
            _add_outer(a, B[p], h[p], True, row)
        if A[p] != 0.0:
            _add_outer(a, A[p], h[p], False, row)
        if p < N_FULL and curvature[p] > 0.0:
            _add_outer(a, curvature[p], g[p], False, row)


@njit(cache=True, error_model="numpy")
def _add_outer(a, factor, h, crossed, row):
    """row[(3 i + k) LANES + b] += factor h_ia h_kb for all b, or h_ka h_ib where crossed; h (3, LANES)."""
    c0, c1, c2 = factor * h[0, a], factor * h[1, a], factor * h[2, a]
    up, down = (LANES, 3 * LANES) if crossed else (3 * LANES, LANES)
    for b in range(LANES):
        x, y, z = h[0, b], h[1, b], h[2, b]
        row[b] += c0 * x
        row[down + b] += c0 * y
        row[2 * down + b] += c0 * z
        row[up + b] += c1 * x
        row[4 * LANES + b] += c1 * y
        row[up + 2 * down + b] += c1 * z
        row[2 * up + b] += c2 * x
        row[2 * up + down + b] += c2 * y
        row[8 * LANES + b] += c2 * z


@njit(cache=True, error_model="numpy")
def strain_energy(x, model, parameters, work):
    """U of eq. (1) of all cells, counted or not [J], from work.F as cells.py leaves it; work.energy (c,) += each
    cell's."""
    F, J, e, d, c, curvature = _scratch()
    total, known = 0.0, _is_known(x, work)
    for cell in range(len(model.cell_nodes)):
        if not model.whole[cell] or (known and not work.excess[cell] > FIRST):
            continue
        if _exceeds(FIRST, x, model, parameters, work, cell, F, J, e, d):
            own = _pulls(model, parameters, cell, work.part[cell], d, c, curvature)
            work.energy[cell] += own
            total += own
    return total


@njit(cache=True, error_model="numpy")
def loses_volume(model):
    """Whether cells of this model have this energy at all."""
    return model.blends and not model.general
