"""The XPBD participant's solver: one region, tentative steps, state hand-over, fields."""

from __future__ import annotations

import time

import numpy as np

from softseam_protocol.messages import Advance, Advanced, BodyState, Fields, Header
from softseam_protocol.scene import Scene
from softseam_services.body.body import Body, Floats, Region
from softseam_services.tools.tool_set import ToolSet

from .compliance import SeamProbe
from .kernels import substep as k
from .kernels.contact import place_points
from .kernels.stress import octant_stress
from .kernels.sweep import block_forces, exact_stress, new_workspace
from .model import KAPPA, build_model
from .state import decode_state, encode_state, new_state

RETRIES = 3
"""how often a failed step is tried again, each time with twice the substeps and one more sweep"""
CRUSHED = 0.3
"""least volume ratio below which a step takes two sweeps: one is not always enough to turn a block right side out"""


class PbdSolver:
    """Block XPBD on one region. Implements `Solver`."""

    def __init__(
        self, scene: Scene, body: Body, region: Region, tools: ToolSet, state: BodyState | None = None
    ) -> None:
        self.model = model = build_model(scene, body, region, tools)
        self.substeps = model.substeps(scene.step)
        n, p, t = model.n_nodes, model.n_points, model.n_tools
        self._committed = new_state(n, model.blocks.n_batches, p, t)
        self._work = new_state(n, model.blocks.n_batches, p, t)
        self._tentative = False
        self._probe: SeamProbe | None = None
        self._ws = new_workspace()
        self._xw = np.zeros((n + 8, 4))
        self._xw[:n, 3] = model.inverse_mass
        self._xw[n:, :3] = model.blocks.padding_x
        self._scratch = (
            self._ws,
            self._xw,
            np.zeros((n, 3)),
            np.zeros((n, 3)),
            np.zeros((n, 3)),
            np.zeros((p, 3)),
            np.zeros(p * t, dtype=np.int32),
            np.zeros(p * t, dtype=np.int32),
            np.zeros((p, t, 3)),
            np.zeros((2, t, 3)),
            np.zeros((2, t, 4)),
            np.zeros(n),
        )
        self._wrench = np.zeros((t, 6))
        self._cell_distance = np.zeros(len(region.cells))
        self._result = np.zeros(k.N_RESULTS)
        blocks = model.blocks
        self._constants = (
            blocks.nodes,
            blocks.volume,
            model.softness,
            blocks.constants,
            blocks.linear,
            region.mass,
            model.x_rest,
            body.gravity,
            region.cell_nodes,
            model.indptr,
            model.node,
            model.weight,
            model.active,
            tools.kind,
            tools.shape,
            tools.friction,
            tools.near,
        )
        self._start(state)

    def _start(self, handed: BodyState | None) -> None:
        """Fill the committed state so that a body at rest in equilibrium stays exactly where it is."""
        model, state, region = self.model, self._committed, self.model.region
        if handed is None:
            state.x[:] = model.x_rest
            state.v[:] = model.body.v_initial[region.nodes]
        else:
            state.x[:] = handed.x[region.nodes]
            state.v[:] = handed.v[region.nodes]
            tool = handed.contact_tool[region.points]
            touching = np.flatnonzero((tool >= 0) & (tool < model.n_tools))
            state.force[touching, tool[touching]] = handed.contact_force[region.points[touching]]
            state.force_mean[:] = state.force
        state.v[region.fixed] = 0.0
        blocks = model.blocks
        n = model.n_nodes
        self._xw[:n, :3] = state.x
        exact_stress(self._ws, self._xw, blocks.nodes, blocks.volume, state.stress, blocks.constants, blocks.linear)
        force = np.zeros((n + 8, 3))
        block_forces(blocks.nodes, state.stress, blocks.constants, force)
        rows = np.repeat(np.arange(model.n_points), np.diff(model.indptr))
        np.add.at(force, model.node, model.weight[:, None] * state.force.sum(axis=1)[rows])
        state.a[:] = model.inverse_mass[:, None] * force[:n]
        state.least_j[0] = 1.0

    def advance(self, request: Advance) -> Advanced:
        start = time.perf_counter()
        committed, work = self._committed, self._work
        motion = request.tools
        n_substeps = self.model.substeps(request.dt)
        n_sweeps = self.model.spec.sweeps
        if committed.least_j[0] < CRUSHED:
            n_sweeps = max(n_sweeps, 2)
        result = self._result
        iterations = 0
        fault = "a tool pose, the seam force or dt is not finite: check the request"
        if np.isfinite(request.dt) and request.dt > 0.0 and _finite(request):
            for attempt in range(RETRIES + 1):
                np.copyto(work.buffer, committed.buffer)
                if attempt:
                    # Forces of a torn shape would throw the nodes apart; without them the blocks pull from zero.
                    work.stress[:] = 0.0
                    work.a[:] = 0.0
                    work.force[:] = 0.0
                k.advance_step(
                    work.x,
                    work.v,
                    work.a,
                    work.stress,
                    work.force,
                    work.slip,
                    *self._constants,
                    motion.position,
                    motion.orientation,
                    motion.position_next,
                    motion.orientation_next,
                    self.model.region.seam,
                    request.seam_force,
                    *self._scratch,
                    work.force_mean,
                    self._wrench,
                    self._cell_distance,
                    result,
                    request.dt,
                    n_substeps,
                    n_sweeps,
                    KAPPA,
                    float(self.model.blocks.edges.min()),
                )
                iterations += n_substeps * n_sweeps
                if np.isfinite(result[: k.N_PAIRS]).all():
                    fault = ""
                    break
                fault = "the blocks diverged: take a shorter step, more substeps or sweeps, or make the region fem"
                n_substeps, n_sweeps = 2 * n_substeps, n_sweeps + 1
        if fault:
            np.copyto(work.buffer, committed.buffer)
            result[:] = 0.0
            self._wrench[:] = 0.0
            self._cell_distance[:] = 0.0
        else:
            work.least_j[0] = result[k.LEAST_J]
        self._tentative = True
        compliance = np.zeros((0, 0))
        if request.compliance:
            compliance = self._compliance(request)
        return Advanced(
            header=request.header,
            status=fault or "converged",
            seam_x=work.x[self.model.region.seam],
            compliance=compliance,
            wrench=self._wrench.copy(),
            kinetic=float(result[k.KINETIC]),
            strain=float(result[k.STRAIN]),
            gravity=float(result[k.GRAVITY]),
            tool_work=float(result[k.TOOL_WORK]),
            seam_work=float(result[k.SEAM_WORK]),
            momentum=result[k.MOMENTUM : k.MOMENTUM + 3].copy(),
            angular_momentum=result[k.ANGULAR : k.ANGULAR + 3].copy(),
            penetration=float(result[k.PENETRATION]),
            slip=float(result[k.SLIP]),
            n_contacts=int(result[k.N_CONTACTS]),
            iterations=iterations,
            seconds=time.perf_counter() - start,
            cell_distance=self._cell_distance.copy(),
            bounds=result[k.BOUNDS : k.BOUNDS + 6].reshape(2, 3).copy(),
        )

    def _compliance(self, request: Advance) -> Floats:
        if self._probe is None or self._probe.dt != request.dt:
            self._probe = SeamProbe(self.model, request.dt)
        return self._probe.compliance(self._committed.x, self._committed.force, request.tools)

    def commit(self) -> None:
        """Accept the tentative step; does nothing if there is none."""
        if self._tentative:
            self._committed, self._work = self._work, self._committed
            self._tentative = False

    def fields(self, request_header: Header) -> Fields:
        """Fields of the last advanced step."""
        state = self._work if self._tentative else self._committed
        model, region = self.model, self.model.region
        n = model.n_nodes
        self._xw[:n, :3] = state.x
        cauchy = np.zeros((len(region.cells), 8, 6))
        blocks = model.blocks
        octant_stress(self._ws, self._xw, blocks.nodes, blocks.octant, blocks.constants, blocks.linear, cauchy)
        point_x = np.zeros((model.n_points, 3))
        place_points(self._xw, model.indptr, model.node, model.weight, point_x)
        size = np.einsum("ptc,ptc->pt", state.force_mean, state.force_mean)
        tool = np.full(model.n_points, -1, dtype=np.int32)
        if model.n_tools and model.n_points:
            touching = size.max(axis=1) > 0.0
            tool[touching] = size[touching].argmax(axis=1)
        return Fields(
            header=request_header,
            nodes=region.nodes,
            x=state.x.copy(),
            v=state.v.copy(),
            cauchy=cauchy,
            points=region.points,
            point_x=point_x,
            contact_force=state.force_mean.sum(axis=1),
            contact_tool=tool,
        )

    def snapshot(self) -> bytes:
        """Commit, then everything that the future depends on; there is no cache that could change later bits."""
        self.commit()
        return encode_state(self._committed)

    def restore(self, state: bytes) -> None:
        """Take over a snapshot of the same region; a tentative step is dropped."""
        decode_state(state, self._committed)
        self._tentative = False


def _finite(request: Advance) -> bool:
    motion = request.tools
    values = (
        motion.position,
        motion.orientation,
        motion.position_next,
        motion.orientation_next,
        request.seam_force,
    )
    return all(np.isfinite(value).all() for value in values)
