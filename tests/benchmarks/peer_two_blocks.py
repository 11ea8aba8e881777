"""A stiff cube pressed into a soft one that it sticks to, with scikit-fem: what `test_stacks.py` holds contact to.

`python peer_two_blocks.py N` in an environment with scikit-fem prints one line of JSON: the force of the plane that
presses [N], and how far the middles of a side bulge at half and at .9 of the soft cube's height, and at half of the
stiff one's [m]. A quarter of the cubes, as one block of N x N x
4 N quadratic hexahedra with 3^3 Gauss points, neo-Hookean, full Newton steps as the plane comes down.
"""

from __future__ import annotations

import json
import sys

import numpy as np
from skfem import Basis, BilinearForm, ElementHex2, ElementVector, LinearForm, MeshHex, condense, solve  # type: ignore

EDGE, PRESSED, STEPS, TOLERANCE = 0.04, 0.004, 4, 1e-9
LOWER, UPPER = (2e4, 0.45), (3e5, 0.3)
"""Young's modulus [Pa] and Poisson's ratio"""


def lame(young: float, poisson: float) -> tuple[float, float]:
    return young / (2.0 * (1.0 + poisson)), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))


@BilinearForm
def stiffness(u, v, w):  # type: ignore[no-untyped-def]
    inverse, log, mu, lam = w["inverse"], w["log"], w["mu"], w["lam"]
    du = u.grad
    turned = np.einsum("ij...,jk...->ik...", inverse, du)
    back = np.einsum("ij...,jk...->ik...", turned, inverse)  # F^-1 dF F^-1
    stress = mu * du + (mu - lam * log) * np.swapaxes(back, 0, 1)
    stress = stress + lam * np.einsum("ii...", turned) * np.swapaxes(inverse, 0, 1)
    return np.einsum("ij...,ij...", stress, v.grad)


@LinearForm
def residual(v, w):  # type: ignore[no-untyped-def]
    inverse = np.swapaxes(w["inverse"], 0, 1)
    stress = w["mu"] * (w["F"] - inverse) + w["lam"] * w["log"] * inverse
    return np.einsum("ij...,ij...", stress, v.grad)


def main(n: int) -> None:
    line = np.linspace(0.0, EDGE / 2.0, n + 1)
    mesh = MeshHex.init_tensor(line, line, np.linspace(0.0, 2.0 * EDGE, 4 * n + 1))
    basis = Basis(mesh, ElementVector(ElementHex2()), intorder=5)
    below = basis.global_coordinates().value[2] < EDGE
    (mu_l, lam_l), (mu_u, lam_u) = lame(*LOWER), lame(*UPPER)
    mu, lam = np.where(below, mu_l, mu_u), np.where(below, lam_l, lam_u)
    at = basis.doflocs
    way = np.empty(basis.N, dtype=np.int64)  # x, y or z of each unknown
    for k, dofs in enumerate(basis.split_indices()):
        way[dofs] = k
    bottom, top = np.flatnonzero(at[2] < 1e-9), np.flatnonzero((at[2] > 2.0 * EDGE - 1e-9) & (way == 2))
    planes = np.flatnonzero(((at[0] < 1e-9) & (way == 0)) | ((at[1] < 1e-9) & (way == 1)))
    held = np.unique(np.concatenate([bottom, top, planes]))
    x = np.zeros(basis.N)
    for step in range(STEPS):
        x[top] = -PRESSED * (step + 1) / STEPS
        for _ in range(30):
            F = basis.interpolate(x).grad + np.eye(3)[:, :, None, None]
            inverse = np.moveaxis(np.linalg.inv(np.moveaxis(F, (0, 1), (-2, -1))), (-2, -1), (0, 1))
            log = np.log(np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1))))
            about = {"F": F, "inverse": inverse, "log": log, "mu": mu, "lam": lam}
            r = residual.assemble(basis, **about)
            change = solve(*condense(stiffness.assemble(basis, **about), -r, D=held))
            x += change
            if np.abs(change).max() < TOLERANCE:
                break
    force = 4.0 * float(r[top].sum())
    bulge = []
    for height in (0.5 * EDGE, 0.9 * EDGE, 1.5 * EDGE):
        away = np.linalg.norm(at - np.array([[EDGE / 2.0], [0.0], [height]]), axis=0) + np.where(way == 0, 0.0, 1.0)
        bulge.append(float(x[np.argmin(away)]))
    print(json.dumps({"n": n, "force": -force, "bulge": bulge}))


if __name__ == "__main__":
    main(int(sys.argv[1]))
