"""Forces, tangents, energies, stresses of hex27 and hex27_reduced: split quadrature (fem/elements/hex27_box.py, eq. 1).

The fast path of kernels/elements.py. A cell counts with its work.part, 1 but for crushed
cells (kernels/quadrature_blending.py).
With w_q = f_q V/8, H = cof F, mu and the volumetric part of the octant's material, s = dpsi_J/dJ, ds = d2psi_J/dJ2:
  f_ia = sum_q w_q (mu F + s H)_ij dN_a,j + mean(mu) sum_b S_ab x_ib                                            (1)
  K_ia,kb = delta_ik L_ab + sum_q w_q [(ds + s/J) h_ia h_kb - s/J h_ka h_ib],  h_a = H grad N_a                 (2)
For the small-strain material F = I in H, and the remainder stress of its file takes the place of s H:
  f_ia = sum_q w_q (mu F + mu F^T + (lambda tr(F - I) - 2 mu) I)_ij dN_a,j + ...                                (3)
  K_ia,kb = delta_ik L_ab + sum_q w_q [lambda dN_a,i dN_b,k + mu dN_a,k dN_b,i]                                 (4)
so that both share one loop: K = delta_ik L_ab + sum_q (A_q h_ia h_kb + B_q h_ka h_ib).
Cells that the body fills in part (fem/elements/cut.py), or that are no boxes, have tables of their own.
"""

import numpy as np

from softseam_services.body.materials.neo_hookean import volumetric
from softseam_services.jit import njit

from . import relaxing_cells
from .fronts import LANES, add_block_row
from .lapack import multiply


@njit(cache=True, error_model="numpy")
def gather(x, cell_nodes, xe):
    """Node positions relative to each cell's centre node, which keeps rounding small far from the origin.

    x (n, 3), cell_nodes (c, 27); xe (c, 3, 27) updated in place
    """
    for cell in range(len(cell_nodes)):
        centre = cell_nodes[cell, 13]
        cx, cy, cz = x[centre, 0], x[centre, 1], x[centre, 2]
        for a in range(27):
            node = cell_nodes[cell, a]
            xe[cell, 0, a] = x[node, 0] - cx
            xe[cell, 1, a] = x[node, 1] - cy
            xe[cell, 2, a] = x[node, 2] - cz


@njit(cache=True, error_model="numpy")
def deformation(x, model, parameters, work):
    """Fill work.xe and work.F: deformation gradients at the octants' points, F[c, i, 3 q + j] (c, 3, 24)."""
    gather(x, model.cell_nodes, work.xe)
    multiply_full(model, parameters, work.xe, parameters.gradient, work.F, 24, 27, False, work.ints)
    if len(parameters.cut_force) > 0:
        for cell in range(len(model.cell_nodes)):
            cut = model.cut[cell]
            if cut >= 0:
                multiply(work.xe[cell], parameters.cut_gradient[cut], work.F[cell], 3, 24, 27, False, work.ints)


@njit(cache=True, error_model="numpy")
def multiply_full(model, parameters, a, b, c, n, k, add, ints):
    """c (c, 3, n) <- a (c, 3, k) b (k, n) [+ c where add] of full cells, as many in a row as there are."""
    n_cells = len(model.cell_nodes)
    if len(parameters.cut_force) == 0:
        multiply(a, b, c, 3 * n_cells, n, k, add, ints)
        return
    first = 0
    while first < n_cells:
        last = first
        while last < n_cells and model.cut[last] < 0:
            last += 1
        if last > first:
            multiply(a[first:last], b, c[first:last], 3 * (last - first), n, k, add, ints)
        first = last + 1


@njit(cache=True, error_model="numpy")
def point_stress(F, at, linear, mu, lam, weight, P):
    """Write w P of eq. (1) or (3) for the 3 columns at `at` of F (3, 24) into P (3, 24); returns J."""
    f00, f01, f02 = F[0, at], F[0, at + 1], F[0, at + 2]
    f10, f11, f12 = F[1, at], F[1, at + 1], F[1, at + 2]
    f20, f21, f22 = F[2, at], F[2, at + 1], F[2, at + 2]
    wm = weight * mu
    if linear:
        pressure = weight * (lam * (f00 + f11 + f22 - 3.0) - 2.0 * mu)
        P[0, at], P[0, at + 1], P[0, at + 2] = 2.0 * wm * f00 + pressure, wm * (f01 + f10), wm * (f02 + f20)
        P[1, at], P[1, at + 1], P[1, at + 2] = wm * (f01 + f10), 2.0 * wm * f11 + pressure, wm * (f12 + f21)
        P[2, at], P[2, at + 1], P[2, at + 2] = wm * (f02 + f20), wm * (f12 + f21), 2.0 * wm * f22 + pressure
        return 1.0
    h00, h01, h02 = f11 * f22 - f12 * f21, f12 * f20 - f10 * f22, f10 * f21 - f11 * f20
    J = f00 * h00 + f01 * h01 + f02 * h02
    ws = weight * volumetric(J, mu, lam)[1]
    P[0, at] = wm * f00 + ws * h00
    P[0, at + 1] = wm * f01 + ws * h01
    P[0, at + 2] = wm * f02 + ws * h02
    P[1, at] = wm * f10 + ws * (f02 * f21 - f01 * f22)
    P[1, at + 1] = wm * f11 + ws * (f00 * f22 - f02 * f20)
    P[1, at + 2] = wm * f12 + ws * (f01 * f20 - f00 * f21)
    P[2, at] = wm * f20 + ws * (f01 * f12 - f02 * f11)
    P[2, at + 1] = wm * f21 + ws * (f02 * f10 - f00 * f12)
    P[2, at + 2] = wm * f22 + ws * (f00 * f11 - f01 * f10)
    return J


@njit(cache=True, error_model="numpy")
def subtract_forces(x, model, parameters, work, r):
    """r <- r - f(x), eqs. (1) and (3), in elimination order; returns the least J and the cell where it occurs.

    x (n, 3), r (3 n_free,) updated in place; work.xe, work.F, work.P are overwritten
    """
    deformation(x, model, parameters, work)
    least, worst = np.inf, -1
    n_cells = len(model.cell_nodes)
    for cell in range(n_cells):
        part = work.part[cell]
        for q in range(8):
            mu, lam, weight = parameters.mu[cell, q], parameters.lambda_[cell, q], part * parameters.weight[cell, q]
            J = point_stress(work.F[cell], 3 * q, model.linear, mu, lam, weight, work.P[cell])
            if not least <= J:
                least, worst = J, cell
    if model.n_state > 0:
        relaxing_cells.add_stresses(model, parameters, work)
    multiply_full(model, parameters, work.P, parameters.gradient_t, work.fe, 27, 24, False, work.ints)
    if len(parameters.cut_force) > 0:
        both = work.both
        for cell in range(n_cells):
            cut = model.cut[cell]
            if cut >= 0:
                for i in range(3):
                    both[i, :24] = work.P[cell, i]
                    for a in range(27):
                        both[i, 24 + a] = work.part[cell] * work.xe[cell, i, a]
                multiply(both, parameters.cut_force[cut], work.fe[cell], 3, 27, 51, False, work.ints)
    if parameters.uneven or work.mixed[0] > 0:
        for cell in range(n_cells):
            scale = work.part[cell] * parameters.mean_mu[cell]
            for i in range(3):
                for a in range(27):
                    work.xe[cell, i, a] *= scale
    multiply_full(model, parameters, work.xe, parameters.stabilisation, work.fe, 27, 27, True, work.ints)
    for cell in range(n_cells):
        for a in range(27):
            place = model.cell_order[cell, a]
            if place >= 0:
                r[3 * place] -= work.fe[cell, 0, a]
                r[3 * place + 1] -= work.fe[cell, 1, a]
                r[3 * place + 2] -= work.fe[cell, 2, a]
    return least, worst


@njit(cache=True, error_model="numpy")
def least_square_stretch(F, at):
    """Least eigenvalue of F^T F, from the trigonometric solution of the cubic."""
    c00 = c11 = c22 = c01 = c02 = c12 = 0.0
    for i in range(3):
        a, b, c = F[i, at], F[i, at + 1], F[i, at + 2]
        c00 += a * a
        c11 += b * b
        c22 += c * c
        c01 += a * b
        c02 += a * c
        c12 += b * c
    mean = (c00 + c11 + c22) / 3.0
    d0, d1, d2 = c00 - mean, c11 - mean, c22 - mean
    size = np.sqrt((d0 * d0 + d1 * d1 + d2 * d2 + 2.0 * (c01 * c01 + c02 * c02 + c12 * c12)) / 6.0)
    if size <= 1e-14 * mean:
        return mean
    det = d0 * (d1 * d2 - c12 * c12) - c01 * (c01 * d2 - c12 * c02) + c02 * (c01 * c12 - d1 * c02)
    cosine = min(1.0, max(-1.0, 0.5 * det / (size * size * size)))
    return max(0.0, mean + 2.0 * size * np.cos((np.arccos(cosine) + 2.0 * np.pi) / 3.0))


@njit(cache=True, error_model="numpy")
def point_factors(F, at, linear, mu, lam, weight, safe, H):
    """A_q, B_q of the module's last line; H (3, 3) = cof F (or I) updated in place.

    safe: |B| is kept below mu times the least square stretch, which makes the cell's matrix positive semi-definite:
    with dF = G F the rest is mu |dF|^2 + B tr(G G) + A' tr(G)^2 (times J^2 in B), and |G|^2 <= |dF|^2 / stretch^2.
    """
    if linear:
        for i in range(3):
            for j in range(3):
                H[i, j] = 1.0 if i == j else 0.0
        return weight * lam, weight * mu
    f00, f01, f02 = F[0, at], F[0, at + 1], F[0, at + 2]
    f10, f11, f12 = F[1, at], F[1, at + 1], F[1, at + 2]
    f20, f21, f22 = F[2, at], F[2, at + 1], F[2, at + 2]
    H[0, 0], H[0, 1], H[0, 2] = f11 * f22 - f12 * f21, f12 * f20 - f10 * f22, f10 * f21 - f11 * f20
    H[1, 0], H[1, 1], H[1, 2] = f02 * f21 - f01 * f22, f00 * f22 - f02 * f20, f01 * f20 - f00 * f21
    H[2, 0], H[2, 1], H[2, 2] = f01 * f12 - f02 * f11, f02 * f10 - f00 * f12, f00 * f11 - f01 * f10
    J = f00 * H[0, 0] + f01 * H[0, 1] + f02 * H[0, 2]
    _, s, ds = volumetric(J, mu, lam)
    divisor = J if abs(J) > 1e-3 else (1e-3 if J >= 0.0 else -1e-3)
    b = -s / divisor
    if safe:
        limit = mu * least_square_stretch(F, at) / (divisor * divisor)
        b = min(limit, max(-limit, b))
        return weight * max(0.0, ds - b), weight * b
    return weight * (ds - b), weight * b


@njit(cache=True, error_model="numpy")
def _block_row(a, h, A, B, row):
    """row[(3 i + k) * LANES + b] <- sum_q of eq. (2) for all b, two points a pass.

    h[(3 q + i) * LANES + b] = h_ib at point q
    """
    for b in range(9 * LANES):
        row[b] = 0.0
    for q in range(0, 8, 2):
        s = 3 * q * LANES
        hx, hy, hz = h[s + a], h[s + LANES + a], h[s + 2 * LANES + a]
        ux, uy, uz = h[s + 3 * LANES + a], h[s + 4 * LANES + a], h[s + 5 * LANES + a]
        ax, ay, az = A[q] * hx, A[q] * hy, A[q] * hz
        bx, by, bz = B[q] * hx, B[q] * hy, B[q] * hz
        ex, ey, ez = A[q + 1] * ux, A[q + 1] * uy, A[q + 1] * uz
        fx, fy, fz = B[q + 1] * ux, B[q + 1] * uy, B[q + 1] * uz
        cx, cy, cz = ax + bx, ay + by, az + bz
        gx, gy, gz = ex + fx, ey + fy, ez + fz
        for b in range(LANES):
            x, y, z = h[s + b], h[s + LANES + b], h[s + 2 * LANES + b]
            u, v, w = h[s + 3 * LANES + b], h[s + 4 * LANES + b], h[s + 5 * LANES + b]
            row[b] += cx * x + gx * u
            row[LANES + b] += ax * y + by * x + ex * v + fy * u
            row[2 * LANES + b] += ax * z + bz * x + ex * w + fz * u
            row[3 * LANES + b] += ay * x + bx * y + ey * u + fx * v
            row[4 * LANES + b] += cy * y + gy * v
            row[5 * LANES + b] += ay * z + bz * y + ey * w + fz * v
            row[6 * LANES + b] += az * x + bx * z + ez * u + fx * w
            row[7 * LANES + b] += az * y + by * z + ez * v + fy * w
            row[8 * LANES + b] += cz * z + gz * w


@njit(cache=True, error_model="numpy")
def add_cell_tangents(x, model, parameters, tree, work, safe):
    """Add K of eq. (2) at x to the fronts in work.values, updated in place; nodes of a cell in elimination order."""
    deformation(x, model, parameters, work)
    if model.n_state > 0:
        add_relaxing_tangents(model, parameters, tree, work, safe)
        return
    h, row = work.h, work.row
    A, B, H = np.empty(8), np.empty(8), np.empty((3, 3))
    for cell in range(len(model.cell_nodes)):
        n_free = tree.cell_free[cell]
        local = tree.cell_local[cell]
        gradient = parameters.gradient if model.cut[cell] < 0 else parameters.cut_gradient[model.cut[cell]]
        for q in range(8):
            mu, lam, weight = (
                parameters.mu[cell, q],
                parameters.lambda_[cell, q],
                work.part[cell] * parameters.weight[cell, q],
            )
            A[q], B[q] = point_factors(work.F[cell], 3 * q, model.linear, mu, lam, weight, safe, H)
            at = 3 * q * LANES
            for b in range(n_free):
                a = local[b]
                g0, g1, g2 = gradient[a, 3 * q], gradient[a, 3 * q + 1], gradient[a, 3 * q + 2]
                h[at + b] = H[0, 0] * g0 + H[0, 1] * g1 + H[0, 2] * g2
                h[at + LANES + b] = H[1, 0] * g0 + H[1, 1] * g1 + H[1, 2] * g2
                h[at + 2 * LANES + b] = H[2, 0] * g0 + H[2, 1] * g1 + H[2, 2] * g2
        L = parameters.laplacian[model.pattern[cell]]
        for a in range(n_free):
            _block_row(a, h, A, B, row)
            for b in range(a, n_free):
                constant = work.part[cell] * L[local[a], local[b]]
                row[b] += constant
                row[4 * LANES + b] += constant
                row[8 * LANES + b] += constant
            add_block_row(tree, work.values, cell, a, row, LANES)


@njit(cache=True, error_model="numpy")
def add_relaxing_tangents(model, parameters, tree, work, safe):
    """The same where the material has branches that relax, with the whole tangent at each point; of work.F."""
    h, row, H, left = work.h, work.row, np.empty((3, 3)), np.zeros(216 * LANES)
    steps, w = relaxing_cells.steps_of(model, parameters, work), np.empty(relaxing_cells.SIZE)
    c, D, half = np.empty((8, 9, 9)), np.empty((6, 6)), np.empty((6, 9))
    for cell in range(len(model.cell_nodes)):
        n_free, local, part = tree.cell_free[cell], tree.cell_local[cell], work.part[cell]
        gradient = parameters.gradient if model.cut[cell] < 0 else parameters.cut_gradient[model.cut[cell]]
        for q in range(8):
            mu, lam, weight = parameters.mu[cell, q], parameters.lambda_[cell, q], part * parameters.weight[cell, q]
            A, B = point_factors(work.F[cell], 3 * q, False, mu, lam, weight, safe, H)
            step, state = steps[parameters.material[cell, q]], work.material_state[cell, q]
            relaxing_cells.write_tangent(work.F[cell], q, weight, A, B, H, step, state, safe, w, D, half, c[q])
            at = 3 * q * LANES
            for b in range(n_free):
                for j in range(3):
                    h[at + j * LANES + b] = gradient[local[b], 3 * q + j]
        L = parameters.laplacian[model.pattern[cell]]
        relaxing_cells.sides(h, c, left)
        for a in range(n_free):
            relaxing_cells.block_row(a, h, left, row)
            for b in range(a, n_free):
                constant = part * L[local[a], local[b]]
                row[b] += constant
                row[4 * LANES + b] += constant
                row[8 * LANES + b] += constant
            add_block_row(tree, work.values, cell, a, row, LANES)


@njit(cache=True, error_model="numpy")
def strain_energy(x, model, parameters, work):
    """Energy [J] whose gradient is f: sum_q w_q psi(F) + mean(mu)/2 sum_ab S_ab x_a . x_b.

    work.energy (c,) += each cell's
    """
    deformation(x, model, parameters, work)
    n_cells = len(model.cell_nodes)
    multiply_full(model, parameters, work.xe, parameters.stabilisation, work.fe, 27, 27, False, work.ints)
    total = 0.0
    for cell in range(n_cells):
        F = work.F[cell]
        own = 0.0
        for q in range(8):
            at = 3 * q
            mu, lam = parameters.mu[cell, q], parameters.lambda_[cell, q]
            square = cross = 0.0
            for i in range(3):
                for j in range(3):
                    f = F[i, at + j] - (1.0 if i == j else 0.0)
                    square += f * f
                    cross += f * (F[j, at + i] - (1.0 if i == j else 0.0))
            trace = F[0, at] + F[1, at + 1] + F[2, at + 2] - 3.0
            if model.linear:
                density = 0.5 * mu * (square + cross) + 0.5 * lam * trace * trace
            else:
                # F : F - 3 = |F - I|^2 + 2 tr(F - I): no cancellation near rest
                J = F[0, at] * (F[1, at + 1] * F[2, at + 2] - F[1, at + 2] * F[2, at + 1])
                J += F[0, at + 1] * (F[1, at + 2] * F[2, at] - F[1, at] * F[2, at + 2])
                J += F[0, at + 2] * (F[1, at] * F[2, at + 1] - F[1, at + 1] * F[2, at])
                density = 0.5 * mu * (square + 2.0 * trace) + volumetric(J, mu, lam)[0]
            own += parameters.weight[cell, q] * density
        quadratic = 0.0
        if model.cut[cell] >= 0:
            S = parameters.cut_force[model.cut[cell], 24:]
            for i in range(3):
                for a in range(27):
                    pull = 0.0
                    for b in range(27):
                        pull += S[a, b] * work.xe[cell, i, b]
                    quadratic += work.xe[cell, i, a] * pull
        else:
            for i in range(3):
                for a in range(27):
                    quadratic += work.xe[cell, i, a] * work.fe[cell, i, a]
            quadratic *= parameters.mean_mu[cell]
        own = work.part[cell] * (own + 0.5 * quadratic)
        work.energy[cell] += own
        total += own
    if model.n_state > 0:
        total += relaxing_cells.add_energies(model, parameters, work)
    return total


@njit(cache=True, error_model="numpy")
def cauchy_stress(x, model, parameters, work, out):
    """Cauchy stress xx yy zz yz xz xy at the 8 octants' Gauss points; out (c, 8, 6) [Pa] updated in place.

    P F^T / J; zero in an empty octant. Of what each octant has of itself, also where it counts with another's.
    """
    deformation(x, model, parameters, work)
    P, w = np.zeros((3, 24)), np.empty(relaxing_cells.SIZE)
    steps = relaxing_cells.steps_of(model, parameters, work)
    for cell in range(len(model.cell_nodes)):
        F = work.F[cell]
        if model.cut[cell] >= 0:
            multiply(work.xe[cell], parameters.own_gradient[model.cut[cell]], F, 3, 24, 27, False, work.ints)
        for q in range(8):
            at = 3 * q
            J = point_stress(F, at, model.linear, parameters.mu[cell, q], parameters.lambda_[cell, q], 1.0, P)
            if model.n_state > 0:
                step = steps[parameters.material[cell, q]]
                relaxing_cells.add_own(F, q, step, work.material_state[cell, q], w, P)
            for n in range(6):
                i, j = (0, 1, 2, 1, 0, 0)[n], (0, 1, 2, 2, 2, 1)[n]
                if model.linear:
                    sigma = P[i, at + j]
                else:
                    sigma = (P[i, at] * F[j, at] + P[i, at + 1] * F[j, at + 1] + P[i, at + 2] * F[j, at + 2]) / J
                out[cell, q, n] = sigma if model.filled[cell, q] else 0.0
