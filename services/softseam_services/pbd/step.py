"""One step of a PBD region: the plan, and what is tried in its place where the monitor does not believe it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softseam_protocol.messages.outcomes import Detail
from softseam_protocol.messages.participant import Advance, ToolMotion
from softseam_services.standing import Standing
from softseam_services.tools.tool_set import ToolSet

from . import watch
from .kernels import summary as k
from .kernels.block import new_workspace
from .kernels.leapfrog import advance_leapfrog
from .kernels.pairs import place_points
from .kernels.split import split_forces
from .kernels.substep import advance_step
from .model import KAPPA, PbdModel
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
from .state import PbdState

MARGIN = 0.1
"""points within this many block edges of a tool, and what speeds add to it, are tried for contact"""
TOUCH = 1e-3
"""gap below which a handed-over point touches a tool, in block edges"""
COLLAPSE_STEP = 1e-4
"""size, relative to rest, that a body without shape is given again"""
_NO_FORCES = np.zeros((0, 3))


class Taken(NamedTuple):
    """What came of a step; its figures are in `Stepper.result`."""

    fault: watch.Fault
    to_plan: bool
    """whether the first attempt was good"""
    sweeps: int
    """of all attempts"""
    notice: dict[Detail, str]
    """what the monitor has to say"""

    @property
    def why(self) -> str:
        """What is wrong with it, '' for nothing."""
        return "" if self.fault is watch.Fault.NONE else self.fault.value


class Stepper:
    """Takes steps of one region from a state into another, by XPBD or leapfrog."""

    def __init__(self, model: PbdModel, tools: ToolSet, dt: float) -> None:
        """dt: of the steps that are expected [s]"""
        self._model = model
        self.dt = dt
        """of the last step [s]"""
        self.planned = self.n_substeps = model.substeps(dt)
        """substeps of a step of dt, and of the last attempt at one"""
        n, p, t = model.n_nodes, model.n_points, model.n_tools
        self.ws = new_workspace()
        self.pair = Pair(self.ws, model.blocks.colours, n)
        self._scratch = new_scratch(model)
        self.xw, self.figures = self._scratch.xw, self._scratch.figures
        self.contacts = new_contacts(n, model.blocks.n_batches, p, t)
        self.nodes = node_arrays(model)
        self.blocks = block_arrays(model.blocks, model.blocks.nodes, model.softness)
        self._points = point_arrays(model)
        self._tools = tool_arrays(tools)
        self._solve = self._new_solve()
        self._margin = MARGIN * float(model.blocks.edges.min())
        self._floor = 1e-8 * min(material.mu for material in model.body.materials) * float(model.blocks.volume.sum())
        if model.explicit:
            self._leap = leap_arrays(model, self.figures)
        self.wrench = np.zeros((t, 6))
        """on the body (t, 6) [N, N m]"""
        self.distance = np.zeros(len(model.region.cells))
        """of each cell from the nearest tool (c,) [m]"""
        self.result = np.zeros(k.N_RESULTS)
        """see `kernels.summary`"""

    def load_kernel(self, committed: PbdState, work: PbdState) -> None:
        """Compile or load the explicit step before anybody waits for one: a substep that leaves no trace."""
        np.copyto(work.buffer, committed.buffer)
        self._leap_ahead(work, 1e-9, 1)
        self.result[:] = 0.0

    def _new_solve(self) -> Solve:
        """For as many substeps as the last repetition of a step takes at most."""
        model = self._model
        return solve_arrays(
            model, model.blocks, self.planned * 2 ** (watch.RETRIES + watch.SHORTEST), model.spec.residual or 0.0
        )

    def take(self, committed: PbdState, work: PbdState, request: Advance) -> Taken:
        """The step from `committed` into `work`, tried until the monitor believes it."""
        if committed.monitor[watch.UNSHARED] != 0.0:
            self.share_out(committed, request.tools)
        result, cause, sweeps = self.result, "", 0
        for attempt in range(watch.RETRIES + 1):
            n_substeps, n_sweeps = self.attempt(committed, work, request, attempt)
            swept, unfinished = self._swept(n_substeps, n_sweeps)
            sweeps += swept
            fault = watch.check(result, committed.monitor, self._floor)
            notice = watch.alarm(cause, result, committed.monitor, attempt, n_substeps, n_sweeps, unfinished)
            lagging = attempt == 0 and watch.grows(result, committed.monitor)
            if fault is watch.Fault.NONE and not lagging:
                break
            cause = fault.value.split(":")[0] if fault is not watch.Fault.NONE else "the residual grows"
        if fault is watch.Fault.DIVERGED:
            self.fail(committed, work)
        elif watch.remember(work.monitor, result, self._floor):
            notice[Detail.SHORTER] = watch.GAINS
        return Taken(fault, fault is watch.Fault.NONE and attempt == 0, sweeps, notice)

    def fail(self, committed: PbdState, work: PbdState) -> None:
        """There is no step: the body is where it was."""
        np.copyto(work.buffer, committed.buffer)
        self.result[:] = 0.0
        self.wrench[:] = 0.0
        self.distance[:] = 0.0
        result, monitor = self.result, committed.monitor
        standing = Standing.of(committed.x, committed.v, self._model.region.mass)
        result[k.KINETIC], result[k.STRAIN] = standing.kinetic, monitor[watch.STRAIN]
        result[k.GRAVITY] = monitor[watch.GRAVITY]
        result[k.MOMENTUM : k.MOMENTUM + 3], result[k.ANGULAR : k.ANGULAR + 3] = standing.momentum, standing.angular
        result[k.BOUNDS : k.BOUNDS + 6] = standing.bounds.ravel()

    def share_out(self, state: PbdState, motion: ToolMotion) -> None:
        """A handed-over state names one tool a point; now that the poses are known, all that touch it get a share."""
        model = self._model
        tools = model.tools
        self.xw[: model.n_nodes, :3] = state.x
        point_x = np.zeros((model.n_points, 3))
        place_points(self.xw, model.indptr, model.node, model.weight, point_x)
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

    def attempt(self, committed: PbdState, work: PbdState, request: Advance, attempt: int) -> tuple[int, int]:
        """One attempt at the step from `committed` into `work`; returns substeps and sweeps.

        Attempt 0 is the plan. Later ones halve the substep each time and sweep once more; from the second on the
        carried forces start from zero, because those of a torn shape throw the nodes apart. Leapfrog sweeps nothing.
        """
        motion = request.tools
        np.copyto(work.buffer, committed.buffer)
        if work.monitor[watch.STRETCH] < watch.COLLAPSED:
            work.x[:] += COLLAPSE_STEP * (self._model.x_rest - self._model.x_rest.mean(axis=0))
        if request.dt != self.dt:
            self.dt, self.planned = request.dt, self._model.substeps(request.dt)
            self._solve = self._new_solve()
        n_substeps = self.planned * 2 ** (attempt + int(work.monitor[watch.HALVINGS]))
        self.n_substeps = n_substeps
        if self._model.explicit:
            self._leap_ahead(work, request.dt, n_substeps)
            return n_substeps, 0
        if attempt >= watch.COLD:
            work.stress[:] = 0.0
            work.a[:] = 0.0
            work.force[:] = 0.0
        n_sweeps = self._model.spec.sweeps + attempt
        if watch.needs_two_sweeps(work.monitor):
            n_sweeps = max(n_sweeps, 2)
        self._solve.used[:] = 0
        self._model.find_shares(work.x, motion.position, motion.orientation)
        force, growth = self._model.seam_force(request.seam_force), _NO_FORCES
        if len(request.seam_force_start):
            start = self._model.seam_force(request.seam_force_start)
            growth = (force - start) / n_substeps
            force = start + growth
        self.pair.run(
            n_substeps * n_sweeps,
            advance_step,
            *(work, self.nodes, self.blocks, self._points, self._tools, self.contacts, self._scratch, self._solve),
            *(motion.position, motion.orientation, motion.position_next, motion.orientation_next, force, growth),
            *(self.wrench, self.distance, self.result),
            *(request.dt, n_substeps, n_sweeps, KAPPA, self._margin),
        )
        self.result[k.SLIP] = max(self.result[k.SLIP], self._model.slip_at_edges(work.force, work.slip))
        return n_substeps, n_sweeps

    def _swept(self, n_substeps: int, n_sweeps: int) -> tuple[int, int]:
        """Sweeps of the last try, and its substeps in which they did not bring the residual down far enough."""
        if self._solve.tolerance == 0.0:
            return n_substeps * max(n_sweeps, 1), 0
        used = self._solve.used[:n_substeps]
        unfinished = int((used == 0).sum())
        return int(used.sum()) + unfinished * n_sweeps, unfinished

    def _leap_ahead(self, work: PbdState, dt: float, n_substeps: int) -> None:
        """The explicit step, in place."""
        model = self._model
        self.pair.run(
            n_substeps,
            advance_leapfrog,
            *(work, self.blocks, self._leap, model.mass, model.x_rest, model.body.gravity),
            *(self.distance, self.result, model.spec.damping.mass, dt, n_substeps),
        )
