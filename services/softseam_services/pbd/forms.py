"""What the kernels need of blocks that are hexahedra of any shape; the equations are those of `kernels.form`.

Turned by Q before all else, the nodes at rest have a diagonal G = sum b_i b_i^T: then the local solve of a material
that does not know where its axes lie is that of a box. A linear material knows, and so does one that remembers; their
blocks keep the body's axes, and the row sums of |G| take the place of G's diagonal.
"""

from itertools import product

import numpy as np

from softseam_services.body.body import SAME, Floats, Material
from softseam_services.body.materials.point import LINEAR

from .hourglass import bending_factors
from .kernels.block_rows import BOUND, LAM, MU, G
from .kernels.form import CURVE, FORM_PARAMETERS, FRAME, N_FORM, OFFSET, PLANE, SLOPE, TWIST_OF_FORM

SIGNS = np.array([(i, j, k) for k in (-1.0, 1.0) for j in (-1.0, 1.0) for i in (-1.0, 1.0)])
"""xi, eta, zeta of the nodes (8, 3)"""
MODES = np.stack([SIGNS[:, [1, 2]].prod(1), SIGNS[:, [0, 2]].prod(1), SIGNS[:, [0, 1]].prod(1), SIGNS.prod(1)])
"""h_m (4, 8)"""
_PLANES = ((0, 1), (0, 2), (1, 2))


def mean_slopes(x: Floats) -> tuple[Floats, Floats]:
    """b_i (n, 8, 3) [1/m] and volumes (n,) [m^3] of blocks with nodes x (n, 8, 3); exact with 2^3 Gauss points."""
    slopes, volume = np.zeros_like(x), np.zeros(len(x))
    for point in product((-1.0, 1.0), repeat=3):
        near = 1.0 + SIGNS * (np.array(point) / np.sqrt(3.0))
        local = 0.125 * SIGNS * np.stack([near[:, [1, 2]], near[:, [0, 2]], near[:, [0, 1]]], axis=1).prod(axis=2)
        turned = np.einsum("nip,ia->npa", x, local)  # dx_p/dxi_a
        ratio = np.linalg.det(turned)
        slopes += ratio[:, None, None] * (local @ np.linalg.inv(turned))
        volume += ratio
    return slopes / volume[:, None, None], volume


def build_forms(x: Floats, material: Material, hourglass: str, weight: Floats | None = None) -> tuple[Floats, Floats]:
    """Forms (n, N_FORM) and volumes (n,) [m^3] of blocks of one material with nodes x (n, 8, 3) [m] at rest.

    weight (n, 8, 8): what each node gives to each of the block's corners where some of these hang, see `levels`; the
    hourglass stiffness is then that of the hexahedron of the nodes.
    """
    if weight is None:
        slopes, volume = mean_slopes(x)
    else:
        slopes, volume = mean_slopes(weight @ x)
        slopes = weight.transpose(0, 2, 1) @ slopes
    gram = np.einsum("nip,niq->npq", slopes, slopes)
    if material.number != LINEAR and not material.n_state:
        turn = _axes(gram)
        x, slopes = x @ turn, slopes @ turn
        spread = np.einsum("nip,nip->np", slopes, slopes)
    else:
        spread = np.abs(gram).sum(axis=2)
    offset = np.einsum("mi,nip->nmp", MODES, x)
    frame = np.einsum("ia,nip->nap", SIGNS, x) / 8.0
    d, o = bending_factors(material.young / (2.0 * material.mu) - 1.0, hourglass)
    planes, twist = hourglass_planes(frame, material.young, material.mu, d, o)
    form = np.empty((len(x), N_FORM))
    form[:, MU], form[:, LAM] = material.mu, material.lambda_
    form[:, FORM_PARAMETERS:] = material.parameters
    form[:, TWIST_OF_FORM : TWIST_OF_FORM + 3] = twist
    form[:, G : G + 3] = spread / 8.0
    form[:, PLANE : PLANE + 18] = planes.reshape(-1, 3, 9)[:, :, [0, 4, 8, 1, 2, 5]].reshape(-1, 18)
    form[:, FRAME : FRAME + 9] = frame.reshape(-1, 9)
    form[:, SLOPE : SLOPE + 9] = np.einsum("ia,nip->nap", SIGNS, slopes).reshape(-1, 9) / 8.0
    form[:, CURVE : CURVE + 12] = np.einsum("mi,nip->nmp", MODES, slopes).reshape(-1, 12) / 8.0
    form[:, OFFSET : OFFSET + 12] = offset.reshape(-1, 12)
    gamma = MODES - np.einsum("nip,nmp->nmi", slopes, offset)
    reach = np.abs(np.einsum("nmi,nki->nmk", gamma, gamma)).sum(axis=2) / 8.0
    rows = np.abs(_stiffness(frame, planes, twist)).sum(axis=(3, 4)).max(axis=2)
    form[:, BOUND : BOUND + 4] = reach * rows
    return form, volume


def _axes(gram: Floats) -> Floats:
    """Q (n, 3, 3), a rotation whose columns are the axes of G (n, 3, 3); the unit matrix where G is diagonal."""
    turn = np.linalg.eigh(gram)[1]
    turn[:, :, 0] *= np.sign(np.linalg.det(turn))[:, None]
    # off-diagonal entries that are rounding: such a block lies along the axes
    off = np.abs(gram[:, [0, 0, 1], [1, 2, 2]]).max(axis=1)
    turn[off <= SAME * np.trace(gram, axis1=1, axis2=2)] = np.eye(3)
    return np.asarray(turn)


def hourglass_planes(frame: Floats, young: float, mu: float, d: float, o: float) -> tuple[Floats, Floats]:
    """D of the planes xy, xz, yz (n, 3, 3, 3) and of the twist (n, 3) for skew axes g (n, 3, 3), see `hourglass`.

    In the plane of g_a and g_b with the inverse metric A = [[a, c], [c, b]] a strain e = (e_aa, e_bb, 2 e_ab) has
    the energy E/2 ((d - o) tr(A e A e) + o tr(A e)^2), d - o = 1/(1 + nu): isotropic plane stress. The fitted factors
    leave the shear modulus mu as it is. Linear in a coordinate, so one third of it; for sums of nodes, 1/64.
    """
    planes = np.empty((len(frame), 3, 3, 3))
    for number, (i, j) in enumerate(_PLANES):
        metric = np.einsum("nap,nbp->nab", frame[:, [i, j]], frame[:, [i, j]])
        inverse = np.linalg.inv(metric)
        a, b, c = inverse[:, 0, 0], inverse[:, 1, 1], inverse[:, 0, 1]
        trace = np.stack([a, b, c], axis=1)
        shear = 0.5 * (a * b + c * c)
        double = np.stack([a * a, c * c, a * c, c * c, b * b, b * c, a * c, b * c, shear], axis=1).reshape(-1, 3, 3)
        planes[:, number] = young * ((d - o) * double + o * trace[:, :, None] * trace[:, None, :])
        planes[:, number, 2, 2] += (mu - 0.5 * young * (d - o)) * a * b
    return planes / (3.0 * 64.0), young / (9.0 * 64.0 * np.einsum("nap,nap->na", frame, frame) ** 2)


def _stiffness(frame: Floats, planes: Floats, twist: Floats) -> Floats:
    """K of eq. (2) of `kernels.block` (n, 4, 3, 4, 3) [Pa/m^2]."""
    n = len(frame)
    strain = np.zeros((n, 3, 3, 4, 3))  # of planes, by modes and components
    for number, (i, j) in enumerate(_PLANES):
        # Of the two modes that are linear in the third coordinate mode j strains along i, mode i along j.
        strain[:, number, 0, j] = frame[:, i]
        strain[:, number, 1, i] = frame[:, j]
        strain[:, number, 2, i] = frame[:, i]
        strain[:, number, 2, j] = frame[:, j]
    k = np.einsum("nfemp,nfeg,nfgkq->nmpkq", strain, planes, strain, optimize=True)
    k[:, 3, :, 3, :] += np.einsum("nap,na,naq->npq", frame, twist, frame)
    return np.asarray(k)
