"""How far one number that a scene is run for, the goal, is off, and which cells are to blame for it.

The goal J is the force of a grip, or the von Mises stress of the octant of a cell that holds a probe, the mean over it.
With z the adjoint of J (`adjoint`), K_F and K_P what FEM and PBD pull with, and u_P what PBD has found, FEM in all
cells would find, to first order,

    J_F - J_P = -z . (f_F(u_P) - f_P(u_P))                                                                         (1)

summed over the nodes of PBD's cells: exact where the body is linear, whatever the seam. And cells that grew ever
smaller would find, since the error of Galerkin's method is orthogonal to all that its cells can follow,

    J - J_F = c sum_e int_e (sigma* - sigma)_u : C^-1 : (sigma* - sigma)_z dV                                      (2)

with the stresses that u and z lack to smoother ones (`fem.mesh_error`) and c of the element (`trust`); not told of a
probe, for stress at a point is read where it is better than the rest of a cell's, and (2) has the wrong sign there
(docs/decisions/07). Both have a sign:
R. Becker, R. Rannacher, Acta Numerica 10 (2001) 1-102, eqs. (2.14) and (3.20); J. T. Oden, S. Prudhomme, J. Comput.
Phys. 182 (2002) 496-515, of models. Cell by cell (1) is of no use, for models share out the same traction otherwise
over the nodes of a face. So which cells ought to be FEM's is told by a bound of what PBD does there to J,

    theta_e = 2 (eta_e(u) eta_e(z))^(1/2)                                                                          (3)

with the energies of PBD's errors (`pbd.model_error`) of what the body does and of the adjoint, at which PBD must be
good for its answer to be.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Fields
from softseam_protocol.models import facts_of, some_read
from softseam_protocol.scene.kinds import ELEMENTS
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Ints
from softseam_services.body.errors import MeshError, SettingError
from softseam_services.body.recover import von_mises
from softseam_services.body.region import build_region
from softseam_services.orchestrator.error_estimate import MESH, MORE, UNMEASURED, GoalError, NoAdjoint, model_shares
from softseam_services.orchestrator.grip import Placement
from softseam_services.orchestrator.grips import Grips
from softseam_services.orchestrator.parts import Parts, merged_state
from softseam_services.orchestrator.probes import place_of
from softseam_services.solver_row import Adjoint, MeshIndicator, ModelIndicator
from softseam_services.solvers import offered
from softseam_services.tools.tool_set import ToolSet

Floats = NDArray[np.float64]

_STRAIN = 1e-5
"""of the adjoint where its errors are measured, so that every law is Hooke's [1]"""
_SEEN = 1e-9
"""least stress of a probe, over the shear modulus, that has a direction [1]"""
MOST_FACTORED = 100_000
"""unknowns of the adjoint: its factor then takes 1.6 GB, besides that of the solver"""


class Goal:
    """One scene's goal; built once, what it needs of a cut with that cut.

    Raises MeshError for a probe outside, and for a body whose matrix is too large to be factored; SettingError where
    the material has state.
    """

    def __init__(self, scene: Scene, body: Body, tools: ToolSet) -> None:
        name = scene.regions.goal
        assert name is not None
        if body.material.n_state:
            raise SettingError(
                f"regions.goal: the adjoint of a goal does not know the state of {body.material.kind}: leave it out"
            )
        if 3 * body.n_nodes > MOST_FACTORED:
            raise MeshError(
                f"regions.goal: {3 * body.n_nodes:,} unknowns, more than the {MOST_FACTORED:,} that the adjoint of a "
                "goal is solved for: give a longer body.cell, or leave regions.goal out"
            )
        self._scene, self._body, self._tools = scene, body, tools
        self._grip = Grips(scene, tools, [body]).first
        at = scene.probes.get(name)
        self._octant = None if at is None else place_of(body, name, np.asarray(at))[:2]
        self._adjoint: Adjoint | None = None
        self._blocks: ModelIndicator
        self._fine: Ints = np.zeros(0, dtype=np.int32)  # cells that self._mesh is of
        self._mesh: MeshIndicator

    def look(
        self, parts: Parts, fields: Mapping[str, Fields], position: Floats, orientation: Floats, blame: bool = False
    ) -> GoalError | None:
        """The errors between tools at (t, 3) [m], (t, 4); blame: with eq. (3). None where J is nothing yet.

        Raises NoAdjoint.
        """
        body = self._body
        if self._adjoint is None:
            whole = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
            self._adjoint = offered(lambda row: row.adjoint)(body, whole, self._tools, self._scene.models)
            self._blocks = offered(lambda row: row.model_indicator)(body, whole, self._scene.models)
        adjoint = self._adjoint
        state = merged_state(body, parts, fields)
        cauchy = np.empty((body.n_cells, 8, 6))
        for name, side in fields.items():
            cauchy[parts.cells[name]] = side.cauchy
        value, pushed = 0.0, np.zeros((len(self._tools.names), 3))
        if self._octant is not None:
            value = float(von_mises(cauchy[self._octant]))
        elif self._grip is not None:
            pushed[list(self._grip.tools)] = -self._grip.inward_now(orientation) / len(self._grip.tools)
            touching = state.contact_tool >= 0
            value = -float((pushed[state.contact_tool[touching]] * state.contact_force[touching]).sum())
        least = _SEEN * body.material.mu * (1.0 if self._octant is not None else body.resolution**2)
        if not value > least:
            return None
        if not adjoint.factor(state, position, orientation):
            raise NoAdjoint
        forces = adjoint.forces().copy()
        g = adjoint.push(pushed) if self._octant is None else self._stressed(state.x, cauchy[self._octant])
        z = adjoint.solve(g)
        x, turned = np.ascontiguousarray(state.x), self._turned(state.x)
        span = float(np.ptp(z[body.cell_nodes], axis=1).max()) / body.resolution
        if not (span > 0.0 and np.isfinite(span)):
            raise NoAdjoint
        scale = _STRAIN / span
        y = turned + scale * z
        fine = [cells for name, cells in parts.cells.items() if facts_of(parts.models[name]).errs_by == "mesh"]
        mesh = self._mesh_error(fine[0], x, y, cauchy) / scale if fine and self._octant is None else 0.0
        model = self._model_error(parts, x, z, forces) + self._read_otherwise(parts, x, value)
        theta = np.zeros(0)
        if blame:
            energies = (self._blocks.measure(at, state.contact_force, bounded=True) for at in (x, y))
            theta = 2.0 * np.sqrt(np.multiply(*energies)) / (scale * value)
        return GoalError(value, mesh, model, theta)

    def _stressed(self, x: Floats, cauchy: Floats) -> Floats:
        """g (N, 3) [Pa/m] of the von Mises stress of the probe's octant, which has the stress cauchy (6,) [Pa].

        dJ = 3/(2 J) s : dsigma, dsigma = 2 mu e(du) but for the pressure.
        """
        assert self._octant is not None
        (cell, octant), body = self._octant, self._body
        value, pressure = float(von_mises(cauchy)), cauchy[:3].mean()
        xx, yy, zz, yz, xz, xy = cauchy
        s = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - pressure * np.eye(3)
        at_point = ELEMENTS[self._scene.models.fem.element].stress_at_points
        slope = body.from_axes(_slopes(octant, at_point) * (2.0 / body.edges))  # by places at rest
        nodes = body.cell_nodes[cell]
        deformation = x[nodes].T @ slope
        mu = body.materials[body.octant_material[cell, octant]].mu
        g = np.zeros_like(x)
        g[nodes] = slope @ np.linalg.inv(deformation) @ (3.0 * mu / value * s)
        return g

    def _turned(self, x: Floats) -> Floats:
        """The body at rest in shape, turned as it is at x (N, 3) [m]."""
        if self._body.material.small:
            return self._body.x_rest
        rest = self._body.x_rest - self._body.x_rest.mean(axis=0)
        return np.asarray(rest @ Placement.fitted(self._body.x_rest, x).turn.T)

    def _mesh_error(self, cells: Ints, x: Floats, y: Floats, cauchy: Floats) -> float:
        """Eq. (2) of FEM's cells, whose recovered stress stops at the seam; x and y (N, 3) as in `look`."""
        assert self._adjoint is not None
        models = self._scene.models
        if not np.array_equal(cells, self._fine):
            region = build_region(self._body, cells, np.zeros(0, dtype=np.int32))
            self._fine, self._nodes = cells, region.nodes
            self._mesh = offered(lambda row: row.mesh_indicator)(self._body, region, models)
        other = np.ascontiguousarray(self._adjoint.stress(y)[cells])
        product = self._mesh.product(x[self._nodes], cauchy[cells], y[self._nodes], other)
        return MESH.get(models.fem.element, UNMEASURED) * float(product.sum())

    def _read_otherwise(self, parts: Parts, x: Floats, value: float) -> float:
        """What FEM reads of PBD's positions at a probe but PBD does not: J_F(u_P) - J_P(u_P)."""
        if self._octant is None or any(
            some_read([parts.models[name]], "fem.element") and self._octant[0] in cells
            for name, cells in parts.cells.items()
        ):
            return 0.0
        assert self._adjoint is not None
        return float(von_mises(self._adjoint.stress(x)[self._octant])) - value

    def _model_error(self, parts: Parts, x: Floats, z: Floats, forces: Floats) -> float:
        """Eq. (1), with FEM's forces of all cells (C, 27, 3)."""
        coarse = [cells for name, cells in parts.cells.items() if facts_of(parts.models[name]).errs_by == "model"]
        if not coarse:
            return 0.0
        cells, blocks = coarse[0], self._blocks
        nodes = np.arange(len(x), dtype=np.int32)
        if len(cells) < self._body.n_cells:
            region = build_region(self._body, cells, np.zeros(0, dtype=np.int32))
            nodes = region.nodes
            blocks = offered(lambda row: row.model_indicator)(self._body, region, self._scene.models)
        pull = blocks.pull(x[nodes])
        whole = float(np.einsum("cai,cai->", z[self._body.cell_nodes[cells]], forces[cells]))
        return -whole - float((z[nodes] * pull).sum())


def _slopes(octant: int, at_point: bool) -> Floats:
    """Slopes of hex27 by local coordinates at an octant's Gauss point, or their means over the octant (27, 3)."""
    lines = []
    for axis in range(3):
        t = 1.0 if octant >> axis & 1 else -1.0
        if at_point:
            t /= np.sqrt(3.0)
            value, slope = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)], [t - 0.5, -2.0 * t, t + 0.5]
        else:
            value = [1.0 / 6.0 - 0.25 * t, 2.0 / 3.0, 1.0 / 6.0 + 0.25 * t]
            slope = [0.5 * (t - 1.0), -t, 0.5 * (t + 1.0)]
        lines.append((value, slope))
    by_axis = [[line[axis == i] for i, line in enumerate(lines)] for axis in range(3)]
    return np.stack([np.einsum("i,j,k->kji", *line).reshape(27) for line in by_axis], axis=1)


EVERY = 100
"""steps between looks"""


class GoalWatch:
    """When the cells that the goal blames are looked for, and what was found last, in one run.

    A look costs two to four steps (docs/decisions/07), so it is due when the body has four times the strain energy that
    it had at the last one, and every hundred steps; in between, the last look counts. Where there is no goal yet,
    because nothing is gripped or strained, it is asked for every few steps, which costs next to nothing. Where there is
    one but no adjoint, the look has cost what it costs: the one before it counts until the next is due.
    """

    def __init__(self, body: Body) -> None:
        self._share = model_shares(body)
        self.reset()

    def reset(self) -> None:
        """Nothing was looked at."""
        self._step, self._strain = -EVERY, 0.0
        self._cells = np.zeros(len(self._share))

    def follow(self, step: int, strain: float, look: Callable[[], GoalError | None]) -> Floats:
        """What PBD in each cell does to the goal, at most, relative to it (C,) [1], after a look where one is due.

        step, strain  the last step's number, and the body's strain energy after it [J]
        """
        if strain > MORE * self._strain or step >= self._step + EVERY:
            try:
                found = look()
            except NoAdjoint:
                self._step, self._strain = step, strain
                return self._cells
            self._step, self._strain = (step, strain) if found is not None else (-EVERY, 0.0)
            self._cells = np.zeros(len(self._share)) if found is None else self._share * found.cells
        return self._cells

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """What evolves, for a snapshot."""
        return {"goal_cells": self._cells.copy(), "goal_look": np.array([self._step, self._strain])}

    def take(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from `to_arrays`. Raises KeyError or ValueError, and has changed nothing, where these are others."""
        cells, look = arrays["goal_cells"].astype(np.float64), arrays["goal_look"].astype(np.float64)
        if cells.shape != self._cells.shape or look.shape != (2,):
            raise ValueError(f"it is not of {len(self._cells)} cells")
        self._cells, self._step, self._strain = cells, int(look[0]), float(look[1])
