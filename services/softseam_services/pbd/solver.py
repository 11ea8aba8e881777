"""The PBD participant's solver: one region, tentative steps, state hand-over, fields."""

from __future__ import annotations

import time

import numpy as np

from softseam_protocol.messages import Advance, Advanced, BodyState, Fields, Header
from softseam_protocol.scene import Scene
from softseam_services.body.body import Body, Floats, Region
from softseam_services.request_check import problem_of
from softseam_services.tools.tool_set import ToolSet

from . import watch
from .compliance import SeamProbe, Ways, no_ways
from .kernels import summary as k
from .kernels.block import new_workspace
from .kernels.energy import cell_energies
from .kernels.leapfrog import advance_leapfrog
from .kernels.pairs import place_points
from .kernels.settle import settle
from .kernels.split import split_forces
from .kernels.stress import octant_stress
from .kernels.substep import advance_step
from .kernels.sweep import batch_energies, block_forces, exact_stress, strain_energy
from .levels import fill_in, hand_on, thin_out
from .model import KAPPA, build_model
from .model_error import ModelError
from .pair import Pair
from .records import (
    Solve,
    block_arrays,
    leap_arrays,
    new_contacts,
    new_scratch,
    node_arrays,
    point_arrays,
    solve_arrays,
    tool_arrays,
)
from .state import decode_state, encode_state, new_state

MARGIN = 0.1
"""points within this many block edges of a tool, and what speeds add to it, are tried for contact"""
TOUCH = 1e-3
"""gap below which a handed-over point touches a tool, in block edges"""
COLLAPSE_STEP = 1e-4
"""size, relative to rest, that a body without shape is given again"""
_NO_FORCES = np.zeros((0, 3))


class PbdSolver:
    """Block XPBD, or leapfrog on the same blocks, on one region. Implements `Solver`."""

    def __init__(
        self, scene: Scene, body: Body, region: Region, tools: ToolSet, state: BodyState | None = None
    ) -> None:
        self.model = model = build_model(scene, body, region, tools)
        self.substeps = model.substeps(scene.step)
        self._dt, self._planned, self._n_substeps = scene.step, self.substeps, self.substeps
        n, p, t = model.n_nodes, model.n_points, model.n_tools
        self._committed = new_state(n, model.blocks.n_batches, p, t)
        self._work = new_state(n, model.blocks.n_batches, p, t)
        self._tentative = False
        self._probe: SeamProbe | None = None
        self._probed = np.zeros(0)  # the state that was probed, see `_compliance`; empty: none
        self._ways = no_ways()  # what came of it, see `SeamProbe.compliance`; empty: not found yet
        self._to_plan = False  # whether the tentative step was taken in one attempt
        self._measure: ModelError | None = None
        self._ws = new_workspace()
        self._pair = Pair(self._ws, model.blocks.colours, n)
        self._scratch = new_scratch(model)
        self._xw, self._figures = self._scratch.xw, self._scratch.figures
        self._contacts = new_contacts(n, model.blocks.n_batches, p, t)
        self._nodes = node_arrays(model)
        self._blocks = block_arrays(model.blocks, model.blocks.nodes, model.softness)
        self._points = point_arrays(model)
        self._tools = tool_arrays(tools)
        self._solve = self._new_solve()
        self._wrench = np.zeros((t, 6))
        self._margin = MARGIN * float(model.blocks.edges.min())
        self._cell_distance = np.zeros(len(region.cells))
        self._result = np.zeros(k.N_RESULTS)
        if model.explicit:
            self._leap = leap_arrays(model, self._figures)
        self._start(state)
        if model.explicit:
            self._load_kernel()

    def _load_kernel(self) -> None:
        """Compile or load the explicit step before anybody waits for one: a substep that leaves no trace."""
        np.copyto(self._work.buffer, self._committed.buffer)
        self._leap_ahead(1e-9, 1)
        self._result[:] = 0.0

    def _new_solve(self) -> Solve:
        """For as many substeps as the last repetition of a step takes at most."""
        model = self.model
        return solve_arrays(
            model, model.blocks, self._planned * 2 ** (watch.RETRIES + watch.SHORTEST), model.spec.residual or 0.0
        )

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
            hand_on(state.force, model.active, (model.indptr, model.node, model.weight))
            assert not state.force[~model.active].any()
            state.force_mean[:] = state.force
        state.v[region.fixed] = 0.0
        if handed is not None:
            thin_out(model.levels, region, model.mass, state.x, state.v)
        model.levels.follow(state.x, state.v)
        blocks = model.blocks
        n = model.n_nodes
        self._xw[:n, :3] = state.x
        exact_stress(self._ws, self._xw, blocks.nodes, blocks.volume, state.stress, blocks.constants, blocks.law)
        force = np.zeros((n + 8, 4))
        block_forces(self._ws, blocks.nodes, state.stress, blocks.constants, force, 0, blocks.n_batches)
        rows = np.repeat(np.arange(model.n_points), np.diff(model.indptr))
        np.add.at(force[:, :3], model.node, model.weight[:, None] * state.force.sum(axis=1)[rows])
        state.a[:] = model.inverse_mass[:, None] * force[:n, :3]
        batch_energies(
            *(self._ws, self._xw, blocks.nodes, blocks.volume, blocks.constants, blocks.law, 0, blocks.n_batches),
            self._figures,
        )
        strain, least_j = strain_energy(self._figures)
        kinetic = 0.5 * float(model.mass @ np.einsum("nc,nc->n", state.v, state.v))
        gravity = -float(model.mass @ ((state.x - model.x_rest) @ model.body.gravity))
        stretch = float((np.ptp(state.x, axis=0).max()) / np.ptp(model.x_rest, axis=0).max())
        state.monitor[:] = least_j, kinetic, strain, gravity, float(handed is not None), 0.0, stretch, 0.0, 0.0
        self._floor = 1e-8 * min(material.mu for material in model.body.materials) * float(blocks.volume.sum())

    @property
    def strain(self) -> float:
        """Strain energy of the last committed step [J]."""
        return float(self._committed.monitor[watch.STRAIN])

    @property
    def moving(self) -> tuple[float, float]:
        """Kinetic energy, and that in gravity, of the last committed step [J]."""
        return float(self._committed.monitor[watch.KINETIC]), float(self._committed.monitor[watch.GRAVITY])

    @property
    def positions(self) -> Floats:
        """Positions of the region's nodes at the end of the last committed step (n, 3) [m]."""
        return self._committed.x

    def advance(self, request: Advance) -> Advanced:
        start = time.perf_counter()
        committed, work = self._committed, self._work
        result = self._result
        iterations, notice, unfinished, self._to_plan = 0, "", 0, False
        refused = problem_of(request, self.model.n_tools, len(self.model.region.seam))
        if not refused and len(request.seam_anchor):
            refused = watch.Fault.ANCHOR.value
        fault = watch.Fault.INPUT
        if not refused:
            if committed.monitor[watch.UNSHARED] != 0.0:
                self._share_out(request)
            cause = ""
            for attempt in range(watch.RETRIES + 1):
                n_substeps, n_sweeps = self._try(request, attempt)
                swept, unfinished = self._swept(n_substeps, n_sweeps)
                iterations += swept
                fault = watch.check(result, committed.monitor, self._floor)
                notice = watch.alarm(cause, result, committed.monitor, attempt, n_substeps, n_sweeps, unfinished)
                lagging = attempt == 0 and watch.grows(result, committed.monitor)
                if fault is watch.Fault.NONE and not lagging:
                    break
                cause = fault.value.split(":")[0] if fault is not watch.Fault.NONE else "the residual grows"
        if fault in (watch.Fault.INPUT, watch.Fault.DIVERGED):
            np.copyto(work.buffer, committed.buffer)
            result[:] = 0.0
            self._wrench[:] = 0.0
            self._cell_distance[:] = 0.0
        else:
            self._to_plan = fault is watch.Fault.NONE and attempt == 0
            if watch.remember(work.monitor, result, self._floor):
                notice = "; ".join(filter(None, (notice, watch.GAINS)))
        self._tentative = True
        compliance = np.zeros((0, 0))
        if request.compliance and not refused:
            compliance = self._compliance(request)
        numbers = result.tolist()
        return Advanced(
            request.header,
            refused or fault.value,
            work.x.take(self.model.region.seam, axis=0),
            compliance,
            self._wrench.copy(),
            numbers[k.KINETIC],
            numbers[k.STRAIN],
            numbers[k.GRAVITY],
            numbers[k.TOOL_WORK],
            numbers[k.SEAM_WORK],
            result[k.MOMENTUM : k.MOMENTUM + 3].copy(),
            result[k.ANGULAR : k.ANGULAR + 3].copy(),
            numbers[k.PENETRATION],
            numbers[k.SLIP],
            int(numbers[k.N_CONTACTS]),
            iterations,
            time.perf_counter() - start,
            self._cell_distance.copy(),
            result[k.BOUNDS : k.BOUNDS + 6].copy().reshape(2, 3),
            n_substeps=self._n_substeps,
            residual=numbers[k.RESIDUAL],
            alarm=notice,
            seam_v=work.v.take(self.model.region.seam, axis=0) if len(request.seam_force_start) else _NO_FORCES,
            settles=self._settles(),
        )

    def _share_out(self, request: Advance) -> None:
        """A handed-over state names one tool a point; now that the poses are known, all that touch it get a share."""
        model, state = self.model, self._committed
        tools, motion = model.tools, request.tools
        self._xw[: model.n_nodes, :3] = state.x
        point_x = np.zeros((model.n_points, 3))
        place_points(self._xw, model.indptr, model.node, model.weight, point_x)
        split_forces(
            tools.kind,
            tools.shape,
            motion.position,
            motion.orientation,
            point_x,
            model.active,
            TOUCH * float(model.blocks.edges.min()),
            state.force,
        )
        state.monitor[watch.UNSHARED] = 0.0

    def _try(self, request: Advance, attempt: int) -> tuple[int, int]:
        """One attempt at the step from the committed state into the tentative one; returns substeps and sweeps.

        Attempt 0 is the plan. Later ones halve the substep each time and sweep once more; from the second on the
        carried forces start from zero, because those of a torn shape throw the nodes apart. Leapfrog sweeps nothing.
        """
        work, motion = self._work, request.tools
        np.copyto(work.buffer, self._committed.buffer)
        if work.monitor[watch.STRETCH] < watch.COLLAPSED:
            work.x[:] += COLLAPSE_STEP * (self.model.x_rest - self.model.x_rest.mean(axis=0))
        if request.dt != self._dt:
            self._dt, self._planned = request.dt, self.model.substeps(request.dt)
            self._solve = self._new_solve()
        n_substeps = self._planned * 2 ** (attempt + int(work.monitor[watch.HALVINGS]))
        self._n_substeps = n_substeps
        if self.model.explicit:
            self._leap_ahead(request.dt, n_substeps)
            return n_substeps, 0
        if attempt >= watch.COLD:
            work.stress[:] = 0.0
            work.a[:] = 0.0
            work.force[:] = 0.0
        n_sweeps = self.model.spec.sweeps + attempt
        if watch.needs_two_sweeps(work.monitor):
            n_sweeps = max(n_sweeps, 2)
        self._solve.used[:] = 0
        self.model.find_shares(work.x, motion.position, motion.orientation)
        force, growth = self.model.seam_force(request.seam_force), _NO_FORCES
        if len(request.seam_force_start):
            start = self.model.seam_force(request.seam_force_start)
            growth = (force - start) / n_substeps
            force = start + growth
        self._pair.run(
            n_substeps * n_sweeps,
            advance_step,
            *(work, self._nodes, self._blocks, self._points, self._tools, self._contacts, self._scratch, self._solve),
            *(motion.position, motion.orientation, motion.position_next, motion.orientation_next, force, growth),
            *(self._wrench, self._cell_distance, self._result),
            *(request.dt, n_substeps, n_sweeps, KAPPA, self._margin),
        )
        return n_substeps, n_sweeps

    def _swept(self, n_substeps: int, n_sweeps: int) -> tuple[int, int]:
        """Sweeps of the last try, and its substeps in which they did not bring the residual down far enough."""
        if self._solve.tolerance == 0.0:
            return n_substeps * max(n_sweeps, 1), 0
        used = self._solve.used[:n_substeps]
        unfinished = int((used == 0).sum())
        return int(used.sum()) + unfinished * n_sweeps, unfinished

    def _leap_ahead(self, dt: float, n_substeps: int) -> None:
        """The explicit step, in the tentative state."""
        model = self.model
        self._pair.run(
            n_substeps,
            advance_leapfrog,
            *(self._work, self._blocks, self._leap, model.mass, model.x_rest, model.body.gravity),
            *(self._cell_distance, self._result, model.spec.damping.mass, dt, n_substeps),
        )

    def _compliance(self, request: Advance) -> Floats:
        """Probe the committed state, and keep what was probed, so that a restored participant can probe it again."""
        committed, tools, ramp = self._committed, request.tools, len(request.seam_force_start) > 0
        parts = (committed.x, committed.force, tools.position, tools.orientation)
        self._probed = np.concatenate([[request.dt], *(part.ravel() for part in parts)])
        compliance, self._ways = self._probe_again(ramp)
        if ramp:
            self._probed, self._ways = np.zeros(0), no_ways()  # steps of such forces are not settled
        return compliance

    def _probe_for(self, dt: float) -> SeamProbe:
        """The probe of steps of dt [s]: the one at hand, or a new one."""
        known = self._probe
        return known if known is not None and known.dt == dt else SeamProbe(self.model, dt)

    def _probe_again(self, ramp: bool = False) -> tuple[Floats, Ways]:
        """Compliance of the seam and ways of the nodes in the state that is in `_probed`."""
        model = self.model
        self._probe = self._probe_for(float(self._probed[0]))
        shapes = ((model.n_nodes, 3), (model.n_points, model.n_tools, 3), (model.n_tools, 3), (model.n_tools, 4))
        ends = np.cumsum([1, *(int(np.prod(shape)) for shape in shapes)])
        x, force, position, orientation = (
            self._probed[ends[at] : ends[at + 1]].reshape(shape) for at, shape in enumerate(shapes)
        )
        return self._probe.compliance(x, force, position, orientation, ramp)

    def _settles(self) -> bool:
        """Whether the tentative step is one that the probe speaks of."""
        planned = self._to_plan and not self.model.explicit and len(self._probed) > 0
        return bool(planned and self._probe is not None and self._probed[0] == self._dt and self._probe.keeps_ways)

    def settle(self, force: Floats) -> None:
        """Move the tentative step on by its linear answer to a force (s, 3) [N] on the seam, as the probe found it."""
        if not (self._tentative and self._settles()) or force.shape != (len(self.model.region.seam), 3):
            raise ValueError("this step cannot be settled: only one as long as the probed one, taken to plan, can")
        if len(self._ways) == 0:
            self._ways = self._probe_again()[1]
        probe, work, result = self._probe, self._work, self._result
        assert probe is not None
        settle(
            *(self._ws, self._xw, self._blocks, self._nodes, self._figures, probe.ids, probe.beyond),
            *(self._ways, self.model.seam_force(force), np.empty(self._ways.shape[1:]), work.x, work.v, result),
        )
        watch.settle(work.monitor, result)

    def commit(self) -> None:
        """Accept the tentative step; does nothing if there is none."""
        if self._tentative:
            self._committed, self._work = self._work, self._committed
            self._tentative = False

    def discard(self) -> None:
        """Take the tentative step back; does nothing if there is none."""
        self._tentative = False

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Fields of the last advanced step."""
        state = self._work if self._tentative else self._committed
        model, region = self.model, self.model.region
        n = model.n_nodes
        self._xw[:n, :3] = state.x
        cauchy = np.zeros((len(region.cells), 8, 6))
        blocks = model.blocks
        octant_stress(self._ws, self._xw, blocks.nodes, blocks.octant, blocks.constants, blocks.law, cauchy)
        energy = np.zeros(len(region.cells))
        cell_energies(
            self._ws, self._xw, blocks.nodes, blocks.volume, blocks.octant, blocks.constants, blocks.law, energy
        )
        point_x = np.zeros((model.n_points, 3))
        place_points(self._xw, model.indptr, model.node, model.weight, point_x)
        size = np.einsum("ptc,ptc->pt", state.force_mean, state.force_mean)
        v = state.v.copy()
        fill_in(model.levels, region, model.mass, state.x, v)
        cauchy[model.levels.coarse] = cauchy[model.levels.coarse, :1]
        tool = np.full(model.n_points, -1, dtype=np.int32)
        if model.n_tools and model.n_points:
            touching = size.max(axis=1) > 0.0
            tool[touching] = size[touching].argmax(axis=1)
        return Fields(
            header=request_header,
            nodes=region.nodes,
            x=state.x.copy(),
            v=v,
            cauchy=cauchy,
            points=region.points,
            point_x=point_x,
            contact_force=state.force_mean.sum(axis=1),
            contact_tool=tool,
            cell_energy=energy,
            model_error=self._model_error(state.x, state.force_mean.sum(axis=1), state.stress, own)
            if indicators
            else np.zeros(0),
        )

    def _model_error(self, x: Floats, contact_force: Floats, stress: Floats, bounded: bool) -> Floats:
        """Zero where cells are no boxes, or some are one block: scenes that ask for it are refused."""
        model = self.model
        if not model.body.boxes or model.levels.ties is not None:
            return np.zeros(len(model.region.cells))
        if self._measure is None:
            self._measure = ModelError(model.body, model.region, model.spec.hourglass, model.blocks)
        return self._measure.measure(x, contact_force, stress, bounded)

    def snapshot(self) -> bytes:
        """Commit, then everything that the future depends on; there is no cache that could change later bits."""
        self.commit()
        return encode_state(self._committed, self._probed)

    def restore(self, state: bytes) -> None:
        """Take over a snapshot of the same region; a tentative step is dropped."""
        model, t = self.model, self.model.n_tools
        most_probed = 1 + 3 * model.n_nodes + 3 * model.n_points * t + 7 * t
        self._probed = decode_state(state, self._committed, most_probed)
        self._ways = no_ways()
        if len(self._probed):
            self._probe = self._probe_for(float(self._probed[0]))
        self._tentative = False
