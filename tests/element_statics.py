"""Static problems on a body's cells, any element: sparse Newton's method in Python around the product's kernels."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from fem_run import block
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.region import build_region
from softseam_services.fem.integrators.scheme import IMPLICIT_EULER, Scheme
from softseam_services.fem.kernels.elements import add_cell_tangents, strain_energy, subtract_forces
from softseam_services.fem.kernels.point_volumes import loses_volume
from softseam_services.fem.kernels.quadrature_blending import share_cells
from softseam_services.fem.kernels.viscosity import add_viscous_tangents, subtract_viscous
from softseam_services.fem.kernels.viscous_start import resist
from softseam_services.fem.structures import build_tables
from softseam_services.fem.work import build_work

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Vector = tuple[float, float, float]


def lattice(
    size: Vector,
    counts: tuple[int, int, int],
    shift: Callable[[Floats], Floats] | None = None,
    inclusions: Sequence[Mapping[str, Any]] = (),
    **keys: Any,
) -> Body:
    """A block with its least corner at the origin, its nodes moved by `shift` (n, 3) -> (n, 3)."""
    edges = (size[0] / counts[0], size[1] / counts[1], size[2] / counts[2])
    place = {"position": (size[0] / 2, size[1] / 2, 0.0), "inclusions": inclusions}
    body = build_body(block(size, edges, body=place, regions={"default": "fem"}, **keys), {})
    if shift is None:
        return body
    x = body.x_rest + shift(body.x_rest)
    return dataclasses.replace(body, x_rest=np.ascontiguousarray(x))


class Statics:
    """A body whose forces and stiffness are those of `element`."""

    def __init__(self, body: Body, element: str) -> None:
        cells = np.arange(body.n_cells, dtype=np.int32)
        region = build_region(body, cells, np.zeros(0, dtype=np.int32))
        self.body = body
        spec = FemSpec.model_validate({"element": element})
        self.model, self.parameters = build_tables(body, region, spec=spec)
        self.tree = self.model.tree
        self.work = build_work(self.model, self.parameters, 0)
        if loses_volume(self.model):
            self.work.watched[:], self.work.watches[0] = self.model.whole, int(self.model.whole.sum())
        rows, columns, places = [], [], []
        for _, n_own, n_all, _, offset, row, *_ in self.tree.meta:
            dofs = (3 * self.tree.rows[row : row + n_all][:, None] + np.arange(3)).ravel()
            lower = np.tril_indices(3 * n_all, m=3 * n_own)
            rows.append(dofs[lower[0]])
            columns.append(dofs[lower[1]])
            places.append(offset + lower[1] * 3 * n_all + lower[0])
        self._row, self._column, self._place = (np.concatenate(part) for part in (rows, columns, places))
        order = self.tree.position
        self._dof = (3 * order[:, None] + np.arange(3)).ravel()

    @property
    def x_rest(self) -> Floats:
        return self.parameters.x_rest

    def share(self, x: Floats) -> None:
        """Have cells pass to full quadrature by all that x (n, 3) asks for."""
        none = np.full(len(self.model.cell_nodes), -1.0)
        share_cells(x, none, 1.0, self.model, self.parameters, self.work, none.copy())

    def forces(self, x: Floats) -> Floats:
        """f(x) = dU/dx (n, 3)."""
        r = np.zeros_like(self.work.r)
        subtract_forces(np.ascontiguousarray(x), self.model, self.parameters, self.work, r)  # compiled for that alone
        return -r.reshape(-1, 3)[self.model.order]

    def energy(self, x: Floats) -> float:
        return float(strain_energy(x, self.model, self.parameters, self.work))

    def stiffness(self, x: Floats, definite: bool = False) -> csc_array:
        """K(x) with 3 node + axis as rows and columns."""
        self.work.values[:] = 0.0
        add_cell_tangents(x, self.model, self.parameters, self.tree, self.work, definite)
        return self._matrix()

    def start(self, x0: Floats, dt: float) -> float:
        """A step of implicit Euler begins at x0: returns what viscosity multiplies forces with."""
        scheme = Scheme(IMPLICIT_EULER, np.ones(1), 0, self.body.material.retardation_time)
        resist(scheme, dt, 1.0, x0, self.model, self.parameters, self.work)
        return float(self.work.viscous[0])

    def viscous_forces(self, x0: Floats, x: Floats) -> Floats:
        """Of viscosity at x, in the step that `start` began at x0 (n, 3)."""
        r = np.zeros_like(self.work.r)
        subtract_viscous(x, x0, self.model, self.parameters, self.work, r)
        return -r.reshape(-1, 3)[self.model.order]

    def viscous_stiffness(self, x0: Floats, x: Floats, definite: bool = False) -> csc_array:
        """Their derivative by x."""
        self.work.values[:] = 0.0
        add_viscous_tangents(x, x0, self.model, self.parameters, self.tree, self.work, definite)
        return self._matrix()

    def _matrix(self) -> csc_array:
        values = self.work.values[self._place]
        kept = values != 0.0
        lower = coo_array((values[kept], (self._row[kept], self._column[kept])), shape=(len(self._dof),) * 2).tocsc()
        strict = coo_array(lower)
        off = strict.row != strict.col
        upper = coo_array((strict.data[off], (strict.col[off], strict.row[off])), shape=lower.shape).tocsc()
        whole = csc_array(lower + upper)
        return csc_array(whole[self._dof][:, self._dof])

    def solve(self, x: Floats, held: Mask, load: Floats | float = 0.0, tolerance: float = 1e-10) -> Floats:
        """Equilibrium from x, whose `held` (n, 3) coordinates stay; load (n, 3) [N] dead.

        Newton's method, with the definite tangent while steps are long; one that raises U - load . x is halved.
        """
        x = x.copy()
        free = np.flatnonzero(~held.ravel())
        size = float(np.ptp(self.x_rest, axis=0).max())
        energy = self.energy(x) - float(np.sum(load * x))
        longest = np.inf
        for _ in range(40):
            residual = (load - self.forces(x)).ravel()[free]
            matrix = csc_array(self.stiffness(x, definite=longest > 1e-6 * size)[free][:, free])
            step = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(residual)
            longest = float(np.abs(step).max())
            trial, scale = x.copy(), 1.0
            while True:
                trial.reshape(-1)[free] = x.reshape(-1)[free] + scale * step
                if longest < tolerance * size:
                    return trial
                potential = self.energy(trial) - float(np.sum(load * trial))
                if potential <= energy + 1e-9 * abs(energy) or scale < 1e-3:
                    break
                scale *= 0.5
            x, energy = trial, potential
        raise AssertionError(f"no equilibrium: the last step was {longest:.3g} m")
