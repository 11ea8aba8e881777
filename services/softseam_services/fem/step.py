"""One step of a region, in whichever way gets through it.

At once, as a rule; where an error in time is bounded, in substeps that keep it (`substeps`). Where Newton's method does
not converge the step is tried again with a new factor, then carefully, then in 2, 4 ... 32 equal parts.
"""

from __future__ import annotations

import numpy as np

from softseam_protocol.messages.participant import Advance, Correct
from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Floats, Ints
from softseam_services.fem import substeps
from softseam_services.fem.failures import why
from softseam_services.fem.inside_out import alarm
from softseam_services.fem.integrators.scheme import IMPLICIT_EULER, STATIC, SYMPLECTIC_EULER
from softseam_services.fem.integrators.static import raised
from softseam_services.fem.integrators.table import build_scheme, forces_at, velocity_gain, works_at
from softseam_services.fem.kernels import step as kernel
from softseam_services.fem.kernels.fronts import seam_root
from softseam_services.fem.kernels.newton import CONVERGED, FACTORED, N_FACTORS, N_MEMO, STALLED
from softseam_services.fem.kernels.points import remember
from softseam_services.fem.model import FemModel
from softseam_services.fem.state import FemState
from softseam_services.fem.tool_motion import Tools, part_of
from softseam_services.fem.tree import Tree
from softseam_services.fem.work import build_work

_CAREFUL_ITERATIONS = 200
# A careful step that takes longer is sooner done in parts.
_CAREFUL_AT_FIRST = 60
_MOST_HALVINGS = 5
# Of the error that a substep may make in time, the share that Newton's method may leave.
_UNSEEN = 1e-2
_NO_PUSH = np.zeros((0, 3))
_AT_ONCE = substeps.Substeps(n_accepted=1)


class Stepper:
    """Takes steps of one region from a state into another, and keeps the factor and what the last step came to."""

    def __init__(self, spec: FemSpec, model: FemModel, tree: Tree, n_tools: int, retardation_time: float) -> None:
        """retardation_time of the body's material [s]"""
        self._spec, self._model, self._tree = spec, model, tree
        self.work, self.memo = build_work(model, tree, n_tools), np.zeros(N_MEMO)
        self.scheme = build_scheme(spec, model, self.work, n_tools > 0, retardation_time)
        self._tolerance = spec.tolerance * model.edge
        # substeps alternate between two lengths, of which each keeps a factor of its own
        self._both = [(self.work, self.memo)]
        self._spare: list[FemState] = []
        if spec.step_error is not None:
            self._bound = spec.step_error * model.edge
            self._tolerance = min(self._tolerance, _UNSEEN * self._bound)
            self._both.append((build_work(model, tree, n_tools), np.zeros(N_MEMO)))
        self._parts: substeps.Substeps | None = None
        self._told = -1.0  # factor whose yield of the seam was last told
        n_seam = len(model.seam)
        self.knows_stiffness = False
        """whether the other side's stiffness at the seam was ever told"""
        self.out = np.zeros(kernel.N_OUT)
        self.wrench = np.zeros((n_tools, 6))
        """on the body (t, 6) [N, N m]"""
        self.seam_x = np.zeros((n_seam, 3))
        """(s, 3) [m]"""
        self.compliance = np.zeros((3 * n_seam, 3 * n_seam))
        """d(seam_x)/d(seam force), of the last `derive` (3s, 3s) [m/N]"""
        self.distance = np.zeros(len(model.cell_nodes))
        """of each cell from the nearest tool (c,) [m]"""

    @property
    def factorisations(self) -> int:
        """Matrices factored since the last `forget`."""
        return int(sum(memo[N_FACTORS] for _, memo in self._both))

    @property
    def by_error(self) -> bool:
        """Whether steps are taken in substeps that keep an error in time."""
        return self._spec.step_error is not None

    @property
    def taken(self) -> substeps.Substeps:
        """What it took to get through the last step."""
        return self._parts or _AT_ONCE

    def couple(self, anchor: Floats, stiffness: Floats) -> None:
        """Take over how the other side resists at the seam, or that it does not; as of `Advance`."""
        work, coupled = self.work, len(anchor) > 0
        same = coupled == bool(work.seam_coupled[0])
        if coupled:
            work.seam_anchor[:] = anchor
            if stiffness.size and not np.array_equal(stiffness, work.seam_stiffness):
                work.seam_stiffness[:] = stiffness
                same = False
            self.knows_stiffness = True
        if not same:
            self.memo[FACTORED] = 0.0
        work.seam_coupled[0] = coupled

    def take(self, now: FemState, end: FemState, request: Advance, whole: Tools) -> int:
        """The step from `now` into `end`, whose x is the first guess; returns a status of `kernels.newton`.

        whole: the tools over the step
        """
        self._parts = None
        if self.by_error:
            return self._adapt(now, end, request, whole)
        force, most = self._seam_force(request, now), self._spec.iterations
        status = self._advance(now, end, request.dt, force, whole, most, False)
        if status == STALLED:
            # slow, but not lost: points that slip on the bound of friction; go on with a new factor
            self.memo[FACTORED] = 0.0
            status = self._advance(now, end, request.dt, force, whole, most, False)
        if status != CONVERGED and self.scheme.kind != SYMPLECTIC_EULER:
            status = self._insist(now, end, request, whole)
        if status == CONVERGED and self._parts is None:
            self.out[kernel.SEAM_WORK] = self._seam_work(request, now, end)
        return status

    def derive(self, now: FemState, end: FemState, request: Advance, whole: Tools) -> int:
        """`compliance` at the end of the step that was taken; returns a status of `kernels.newton`."""
        status = self._advance(now, end, request.dt, request.seam_force, whole, 0, False, task=kernel.DERIVE)
        if status == CONVERGED and len(request.seam_force_start):
            at = forces_at(self.scheme, now.past)
            self.compliance *= at * velocity_gain(self.scheme, request.dt, now.past)
        return status

    def alarm(self, end: FemState, times: int) -> str:
        """What is wrong with the step that was taken, and was not noticed within it; '' where nothing is.

        Only a step that was hard, so that it was cut, is doubted.
        """
        return "" if self._parts is None else alarm(end.x, self._model, self.work, times)

    def why(self, status: int, cells: Ints) -> str:
        """What to say of a step that failed; cells (c,) are global ids."""
        return why(status, self.memo, cells, divided=self.scheme.kind != SYMPLECTIC_EULER)

    def fail(self, now: FemState) -> None:
        """The step failed: it came to nothing, and the body is where it was."""
        self.wrench[:] = 0.0
        self.out[:] = 0.0
        self._parts = None
        for _, memo in self._both:
            memo[FACTORED] = 0.0
        self.seam_x[:] = now.x[self._model.seam]

    def forget(self) -> None:
        """Drop the factors, and what the other side told."""
        self.knows_stiffness = False
        self._told = -1.0
        for work, memo in self._both:
            memo[:] = 0.0
            work.factored_state[:] = 0

    # ---- what the factor at hand says of the seam

    @property
    def at_once(self) -> bool:
        """Whether steps are taken by implicit Euler, in one, with a factor: their linear answers are known then."""
        return bool(self.scheme.kind == IMPLICIT_EULER and not self.by_error)

    @property
    def settles(self) -> bool:
        """Whether the last step has a factor that says how it would answer a force on the seam."""
        return bool(self.at_once and self._parts is None and self.memo[FACTORED])

    def news_of_yield(self, anyway: bool) -> Floats:
        """A root of d(seam_x)/d(seam_force) of the factor at hand (3s, 3s); empty if told before, unless `anyway`."""
        if self._told == self.memo[N_FACTORS] and not anyway:
            return np.zeros((0, 0))
        self._told = float(self.memo[N_FACTORS])
        work, root = self.work, np.empty_like(self.compliance)
        seam_root(self._tree, work.values, work.seam_block, root, work.ints)
        return root

    def correct(self, now: FemState, end: FemState, dt: float, request: Correct, whole: Tools) -> None:
        """Move the step of length dt [s] that led to `end` on by its linear answer."""
        self._advance(now, end, dt, request.force, whole, 0, False, task=kernel.CORRECT, push=request.push)

    # ---- ways to take a step

    def _advance(
        self,
        now: FemState,
        end: FemState,
        dt: float,
        force: Floats,
        tools: Tools,
        most: int,
        careful: bool,
        parts_left: int = 1,
        pace: float = 1.0,
        task: int = kernel.STEP,
        push: Floats = _NO_PUSH,
    ) -> int:
        """One step, or one of the parts left of it, from `now` into `end`, whose x is the first guess.

        task, push: as of `kernels.step.advance`.

        Returns a status of `kernels.newton`.
        """
        static = self.scheme.kind == STATIC
        past = raised(now.past, parts_left) if static and task == kernel.STEP else now.past
        if self._model.n_state:
            self.look(now, dt)
        status: int = kernel.advance(
            self.scheme, now.x, now.v, past, now.history, now.contact, dt, pace, force, self._model, self._tree, tools,
            self._tolerance, most, careful, self.work, self.memo,
            end.x, end.v, end.history, end.contact, self.wrench, self.out, self.seam_x, self.distance,
            task, push, self.compliance,
        )  # fmt: skip
        if task == kernel.STEP:
            end.past = past if static else dt
        self._remember(status, task, end)
        return status

    def look(self, begin: FemState, dt: float = 0.0) -> None:
        """What the material remembers as a step of length dt begins; with 0, forces and energies are of that state."""
        self.work.material_state[:] = begin.material
        self.work.material_dt[0] = dt

    def _remember(self, status: int, task: int, end: FemState) -> None:
        """What the material remembers at the end of a step that was solved."""
        if self._model.n_state and status == CONVERGED and task != kernel.DERIVE:
            remember(end.x, self._model, self._model.rule, self.work, end.material)

    def _adapt(self, now: FemState, end: FemState, request: Advance, whole: Tools) -> int:
        """The step in substeps as long as the error in time allows; returns a status of `kernels.newton`."""

        def take(begin: FemState, end: FemState, level: int, place: int) -> tuple[int, float, float]:
            self.work, self.memo = self._both[level % 2]
            share = 0.5**level
            dt, tools = request.dt * share, part_of(whole, place * share, (place + 1) * share)
            iterations = 0.0
            for careful in (False, True) if level >= substeps.DEEPEST else (False,):
                most = _CAREFUL_ITERATIONS if careful else self._spec.iterations
                status = self._advance(begin, end, dt, request.seam_force, tools, most, careful, pace=share)
                iterations += self.out[kernel.N_ITERATIONS]
                if status == CONVERGED:
                    break
                self.memo[FACTORED] = 0.0
                end.x[:] = begin.x
            return status, float(self.out[kernel.TOOL_WORK]), iterations

        self._spare = self._spare or [now.copy() for _ in range(4)]
        report = substeps.advance(take, self.scheme, now, end, self._spare, request.dt, self._bound)
        self.out[kernel.TOOL_WORK], self.out[kernel.N_ITERATIONS] = report.tool_work, report.iterations
        self._parts = report
        return report.status

    def _insist(self, now: FemState, end: FemState, request: Advance, whole: Tools) -> int:
        """What is left when the plain step failed: a careful one from `now`, then 2, 4 ... 32 parts."""
        status = STALLED
        for halvings in range(_MOST_HALVINGS + 1):
            pieces = 1 << halvings
            begin = now.copy()
            tool_work = seam_work = iterations = 0.0
            for piece in range(pieces):
                tools = part_of(whole, piece / pieces, (piece + 1) / pieces)
                self.work.seam_coupled[0] &= pieces == 1  # over parts of a step the seam force is constant
                dt = request.dt / pieces
                force = self._seam_force(request, begin, piece, pieces)
                for careful in (False, True):
                    if careful or pieces > 1:
                        self.memo[FACTORED] = 0.0
                        end.x[:] = begin.x
                        most = _CAREFUL_ITERATIONS if pieces > 1 else min(_CAREFUL_AT_FIRST, _CAREFUL_ITERATIONS)
                        most = most if careful else self._spec.iterations
                        status = self._advance(
                            begin, end, dt, force, tools, most, careful, pieces - piece, 1.0 / pieces
                        )
                        iterations += self.out[kernel.N_ITERATIONS]
                        if status == CONVERGED:
                            break
                if status != CONVERGED:
                    break
                tool_work += self.out[kernel.TOOL_WORK]
                seam_work += self._seam_work(request, begin, end, pieces)
                begin = end.copy()
            if status == CONVERGED:
                self.out[kernel.TOOL_WORK], self.out[kernel.SEAM_WORK] = tool_work, seam_work
                self.out[kernel.N_ITERATIONS] = iterations
                self._parts = substeps.Substeps(n_accepted=pieces)
                break
        self.memo[FACTORED] = 0.0
        return status

    def _seam_force(self, request: Advance, begin: FemState, part: int = 0, parts: int = 1) -> Floats:
        """Force on the seam over one of equal parts of the step, where the integrator takes it (s, 3) [N]."""
        start = request.seam_force_start
        if not len(start):
            return request.seam_force
        at = (part + forces_at(self.scheme, begin.past)) / parts
        return np.asarray(start + at * (request.seam_force - start))

    def _seam_work(self, request: Advance, begin: FemState, end: FemState, parts: int = 1) -> float:
        """Work of the seam force in the last of equal parts of the step, which led from `begin` to `end` [J]."""
        work = float(self.out[kernel.SEAM_WORK])  # of the force where it acts
        if len(request.seam_force_start):
            later = works_at(self.scheme, begin.past) - forces_at(self.scheme, begin.past)
            seam, growth = self._model.seam, (request.seam_force - request.seam_force_start) / parts
            work += later * float(np.sum(growth * (end.x[seam] - begin.x[seam])))
        return work
