"""Cook's membrane, a twisted prism and a beam's natural frequencies, solved by independent codes, with any element."""

from __future__ import annotations

import numpy as np
from element_statics import Floats, Statics, lattice
from scipy.sparse import diags_array
from scipy.sparse.linalg import eigsh

from softseam_coupling.mortar import TRACES
from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.kinds import ElementKind

# Cook's membrane, plane strain, nu 0.4999, a quarter of the full load: tip uy [m], dolfinx Q2/Q1 mixed, case 03_cook.
COOK = 1.94546e-3
# Prism 30 x 30 x 120 mm, E 50 kPa, nu 0.45, ends bonded, turned by 60 degrees: torque [N m] and axial force [N], case
# 07_torsion (felupe, CalculiX).
TORQUE, AXIAL = 0.0173590, -0.029303
# Beam 0.1 x 0.02 x 0.02 m, E 100 kPa, nu 0.3, rho 1000, clamped at one end: frequencies [Hz], case
# 04_cantilever_dynamic (felupe, CalculiX): two bendings, torsion, two bendings, stretching.
FREQUENCIES = [3.16074, 3.16074, 14.28554, 17.04358, 17.04358, 25.13003]


def _uniform_face(functions: str) -> Floats:
    """Share of a uniform traction that each of a face's nodes a = i + 3 j takes (9,)."""
    gauss, weight = np.polynomial.legendre.leggauss(60)
    s, t = np.meshgrid(0.5 + 0.5 * gauss, 0.5 + 0.5 * gauss)
    share = 0.25 * np.outer(weight, weight).ravel() @ TRACES[functions](s.ravel(), t.ravel())
    return np.asarray(share)


def cook(element: ElementKind, n: int) -> float:
    """Tip uy [m] on n x n x 1 general hexahedra."""
    width, left, bottom, right, thick = 0.048, 0.044, 0.044, 0.016, 0.004

    def shift(x: Floats) -> Floats:
        along, up = x[:, 0] / width, x[:, 1] / left
        y = (1.0 - along) * up * left + along * (bottom + up * right)
        return np.stack([0.0 * y, y - x[:, 1], 0.0 * y], axis=1)

    body = lattice((width, left, thick), (n, n, 1), shift, young=240565.0, poisson=0.4999)
    case = Statics(body, element)
    x = case.x_rest
    held = np.zeros(x.shape, dtype=np.bool_)
    held[:, 2] = True
    held[x[:, 0] < 1e-9] = True
    load = np.zeros(x.shape)
    faces = body.cell_nodes.reshape(-1, 3, 3, 3)[:, :, :, 2].reshape(-1, 9)
    faces = faces[x[faces[:, 4], 0] > width - 1e-9]
    total = 0.25 * 6250.0 * right * thick
    load[:, 1] = np.bincount(faces.ravel(), np.tile(total / n * _uniform_face(FACTS[element].functions), n), len(x))
    x = case.solve(x, held, load)
    tip = np.argmin(np.abs(case.x_rest - [width, bottom + right, 0.0]).sum(axis=1))
    return float(x[tip, 1] - case.x_rest[tip, 1])


def twist(element: ElementKind, n: int) -> tuple[float, float]:
    """Torque [N m] and axial force [N] on n x n x 4n cells, turned by 60 degrees in three steps."""
    size, n_steps = (0.03, 0.03, 0.12), 3
    case = Statics(lattice(size, (n, n, 4 * n), young=50e3, poisson=0.45), element)
    X = case.x_rest - [0.015, 0.015, 0.0]
    top = X[:, 2] > size[2] - 1e-9
    held = np.repeat((top | (X[:, 2] < 1e-9))[:, None], 3, axis=1)

    def turned(angle: Floats) -> Floats:
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * X[:, 0] - s * X[:, 1], s * X[:, 0] + c * X[:, 1], X[:, 2]], axis=1)

    x = X
    for step in range(n_steps):
        angle = np.deg2rad(60.0) * (step + 1) / n_steps
        # the whole prism turns on with the plate, so that no cell is wrung alone
        x = case.solve(turned(angle * X[:, 2] / size[2]), held)
    f = case.forces(x)[top]
    return float(np.sum(x[top, 0] * f[:, 1] - x[top, 1] * f[:, 0])), float(f[:, 2].sum())


def frequencies(element: ElementKind, n: int) -> Floats:
    """The six lowest [Hz] on 4n x n x n cells, masses as the product lumps them."""
    case = Statics(lattice((0.1, 0.02, 0.02), (4 * n, n, n), young=1e5, poisson=0.3, density=1000.0), element)
    free = np.flatnonzero(np.repeat(case.x_rest[:, 0] > 1e-9, 3))
    stiffness = case.stiffness(case.x_rest)[free][:, free]
    mass = diags_array(np.repeat(case.parameters.mass, 3)[free])
    values = eigsh(stiffness, k=6, M=mass, sigma=0.0, return_eigenvectors=False)
    return np.asarray(np.sqrt(np.sort(values)) / (2.0 * np.pi))
