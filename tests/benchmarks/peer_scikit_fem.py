"""Scene A at rest with scikit-fem and SciPy's direct solver; run by structures.py in an environment of its own.

`python peer_scikit_fem.py NX NY NZ` prints one line of JSON. Quadratic hexahedra with 3^3 Gauss points, neo-Hookean,
full Newton steps under a load raised in equal parts.
"""

from __future__ import annotations

import json
import resource
import sys
import time

import numpy as np
from skfem import Basis, BilinearForm, ElementHex2, ElementVector, LinearForm, MeshHex, condense, solve  # type: ignore

YOUNG, POISSON, DENSITY, GRAVITY = 100e3, 0.4, 1000.0, 9.81
SIZE = (0.2, 0.05, 0.05)
LOADS, TOLERANCE = 4, 1e-8
MU = YOUNG / (2.0 * (1.0 + POISSON))
LAMBDA = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))


@BilinearForm
def stiffness(u, v, w):  # type: ignore[no-untyped-def]
    inverse, log = w["inverse"], w["log"]
    du, dv = u.grad, v.grad
    turned = np.einsum("ij...,jk...->ik...", inverse, du)
    back = np.einsum("ij...,jk...->ik...", turned, inverse)  # F^-1 dF F^-1
    stress = MU * du + (MU - LAMBDA * log) * np.swapaxes(back, 0, 1)
    stress = stress + LAMBDA * np.einsum("ii...", turned) * np.swapaxes(inverse, 0, 1)
    return np.einsum("ij...,ij...", stress, dv)


@LinearForm
def residual(v, w):  # type: ignore[no-untyped-def]
    inverse = np.swapaxes(w["inverse"], 0, 1)
    stress = MU * (w["F"] - inverse) + LAMBDA * w["log"] * inverse
    return np.einsum("ij...,ij...", stress, v.grad) + w["load"] * DENSITY * GRAVITY * v[2]


def main(counts: tuple[int, int, int]) -> None:
    mesh = MeshHex.init_tensor(*(np.linspace(0.0, s, n + 1) for s, n in zip(SIZE, counts, strict=True)))
    began = time.process_time()
    basis = Basis(mesh, ElementVector(ElementHex2()), intorder=5)
    x = np.zeros(basis.N)
    clamped = basis.get_dofs(lambda x: np.isclose(x[0], 0.0)).all()
    assembled = solved = 0.0
    iterations = 0
    for step in range(LOADS):
        while True:
            gradient = basis.interpolate(x).grad
            F = gradient + np.eye(3)[:, :, None, None]
            inverse = np.moveaxis(np.linalg.inv(np.moveaxis(F, (0, 1), (-2, -1))), (-2, -1), (0, 1))
            log = np.log(np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1))))
            start = time.process_time()
            load = (step + 1) / LOADS * np.ones_like(log)
            K = stiffness.assemble(basis, inverse=inverse, log=log)
            r = residual.assemble(basis, F=F, inverse=inverse, log=log, load=load)
            middle = time.process_time()
            change = solve(*condense(K, -r, D=clamped))
            assembled, solved = assembled + middle - start, solved + time.process_time() - middle
            x += change
            iterations += 1
            if np.abs(change).max() < TOLERANCE * SIZE[2] or iterations > 100:
                break
    spent = time.process_time() - began
    away = np.linalg.norm(basis.doflocs - np.array([[SIZE[0]], [SIZE[1] / 2], [SIZE[2] / 2]]), axis=0)
    tip = np.sort(np.argsort(away, kind="stable")[:3])[2]  # x, y, z of the node there
    print(
        json.dumps(
            {
                "unknowns": int(basis.N - len(clamped)),
                "tip": float(x[tip]),
                "seconds": spent,
                "iterations": iterations,
                "assemble": assembled / iterations,
                "solve": solved / iterations,
                "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            }
        )
    )


if __name__ == "__main__":
    main((int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])))
