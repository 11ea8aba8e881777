"""Green strain of a tetrahedron, E = (F^T F - 1)/2, held to zero component by component (Mueller et al. 2014).

Seven constraints C: E_00, E_11, E_22, the shears 2 E_01, 2 E_02, 2 E_12, and the trace. Their energies add up to that
of St. Venant-Kirchhoff, V (mu E:E + lambda/2 (tr E)^2), with the compliances 1/(2 mu V), 1/(mu V) and 1/(lambda V)
[1/J]: shear over G times *volume*, since the strain has no unit. Gradients by x_k, k = 1..3: of E_ab, 1/2 (f_a d_kb +
f_b d_ka) with f_a the columns of F and d_k the rows of D_m^-1; that of x_0 is minus their sum.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.pbd.kernels.lanes import batch_kernel

from .tetrahedron import deformation, is_crushed, metric

WIDTH = 8
N_STRAINS = 7


@batch_kernel
def project_strains(xw, nodes, row, inverse, soft, share, lam):
    """Project the seven constraints of every tetrahedron one after the other.

    inverse (b, 9, 8) D_m^-1; soft (b, 3, 8) alpha/h^2 of stretches, shears and the trace; lam (b, 7, 8) in place
    """
    if len(nodes) == 0:
        return
    g = np.zeros((4, 3))
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            i, j = nodes[batch, 0, lane], nodes[batch, 1, lane]
            k, m = nodes[batch, 2, lane], nodes[batch, 3, lane]
            for number in range(N_STRAINS):
                f = deformation(xw, i, j, k, m, inverse, batch, lane)
                f00, f01, f02, f10, f11, f12, f20, f21, f22 = f
                columns = ((f00, f10, f20), (f01, f11, f21), (f02, f12, f22))
                g[:] = 0.0
                value = 0.0
                for a in range(3):
                    for b in range(a, 3):
                        if number < 3:
                            factor = 1.0 if a == b == number else 0.0
                        elif number < 6:
                            factor = 2.0 if a != b and a + b == number - 2 else 0.0
                        else:
                            factor = 1.0 if a == b else 0.0
                        if factor == 0.0:
                            continue
                        fa, fb = columns[a], columns[b]
                        dot = fa[0] * fb[0] + fa[1] * fb[1] + fa[2] * fb[2]
                        value += 0.5 * factor * (dot - (1.0 if a == b else 0.0))
                        for corner in range(3):
                            da = 0.5 * factor * inverse[batch, 3 * corner + a, lane]
                            db = 0.5 * factor * inverse[batch, 3 * corner + b, lane]
                            for axis in range(3):
                                change = fa[axis] * db + fb[axis] * da
                                g[corner + 1, axis] += change
                                g[0, axis] -= change
                weight = 0.0
                for corner in range(4):
                    weight += xw[nodes[batch, corner, lane], 3] * (
                        g[corner, 0] ** 2 + g[corner, 1] ** 2 + g[corner, 2] ** 2
                    )
                if weight == 0.0:
                    continue
                alpha = soft[batch, min(number // 3, 2), lane]
                step = -share * (value + alpha * lam[batch, number, lane]) / (weight + alpha)  # eq. (1)
                lam[batch, number, lane] += step
                for corner in range(4):
                    node = nodes[batch, corner, lane]
                    for axis in range(3):
                        xw[node, axis] += xw[node, 3] * step * g[corner, axis]


@njit(cache=True, error_model="numpy")
def measure_strains(xw, nodes, row, inverse, soft, lam, h, strain, result):
    """How well strains are met: result (6,) in place, as of `distance.measure_distances`: a violation is |C + alpha~
    lambda|, without unit as it is, and the largest strain is that of any component. strain (n,) [1] is raised."""
    energy, worst, total, most, count, crushed = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for batch in range(len(nodes)):
        for lane in range(WIDTH):
            if row[batch, lane] < 0:
                continue
            i, j = nodes[batch, 0, lane], nodes[batch, 1, lane]
            k, m = nodes[batch, 2, lane], nodes[batch, 3, lane]
            f = deformation(xw, i, j, k, m, inverse, batch, lane)
            crushed += 1.0 if is_crushed(f) else 0.0
            xx, yy, zz, xy, xz, yz = metric(f)
            xx, yy, zz = 0.5 * (xx - 1.0), 0.5 * (yy - 1.0), 0.5 * (zz - 1.0)
            values = (xx, yy, zz, xy, xz, yz, xx + yy + zz)
            held = xw[i, 3] + xw[j, 3] + xw[k, 3] + xw[m, 3] == 0.0
            largest = 0.0
            for number in range(N_STRAINS):
                value, multiplier = values[number], lam[batch, number, lane]
                energy -= 0.5 * value * multiplier / (h * h)
                violation = 0.0 if held else abs(value + soft[batch, min(number // 3, 2), lane] * multiplier)
                worst = max(worst, violation)
                total += violation
                if number < 6:
                    largest = max(largest, abs(value) if number < 3 else 0.5 * abs(value))
            most = max(most, largest)
            for corner in range(4):
                node = nodes[batch, corner, lane]
                strain[node] = max(strain[node], largest)
            count += N_STRAINS
    result[0], result[1], result[2], result[3], result[4], result[5] = energy, worst, total, most, count, crushed
