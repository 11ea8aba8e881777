"""Would another preconditioner pay? `python tests/benchmarks/preconditioners.py [most unknowns]`.

A cube of tofu squeezed by 5 % between plates that stick to it, full hex27 cells, one thread; its matrix in a step of 5
and one of 100 ms, and a random right-hand side, to 1e-2, as a Newton correction is solved for. Against a fresh factor,
and conjugate gradients with two grids: conjugate gradients with incomplete Cholesky of no fill, in blocks, and with
the factor of the matrix at rest. CPU ms, the least of a few repeats.

Incomplete: A ~ (D + L) D^-1 (D + L)^T with the pattern of A; D_j and L_ej follow from A by subtracting
L_ej D_j^-1 L_fj^T of each column j from the blocks (e, f) that the pattern has. Where a D_j is not positive definite,
all of it is done again with the diagonal of A raised by 1 %, 2 %, 4 % ...
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fem_run import FemRun, tofu
from timing import least

from softseam_services.fem import model as fem_model
from softseam_services.fem.kernels.candidates import find_candidates
from softseam_services.fem.kernels.contact import add_contact_tangents
from softseam_services.fem.kernels.elements import add_cell_tangents
from softseam_services.fem.kernels.fronts import ALL, ROW, VALUES, add_diagonal, solve
from softseam_services.fem.kernels.multigrid import MULTIGRID, conjugate_gradients, prepare
from softseam_services.fem.kernels.newton import residual
from softseam_services.fem.kernels.pair import factor
from softseam_services.fem.kernels.sparse import backward, dot, forward, product
from softseam_services.fem.tool_motion import moved

Floats = NDArray[np.float64]
TOLERANCE = 1e-2
MOST_FACTORED = 60_000
SQUEEZE, AHEAD = np.array([0.95, 1.02, 1.02]), 1e-4
"""stretches, and the gap at which a point is taken to touch [m]"""


@njit(cache=True, error_model="numpy")
def incomplete(tree, values, inverse):  # type: ignore[no-untyped-def]
    """values <- D + L, inverse (n, 3, 3) <- D^-1; False where a D is not positive definite."""
    t = np.empty((3, 3))
    for j in range(len(tree.meta)):
        n, at, row = tree.meta[j, ALL], tree.meta[j, VALUES], tree.meta[j, ROW]
        m = 3 * n
        block = np.empty((3, 3))
        for i in range(3):
            for k in range(3):
                block[i, k] = values[at + min(i, k) * m + max(i, k)]
        minor = block[0, 0] * block[1, 1] - block[0, 1] ** 2
        if not (block[0, 0] > 0.0 and minor > 0.0 and np.linalg.det(block) > 0.0):
            return False
        d = np.linalg.inv(block)
        inverse[j] = d
        for f in range(1, n):
            column = tree.rows[row + f]
            # t = D^-1 L_fj^T
            for i in range(3):
                for k in range(3):
                    t[i, k] = 0.0
                    for c in range(3):
                        t[i, k] += d[i, c] * values[at + c * m + 3 * f + k]
            n_to, to_at, to_row = tree.meta[column, ALL], tree.meta[column, VALUES], tree.meta[column, ROW]
            place = 0
            for e in range(f, n):
                wanted = tree.rows[row + e]
                while place < n_to and tree.rows[to_row + place] < wanted:
                    place += 1
                if place == n_to:
                    break
                if tree.rows[to_row + place] != wanted:
                    continue
                for i in range(3):
                    for k in range(3):
                        total = 0.0
                        for c in range(3):
                            total += values[at + c * m + 3 * e + i] * t[c, k]
                        values[to_at + k * 3 * n_to + 3 * place + i] -= total
    return True


@njit(cache=True, error_model="numpy")
def raise_diagonal(tree, values, share):  # type: ignore[no-untyped-def]
    """Multiply the diagonal of A with 1 + share."""
    for j in range(len(tree.meta)):
        m, at = 3 * tree.meta[j, ALL], tree.meta[j, VALUES]
        for i in range(3):
            values[at + i * m + i] *= 1.0 + share


class Case:
    """The matrix at a state, in one of the two forms; b is numbered by nodes."""

    def __init__(self, n: int, step: float, factored: bool) -> None:
        fem_model.MOST_FACTORED = 10**9 if factored else 0
        self.run = FemRun(tofu(cell=0.05 / n, step=step))
        solver = self.run.solver
        self.step = step
        stepper = solver._stepper
        self.model, self.tree, self.work, self.memo = solver._model, stepper._tree, stepper.work, stepper.memo

    def assemble(self, x: Floats, contact: Floats, tools: object) -> None:
        """Matrix at x (n, 3), its contacts included."""
        model, tree, work = self.model, self.tree, self.work
        work.x_hat[:] = x
        count = find_candidates(x, model, tools, contact, 0.25 * model.edge, 1.0, 1.0, work)
        residual(x, x, model, tools, count, 1.0 / self.step**2, 1.0, work, self.memo)
        work.values[:] = 0.0
        add_diagonal(tree, work.values, model.mass, 1.0 / self.step**2)
        add_cell_tangents(x, model, tree, work, False)
        add_contact_tangents(model, tools, tree, count, AHEAD, work)


def iterate(case: Case, b: Floats, precondition) -> tuple[Floats, int]:  # type: ignore[no-untyped-def]
    """Conjugate gradients until the preconditioned residual is TOLERANCE of what it was."""
    x, r, q = np.zeros_like(b), b.copy(), np.empty_like(b)
    z = precondition(r)
    p, rho = z.copy(), dot(r, z)
    first = rho
    for iteration in range(1, 1000):
        product(case.tree, case.work.values, p, q)
        alpha = rho / dot(p, q)
        x += alpha * p
        r -= alpha * q
        z = precondition(r)
        new = dot(r, z)
        if new < TOLERANCE**2 * first:
            return x, iteration
        p = z + (new / rho) * p
        rho = new
    return x, 1000


def compare(n: int, step: float) -> str:
    """One row of the table."""
    sparse = Case(n, step, False)
    run, size = sparse.run, len(sparse.work.d)
    rest, contact = run.x.copy(), run.solver.state.contact
    x = rest * SQUEEZE
    start = run.request().tools
    run.position[1:, 0] = np.array([-1.0, 1.0]) * (np.abs(x[:, 0]).max() + 0.005)
    end = run.request().tools
    sparse.assemble(x, contact, moved(run.solver._tools, end))
    matrix = sparse.work.values.copy()
    b = np.random.default_rng(1).standard_normal(size)
    fresh = old = "-"
    if size <= MOST_FACTORED:
        direct = Case(n, step, True)
        whole = direct.run.solver._tools
        direct.assemble(rest, contact, moved(whole, start))
        assert factor(direct.tree, direct.work.values, direct.work.factoring) == 0
        stale = direct.work.values.copy()
        direct.assemble(x, contact, moved(whole, end))
        assembled = direct.work.values.copy()
        axes = np.tile([0, 1, 2], len(rest))
        order = np.argsort(np.repeat(3 * sparse.model.order, 3) + axes)
        number = (np.repeat(3 * direct.model.order, 3) + axes)[order]  # of each sparse unknown in the factor's order

        def ready_direct() -> None:
            direct.work.values[:] = assembled
            factor(direct.tree, direct.work.values, direct.work.factoring)

        def by_factor(r: Floats) -> Floats:
            direct.work.d[number] = r
            solve(direct.tree, direct.work.values, direct.work.d, direct.work.factoring)
            return np.asarray(direct.work.d[number])

        made = least(ready_direct)
        fresh = f"{1e3 * made:.2f} + {1e3 * least(lambda: by_factor(b)):.2f}"
        direct.work.values[:] = stale
        its = iterate(sparse, b, by_factor)[1]
        old = f"{1e3 * least(lambda: iterate(sparse, b, by_factor)):.2f} ({its})"

    lower, inverse = matrix.copy(), np.empty((size // 3, 3, 3))
    raised = 0.0

    def ready_incomplete() -> bool:
        lower[:] = matrix
        if raised > 0.0:
            raise_diagonal(sparse.tree, lower, raised)
        return bool(incomplete(sparse.tree, lower, inverse))

    while not ready_incomplete():
        raised = max(0.01, 2.0 * raised)
    made = least(ready_incomplete)
    w, y, diagonal = np.empty(size), np.empty(size), np.linalg.inv(inverse)

    def by_incomplete(r: Floats) -> Floats:
        w[:] = r
        forward(sparse.tree, lower, inverse, w, y)
        scaled = np.einsum("nij,nj->ni", diagonal, y.reshape(-1, 3)).ravel()
        z = np.empty(size)
        backward(sparse.tree, lower, inverse, scaled, z)
        return z

    its = iterate(sparse, b, by_incomplete)[1]
    swept = least(lambda: iterate(sparse, b, by_incomplete))
    cholesky = f"{1e3 * made:.2f} + {1e3 * swept:.2f} ({its}), {100 * raised:g} %"

    seam, none = sparse.work.seam_stiffness, np.zeros(0, dtype=np.int32)
    tree = sparse.tree._replace(kind=MULTIGRID)

    def ready_grids() -> bool:
        return bool(prepare(tree, sparse.work.values, False, seam, none, sparse.work.grid))

    assert ready_grids()
    made, done, work = least(ready_grids), [0], sparse.work

    def by_grids() -> None:
        work.d[:] = b
        done[0] = conjugate_gradients(tree, work.values, work.grid, False, seam, none, TOLERANCE, work.d, work.ints)

    grids = f"{1e3 * made:.2f} + {1e3 * least(by_grids):.2f} ({done[0]})"
    return f"| {size} | {1e3 * step:g} | {fresh} | {grids} | {cholesky} | {old} |"


def main(most: int) -> None:
    print("ready + solve (iterations), ms; incomplete: by how much the diagonal was raised\n")
    print("| unknowns | step ms | factor | two grids | incomplete Cholesky | factor of the matrix at rest |")
    print("|---|---|---|---|---|---|")
    for n, step in ((3, 0.005), (5, 0.005), (7, 0.005), (12, 0.005), (20, 0.005), (5, 0.1), (12, 0.1)):
        if 3 * (2 * n + 1) ** 3 <= most:
            print(compare(n, step), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10**6)
