"""Conjugate gradients beside the factor that FEM uses, by size: a table of docs/results/verification.md.

By hand: PYTHONPATH=tests python tests/benchmarks/conjugate.py [most unknowns]

The matrix is that of a step of 5 ms, M/h^2 + K, of full cells that are squeezed by 5 % and waved; the right side is
random; the error is that of the residual. One thread, CPU times in ms, without compiling. Preconditioners: the
diagonal; incomplete Cholesky without fill (Meijerink and van der Vorst 1977; its diagonal is raised until it exists);
the factor of the body at rest, which is what Newton's method keeps (docs/decisions/11-newton-and-its-factor.md).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from conjugate_gradients import MOST, compressed, conjugate_gradients, incomplete_cholesky, substitute
from fem_run import tofu
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, tril

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import load_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.region import build_region
from softseam_services.fem.kernels.elements import add_cell_tangents
from softseam_services.fem.kernels.fronts import add_diagonal, factor, solve
from softseam_services.fem.model import FemModel
from softseam_services.fem.parameters import FemParameters
from softseam_services.fem.structures import build_tables
from softseam_services.fem.tree import Tree
from softseam_services.fem.work import Work, build_work
from softseam_services.server import build_setup

Floats = NDArray[np.float64]
SCENES = Path(__file__).parents[2] / "scenes"
STEP, SQUEEZE = 0.005, 0.05
TOLERANCES = (1e-3, 1e-8)
"""of Newton's early and last iterations"""


class Problem:
    """A body's matrix, as fronts and as rows."""

    def __init__(self, scene: Scene, files: dict[str, bytes]) -> None:
        body = build_setup(Bundle(scene.model_dump_json(), files)).body
        assert isinstance(body, Body)
        region = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
        self.model, self.parameters = build_tables(body, region, spec=scene.models.fem)
        self.tree: Tree = self.model.tree
        self.work = build_work(self.model, self.parameters, 0)
        rest = self.parameters.x_rest
        across = np.ptp(rest, axis=0)
        self.x = rest * [1.0 + 0.5 * SQUEEZE, 1.0 + 0.5 * SQUEEZE, 1.0 - SQUEEZE]
        self.x[:, 0] += 0.02 * across[2] * np.sin(2.0 * np.pi * rest[:, 2] / across[2])

    def assemble(self, x: Floats) -> None:
        _assemble(x, self.model, self.parameters, self.work)

    def rows(self) -> csr_array:
        """The matrix in the order of elimination."""
        ends, columns, values = [], [], []
        for _, n_own, n_all, _, offset, row, *_ in self.tree.meta:
            dofs = (3 * self.tree.rows[row : row + n_all][:, None] + np.arange(3)).ravel()
            panel = self.work.values[offset : offset + 9 * n_own * n_all].reshape(3 * n_own, 3 * n_all).T
            i, j = np.nonzero(np.tril(panel))
            ends.append(dofs[i])
            columns.append(dofs[j])
            values.append(panel[i, j])
        lower = coo_array((np.concatenate(values), (np.concatenate(ends), np.concatenate(columns)))).tocsr()
        return csr_array(lower + tril(lower, -1).T)


def _assemble(x: Floats, model: FemModel, parameters: FemParameters, work: Work) -> None:
    work.values[:] = 0.0
    add_diagonal(model.tree, work.values, parameters.mass, 1.0 / STEP**2)
    add_cell_tangents(x, model, parameters, model.tree, work, False)


def timed(act: Callable[[], object]) -> float:
    """CPU time [ms], the least of two."""
    found = []
    for _ in range(2):
        began = time.process_time()
        act()
        found.append(time.process_time() - began)
    return 1e3 * min(found)


def measure(name: str, problem: Problem) -> None:
    work, tree = problem.work, problem.tree

    def ready() -> None:
        problem.assemble(problem.x)
        assert factor(tree, work.values, work.factoring) == 0

    def assemble() -> None:
        problem.assemble(problem.x)

    assemble()
    matrix = problem.rows()
    a, diagonal = compressed(matrix), matrix.diagonal()
    n = len(diagonal)
    b = np.random.default_rng(1).standard_normal(n)
    factoring = timed(ready) - timed(assemble)
    ready()

    def direct() -> Floats:
        d = b.copy()
        solve(tree, work.values, d, work.factoring)
        return d

    exact, solving = direct(), timed(direct)
    lower, shift = compressed(csr_array(tril(matrix))), 0.0
    raw = lower.value.copy()
    while not incomplete_cholesky(lower, shift):
        lower.value[:] = raw
        shift = max(1e-3, 2.0 * shift)

    def ic() -> None:
        lower.value[:] = raw
        incomplete_cholesky(lower, shift)

    incomplete = timed(ic)
    problem.assemble(problem.parameters.x_rest)
    assert factor(tree, work.values, work.factoring) == 0

    def by_stale(r: Floats) -> Floats:
        d = r.copy()
        solve(tree, work.values, d, work.factoring)
        return d

    def by_cholesky(r: Floats) -> Floats:
        d = r.copy()
        substitute(lower, d)
        return d

    megabytes = 1e-6 * work.values.nbytes, 1e-6 * 12 * len(a.value)
    print(f"| {name} | {n:,} | {megabytes[0]:.1f}, {megabytes[1]:.1f} | {factoring:.1f} + {solving:.1f} |", end="")
    ways = (by_stale, 0.0), (lambda r: r / diagonal, 0.0), (by_cholesky, incomplete)
    for precondition, before in ways:
        cells = []
        for tolerance in TOLERANCES:
            x, iterations = conjugate_gradients(a, b, precondition, tolerance)
            assert iterations == MOST or np.abs(x - exact).max() < 1e3 * tolerance * np.abs(exact).max()
            took = timed(lambda by=precondition, to=tolerance: conjugate_gradients(a, b, by, to))  # type: ignore[misc]
            cells.append(f"{iterations}: {before + took:.1f}")
        print(f" {', '.join(cells)} |", end="")
    print(f" shift {shift:g}", flush=True)


def main() -> None:
    most = int(sys.argv[1]) if len(sys.argv) > 1 else 60_000
    print("| | unknowns | MB, factor and rows | factor + solve | stale factor | jacobi | incomplete Cholesky |")
    print("|---|---|---|---|---|---|---|")
    for name in ("tofu_grasp", "sausage", "tofu_slab"):
        loaded = load_scene(SCENES / f"{name}.yaml")
        measure(name, Problem(loaded.scene, dict(loaded.bundle.files)))
    for count in (5, 8, 10, 13):
        if 3 * (2 * count + 1) ** 3 <= most:
            measure(f"block of {count}^3 cells", Problem(tofu(cell=(0.05 / count,) * 3), {}))


if __name__ == "__main__":
    main()
