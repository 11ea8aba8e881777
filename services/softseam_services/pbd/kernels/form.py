"""What blocks have of their own that are hexahedra of any shape: how F, q and forces follow from their nodes.

With the mean slopes b_i = 1/V int grad N_i dV of the block's eight functions, which alone pass the patch test
(Flanagan and Belytschko 1981, doi:10.1002/nme.1620170504), X_i the nodes at rest and h_m the modes of `block`:

F = sum x_i b_i^T,   q_m = sum gamma_mi x_i,   gamma_mi = h_mi - b_i . H_m,   H_m = sum h_mi X_i                 (1)

so that q = 0 wherever x is affine in X. As b_i = xi_i beta_x + eta_i beta_y + zeta_i beta_z + sum h_mi eps_m, both
follow from the sums over the nodes that a box has, d_a = sum xi_ai x_i and r_m = sum h_mi x_i:

F = sum d_a beta_a^T + sum r_m eps_m^T,   q_m = r_m - F H_m                                                      (2)

and nodal forces, by the transpose, from those of a box. The hourglass stiffness is that of boxes, in the skew axes
g_a = sum xi_ai X_i/8: of the strains q_m.g_b those that are linear in zeta belong to a plate in the plane of g_x and
g_y, and so on (`forms.hourglass_planes`).
Rows are those of the workspace from FORM on; the first ones are laid out as `block`'s constants, where
TWIST_OF_FORM takes the place of the edges, and PLANE that of pairs, shear and twist.
"""

from softseam_services.body.materials.prototype import MAX_PARAMETERS

from .lanes import LANES, lane_kernel, move_four

FORM = 78
"""row of the workspace from which on a form lies"""
TWIST_OF_FORM, PLANE, FRAME, SLOPE, CURVE, OFFSET, FORM_PARAMETERS = 2, 8, 30, 39, 48, 60, 72
"""E/(9 |g_a|^4 64); of the planes x y, x z, y z each D_11 22 33 12 13 23; g_a; beta_a; eps_m; H_m; of the material"""
N_HOISTED = FORM_PARAMETERS
"""numbers of a block in the workspace: those before the material's parameters"""
N_FORM = FORM_PARAMETERS + MAX_PARAMETERS
"""numbers of a block"""


@lane_kernel
def bring_forms(ws, constants):
    """The forms of a batch (N_FORM, LANES) into the workspace."""
    for row in range(N_HOISTED):
        move_four(ws, LANES * (FORM + row), constants, LANES * row)


@lane_kernel
def of_form(ws, lane):
    """Constants of a lane as `block.hoist` has them for boxes, then FRAME (39 values)."""
    a = lane + LANES * FORM
    return (
        *(ws[a], ws[a + LANES], ws[a + LANES * 2], ws[a + LANES * 3], ws[a + LANES * 4], ws[a + LANES * 5]),
        *(ws[a + LANES * 6], ws[a + LANES * 7], ws[a + LANES * 8], ws[a + LANES * 9], ws[a + LANES * 10]),
        *(ws[a + LANES * 11], ws[a + LANES * 12], ws[a + LANES * 13], ws[a + LANES * 14], ws[a + LANES * 15]),
        *(ws[a + LANES * 16], ws[a + LANES * 17], ws[a + LANES * 18], ws[a + LANES * 19], ws[a + LANES * 20]),
        *(ws[a + LANES * 21], ws[a + LANES * 22], ws[a + LANES * 23], ws[a + LANES * 24], ws[a + LANES * 25]),
        *(ws[a + LANES * 26], ws[a + LANES * 27], ws[a + LANES * 28], ws[a + LANES * 29], ws[a + LANES * 30]),
        *(ws[a + LANES * 31], ws[a + LANES * 32], ws[a + LANES * 33], ws[a + LANES * 34], ws[a + LANES * 35]),
        *(ws[a + LANES * 36], ws[a + LANES * 37], ws[a + LANES * 38]),
    )


@lane_kernel
def _three(ws, lane, row):
    """Three rows of the form."""
    a = lane + LANES * (FORM + row)
    return ws[a], ws[a + LANES], ws[a + 2 * LANES]


@lane_kernel
def _mix(u, a, v, b, w, c):
    """u a + v b + w c for vectors a, b, c."""
    return u * a[0] + v * b[0] + w * c[0], u * a[1] + v * b[1] + w * c[1], u * a[2] + v * b[2] + w * c[2]


@lane_kernel
def _dot(p, a):
    return p[0] * a[0] + p[1] * a[1] + p[2] * a[2]


@lane_kernel
def from_sums(ws, lane, d, r):
    """A row of F and a component of q of the nodes' sums d (3 values) and r (4 values), eq. (2)."""
    x, y, z = _three(ws, lane, SLOPE), _three(ws, lane, SLOPE + 3), _three(ws, lane, SLOPE + 6)
    g = _mix(d[0], x, d[1], y, d[2], z)
    a, b, c = _three(ws, lane, CURVE), _three(ws, lane, CURVE + 3), _three(ws, lane, CURVE + 6)
    h, e = _mix(r[0], a, r[1], b, r[2], c), _three(ws, lane, CURVE + 9)
    f = g[0] + h[0] + r[3] * e[0], g[1] + h[1] + r[3] * e[1], g[2] + h[2] + r[3] * e[2]
    return f, (
        r[0] - _dot(f, _three(ws, lane, OFFSET)),
        r[1] - _dot(f, _three(ws, lane, OFFSET + 3)),
        r[2] - _dot(f, _three(ws, lane, OFFSET + 6)),
        r[3] - _dot(f, _three(ws, lane, OFFSET + 9)),
    )


@lane_kernel
def to_sums(ws, lane, change):
    """The transpose of `from_sums`: what a row of P and a component of T (7 values) do along d and r (7 values)."""
    t = change[3], change[4], change[5], change[6]
    a, b, c = _three(ws, lane, OFFSET), _three(ws, lane, OFFSET + 3), _three(ws, lane, OFFSET + 6)
    h, e = _mix(t[0], a, t[1], b, t[2], c), _three(ws, lane, OFFSET + 9)
    p = change[0] - h[0] - t[3] * e[0], change[1] - h[1] - t[3] * e[1], change[2] - h[2] - t[3] * e[2]
    return (
        _dot(p, _three(ws, lane, SLOPE)),
        _dot(p, _three(ws, lane, SLOPE + 3)),
        _dot(p, _three(ws, lane, SLOPE + 6)),
        t[0] + _dot(p, _three(ws, lane, CURVE)),
        t[1] + _dot(p, _three(ws, lane, CURVE + 3)),
        t[2] + _dot(p, _three(ws, lane, CURVE + 6)),
        t[3] + _dot(p, _three(ws, lane, CURVE + 9)),
    )


@lane_kernel
def _along(k, x, y, z):
    """A vector's products with g_x, g_y, g_z."""
    a = FRAME
    return (
        k[a] * x + k[a + 1] * y + k[a + 2] * z,
        k[a + 3] * x + k[a + 4] * y + k[a + 5] * z,
        k[a + 6] * x + k[a + 7] * y + k[a + 8] * z,
    )


@lane_kernel
def _across(k, u, v, w):
    """u g_x + v g_y + w g_z."""
    a = FRAME
    return (
        k[a] * u + k[a + 3] * v + k[a + 6] * w,
        k[a + 1] * u + k[a + 4] * v + k[a + 7] * w,
        k[a + 2] * u + k[a + 5] * v + k[a + 8] * w,
    )


@lane_kernel
def _plane(k, at, e1, e2, e3):
    """D (e1, e2, e3) of one plane."""
    return (
        k[at] * e1 + k[at + 3] * e2 + k[at + 4] * e3,
        k[at + 3] * e1 + k[at + 1] * e2 + k[at + 5] * e3,
        k[at + 4] * e1 + k[at + 5] * e2 + k[at + 2] * e3,
    )


@lane_kernel
def hourglass_of_form(k, q):
    """t = K q (12 values), per volume: the strains of each plane are xx yy 2xy, xx zz 2xz, yy zz 2yz."""
    x0, y0, z0 = _along(k, q[0], q[1], q[2])
    x1, y1, z1 = _along(k, q[3], q[4], q[5])
    x2, y2, z2 = _along(k, q[6], q[7], q[8])
    x3, y3, z3 = _along(k, q[9], q[10], q[11])
    a = _plane(k, PLANE, x1, y0, x0 + y1)
    b = _plane(k, PLANE + 6, x2, z0, x0 + z2)
    c = _plane(k, PLANE + 12, y2, z1, y1 + z2)
    t = k[TWIST_OF_FORM] * x3, k[TWIST_OF_FORM + 1] * y3, k[TWIST_OF_FORM + 2] * z3
    return (
        *_across(k, a[2] + b[2], a[1], b[1]),
        *_across(k, a[0], a[2] + c[2], c[1]),
        *_across(k, b[0], c[0], b[2] + c[2]),
        *_across(k, t[0], t[1], t[2]),
    )
