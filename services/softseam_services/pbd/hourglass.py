"""Constants of the block constraint: Lame constants, edges and the assumed-strain hourglass stiffness."""

from typing import TypeVar

import numpy as np

from softseam_services.body.body import Floats, Material

from .kernels.block_rows import BOUND, LAM, MU, N_CONSTANTS, PAIR, PARAMETERS, SHEAR, TWIST, B, G

FITTED = 0.85
"""d of the fitted stiffness, whose o is 0"""


Share = TypeVar("Share", float, Floats)


def bending_factors(poisson: Share, hourglass: str) -> tuple[Share, Share]:
    """d and o of `box_constants`."""
    if hourglass == "physical":
        return 1.0 / (1.0 - poisson**2), poisson / (1.0 - poisson**2)
    return FITTED + 0.0 * poisson, 0.0 * poisson


def block_constants(material: Material, edges: Floats, hourglass: str) -> Floats:
    """A row of `Constants.table` for blocks with these edges (3,) [m]."""
    poisson = material.young / (2.0 * material.mu) - 1.0
    k: Floats = box_constants(np.array([material.young]), np.array([poisson]), edges[None], hourglass)[0]
    k[MU], k[LAM] = material.mu, material.lambda_
    k[PARAMETERS:] = material.parameters
    return k


def box_constants(young: Floats, poisson: Floats, edges: Floats, hourglass: str) -> Floats:
    """Rows of `Constants.table` (n, N_CONSTANTS), without the material's parameters, for blocks with edges (n, 3) [m].

    Stiffness per volume of the modes (h, component), a = 2/l: bending pairs {(xi zeta, x), (eta zeta, y)} and so on
    d E a_i^2/3 and o E a_i a_j/3; shear mu/3 v v^T with v = a_y (eta zeta, x) + a_x (xi zeta, y) and so on; twist
    (xi eta zeta, c) E a_c^2/9; all of them for q_m = 1/8 sum h_mi x_i, so 1/64 of that for the blocks' sum h_mi x_i.
    Physical: d = 1/(1 - nu^2), o = nu/(1 - nu^2), exact for bending of a plate; fitted: (d, o) = (0.85, 0), softer,
    closer for bodies two and more blocks thick, wrong for bodies one block thick.
    """
    mu = young / (2.0 * (1.0 + poisson))
    d, o = bending_factors(poisson, hourglass)
    a = 2.0 / edges
    k = np.zeros((len(young), N_CONSTANTS))
    k[:, MU], k[:, LAM] = mu, young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    k[:, B : B + 3] = 1.0 / (4.0 * edges)
    k[:, G : G + 3] = 1.0 / (16.0 * edges**2)
    for entry, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        third = young / 3.0
        k[:, PAIR + 3 * entry] = third * (d * a[:, i] ** 2)
        k[:, PAIR + 3 * entry + 1] = third * (d * a[:, j] ** 2)
        k[:, PAIR + 3 * entry + 2] = third * (o * a[:, i] * a[:, j])
    shear = np.zeros((len(young), 3, 3))
    none = np.zeros(len(young))
    for v in ((a[:, 1], a[:, 0], none), (a[:, 2], none, a[:, 0]), (none, a[:, 2], a[:, 1])):
        shear += (mu / 3.0)[:, None, None] * (np.stack(v, axis=1)[:, :, None] * np.stack(v, axis=1)[:, None, :])
    k[:, SHEAR : SHEAR + 6] = shear[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    k[:, TWIST : TWIST + 3] = young[:, None] * a**2 / 9.0
    k[:, PAIR:BOUND] /= 64.0
    shear /= 64.0
    # k_m: the largest absolute row sum of mode m over its three components, per volume.
    row = np.abs(shear).sum(axis=2)
    pair = np.abs(k[:, PAIR : PAIR + 9]).reshape(-1, 3, 3)
    largest = np.maximum.reduce
    k[:, BOUND] = largest([row[:, 0], pair[:, 0, 1] + pair[:, 0, 2], pair[:, 1, 1] + pair[:, 1, 2]])
    k[:, BOUND + 1] = largest([row[:, 1], pair[:, 0, 0] + pair[:, 0, 2], pair[:, 2, 1] + pair[:, 2, 2]])
    k[:, BOUND + 2] = largest([row[:, 2], pair[:, 1, 0] + pair[:, 1, 2], pair[:, 2, 0] + pair[:, 2, 2]])
    k[:, BOUND + 3] = k[:, TWIST : TWIST + 3].max(axis=1)
    return k
