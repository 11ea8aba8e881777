"""The FEM participant's solver: steps of cells with any element, contact by augmented Lagrangian."""

from __future__ import annotations

import time

import numpy as np

from softseam_protocol.messages import Advance, Advanced, BodyState, Fields, Header
from softseam_protocol.scene import Scene
from softseam_services.body.body import Body, Floats, Region
from softseam_services.fem import substeps
from softseam_services.fem.face_forces import spread_over_faces
from softseam_services.fem.failures import why
from softseam_services.fem.field_reader import FieldReader
from softseam_services.fem.integrators.scheme import IMPLICIT_EULER, STATIC, SYMPLECTIC_EULER
from softseam_services.fem.integrators.static import raised
from softseam_services.fem.integrators.table import build_scheme, forces_at, velocity_gain, works_at
from softseam_services.fem.kernels import step as kernel
from softseam_services.fem.kernels.elements import strain_energy
from softseam_services.fem.kernels.fronts import seam_root
from softseam_services.fem.kernels.multigrid import NONE
from softseam_services.fem.kernels.newton import (
    CONVERGED,
    FACTORED,
    N_FACTORS,
    N_MEMO,
    STALLED,
)
from softseam_services.fem.kernels.settle import settle
from softseam_services.fem.model import build_model
from softseam_services.fem.snapshot import pack, unpack
from softseam_services.fem.state import FemState
from softseam_services.fem.tool_motion import Tools, at_rest, moved, part_of
from softseam_services.fem.work import build_work
from softseam_services.request_check import problem_of, problem_of_anchor
from softseam_services.tools.tool_set import ToolSet

_CAREFUL_ITERATIONS = 200
_MOST_HALVINGS = 5
# Of the error that a substep may make in time, the share that Newton's method may leave.
_UNSEEN = 1e-2
_AT_ONCE = substeps.Substeps(n_accepted=1)


class FemSolver:
    """One region computed with finite elements; a `participant.Solver`."""

    def __init__(
        self, scene: Scene, body: Body, region: Region, tools: ToolSet, state: BodyState | None = None
    ) -> None:
        """state: of the whole body, taken over at a region switch; None is rest with the initial velocities.

        Neither has an integrator's history, so one that needs it begins with a step of midpoint.
        """
        self._body, self._region, self._tools = body, region, tools
        self._spec = scene.models.fem
        n_tools = len(tools.names)
        self._model, self._tree = build_model(body, region, tools, self._spec)
        self._work = build_work(self._model, self._tree, n_tools)
        self._scheme = build_scheme(self._spec, self._model, self._work, n_tools > 0, body.material.retardation_time)
        self._memo = np.zeros(N_MEMO)
        self._reader = FieldReader(body, region, self._model, scene.models)
        self._tolerance = self._spec.tolerance * self._model.edge
        self._substeps: substeps.Substeps | None = None
        # substeps alternate between two lengths, of which each keeps a factor of its own
        self._both = [(self._work, self._memo)]
        if self._spec.step_error is not None:
            self._bound = self._spec.step_error * self._model.edge
            self._tolerance = min(self._tolerance, _UNSEEN * self._bound)
            self._both.append((build_work(self._model, self._tree, n_tools), np.zeros(N_MEMO)))
        shape = (len(self._model.point_face), n_tools, 6)
        if state is None:
            x, v, contact = body.x_rest[region.nodes], body.v_initial[region.nodes], np.zeros(shape)
        else:
            x, v, contact = state.x[region.nodes], state.v[region.nodes], np.zeros(shape)
            touching = np.flatnonzero(state.contact_tool[region.points] >= 0)
            tool = state.contact_tool[region.points[touching]]
            contact[touching, tool, :3] = state.contact_force[region.points[touching]]
            spread_over_faces(self._model, contact)
        self._committed = FemState(
            np.ascontiguousarray(x, dtype=np.float64),
            np.ascontiguousarray(v, dtype=np.float64),
            contact,
            np.zeros((self._scheme.n_history, len(region.nodes), 3)),
        )
        self._next = self._committed.copy()
        self._spare = [self._committed.copy() for _ in range(4)] if self._spec.step_error is not None else []
        self._tentative = False
        self._knows_stiffness = False
        self._step: tuple[int, int] | None = None
        self._dt = 0.0  # of the last advance [s]
        self._told = -1.0  # factor whose yield of the seam was last told
        self._n_tools, self._n_seam = n_tools, len(region.seam)
        self._whole = at_rest(tools)
        n_seam = self._n_seam
        self._wrench = np.zeros((n_tools, 6))
        self._out = np.zeros(kernel.N_OUT)
        self._seam_x = np.zeros((n_seam, 3))
        self._inverse = np.zeros((3 * n_seam, 3 * n_seam))
        self._distance = np.zeros(len(region.cells))

    @property
    def n_nodes(self) -> int:
        return len(self._region.nodes)

    @property
    def factorisations(self) -> int:
        """Matrices factored since the state was last set."""
        return int(sum(memo[N_FACTORS] for _, memo in self._both))

    @property
    def state(self) -> FemState:
        """State at the end of the last advanced step, or the committed one."""
        return self._next if self._tentative else self._committed

    @property
    def strain(self) -> float:
        """Strain energy of the last advanced step [J]."""
        return float(strain_energy(self.state.x, self._model, self._work))

    @property
    def moving(self) -> tuple[float, float]:
        """Kinetic energy, and that in gravity, of the last advanced step [J]."""
        model, state = self._model, self.state
        sunk = (state.x - model.x_rest) @ model.acceleration
        return 0.5 * float(model.mass @ (state.v * state.v).sum(axis=1)), -float(model.mass @ sunk)

    def advance(self, request: Advance) -> Advanced:
        """Advance tentatively by request.dt; a new step number commits the tentative step before it."""
        began = time.perf_counter()
        key = (request.header.epoch, request.header.step)
        again = self._tentative and self._step == key
        if not again:
            self.commit()
        self._step, self._dt = key, request.dt
        problem = self._refuse(request)
        if problem:
            return self._failed(request, problem, began)
        now, end = self._committed, self._next
        if not again:
            np.multiply(now.v, request.dt, out=end.x)
            end.x += now.x
        self._couple(request)
        self._substeps = None
        whole = moved(self._whole, request.tools)
        if self._spec.step_error is not None:
            status = self._adapt(now, end, request, whole)
            if status != CONVERGED:
                return self._failed(request, self._why(status), began)
            self._tentative = True
            return self._reply(request, "converged", began)
        force = self._seam_force(request, now)
        status = self._advance(now, end, request.dt, force, whole, self._spec.iterations, False)
        if status == STALLED:
            # slow, but not lost: points that slip on the bound of friction; go on with a new factor
            self._memo[FACTORED] = 0.0
            status = self._advance(now, end, request.dt, force, whole, self._spec.iterations, False)
        if status != CONVERGED and self._scheme.kind != SYMPLECTIC_EULER:
            status = self._insist(now, end, request, whole)
        if status != CONVERGED:
            return self._failed(request, self._why(status), began)
        self._tentative = True
        if self._substeps is None:
            self._out[kernel.SEAM_WORK] = self._seam_work(request, now, end)
        if request.compliance:
            status = self._advance(now, end, request.dt, request.seam_force, whole, 0, False, derive=True)
            if status != CONVERGED:
                return self._failed(request, self._why(status), began)
            if len(request.seam_force_start):
                at = forces_at(self._scheme, now.past)
                self._inverse *= at * velocity_gain(self._scheme, request.dt, now.past)
        return self._reply(request, "converged", began)

    def _seam_force(self, request: Advance, begin: FemState, part: int = 0, parts: int = 1) -> Floats:
        """Force on the seam over one of equal parts of the step, where the integrator takes it (s, 3) [N]."""
        start = request.seam_force_start
        if not len(start):
            return request.seam_force
        at = (part + forces_at(self._scheme, begin.past)) / parts
        return np.asarray(start + at * (request.seam_force - start))

    def _seam_work(self, request: Advance, begin: FemState, end: FemState, parts: int = 1) -> float:
        """Work of the seam force in the last of equal parts of the step, which led from `begin` to `end` [J]."""
        work = float(self._out[kernel.SEAM_WORK])  # of the force where it acts
        if len(request.seam_force_start):
            later = works_at(self._scheme, begin.past) - forces_at(self._scheme, begin.past)
            seam, growth = self._region.seam, (request.seam_force - request.seam_force_start) / parts
            work += later * float(np.sum(growth * (end.x[seam] - begin.x[seam])))
        return work

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
        derive: bool = False,
    ) -> int:
        """One step, or one of the parts left of it, from `now` into `end`, whose x is the first guess.

        derive: nothing but the seam's compliance at the end of the step.

        Returns a status of `kernels.newton`.
        """
        static = self._scheme.kind == STATIC
        past = raised(now.past, parts_left) if static and not derive else now.past
        status: int = kernel.advance(
            self._scheme, now.x, now.v, past, now.history, now.contact, dt, pace, force, self._model, self._tree, tools,
            self._tolerance, most, careful, self._work, self._memo,
            end.x, end.v, end.history, end.contact, self._wrench, self._out, self._seam_x, self._distance,
            derive, self._inverse,
        )  # fmt: skip
        if not derive:
            end.past = past if static else dt
        return status

    def _adapt(self, now: FemState, end: FemState, request: Advance, whole: Tools) -> int:
        """The step in substeps as long as the error in time allows; returns a status of `kernels.newton`."""

        def take(begin: FemState, end: FemState, level: int, place: int) -> tuple[int, float, float]:
            self._work, self._memo = self._both[level % 2]
            share = 0.5**level
            dt, tools = request.dt * share, part_of(whole, place * share, (place + 1) * share)
            iterations = 0.0
            for careful in (False, True) if level >= substeps.DEEPEST else (False,):
                most = _CAREFUL_ITERATIONS if careful else self._spec.iterations
                status = self._advance(begin, end, dt, request.seam_force, tools, most, careful, pace=share)
                iterations += self._out[kernel.N_ITERATIONS]
                if status == CONVERGED:
                    break
                self._memo[FACTORED] = 0.0
                end.x[:] = begin.x
            return status, float(self._out[kernel.TOOL_WORK]), iterations

        report = substeps.advance(take, self._scheme, now, end, self._spare, request.dt, self._bound)
        self._out[kernel.TOOL_WORK], self._out[kernel.N_ITERATIONS] = report.tool_work, report.iterations
        self._substeps = report
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
                self._work.seam_coupled[0] &= pieces == 1  # over parts of a step the seam force is constant
                dt = request.dt / pieces
                force = self._seam_force(request, begin, piece, pieces)
                for careful in (False, True):
                    if careful or pieces > 1:
                        self._memo[FACTORED] = 0.0
                        end.x[:] = begin.x
                        most = _CAREFUL_ITERATIONS if careful else self._spec.iterations
                        status = self._advance(
                            begin, end, dt, force, tools, most, careful, pieces - piece, 1.0 / pieces
                        )
                        iterations += self._out[kernel.N_ITERATIONS]
                        if status == CONVERGED:
                            break
                if status != CONVERGED:
                    break
                tool_work += self._out[kernel.TOOL_WORK]
                seam_work += self._seam_work(request, begin, end, pieces)
                begin = end.copy()
            if status == CONVERGED:
                self._out[kernel.TOOL_WORK], self._out[kernel.SEAM_WORK] = tool_work, seam_work
                self._out[kernel.N_ITERATIONS] = iterations
                self._substeps = substeps.Substeps(n_accepted=pieces)
                break
        self._memo[FACTORED] = 0.0
        return status

    def _couple(self, request: Advance) -> None:
        """Take over how the other side resists at the seam, or that it does not."""
        work, coupled = self._work, len(request.seam_anchor) > 0
        same = coupled == bool(work.seam_coupled[0])
        if coupled:
            work.seam_anchor[:] = request.seam_anchor
            if request.seam_stiffness.size and not np.array_equal(request.seam_stiffness, work.seam_stiffness):
                work.seam_stiffness[:] = request.seam_stiffness
                same = False
            self._knows_stiffness = True
        if not same:
            self._memo[FACTORED] = 0.0
        work.seam_coupled[0] = coupled

    def _refuse(self, request: Advance) -> str:
        """What makes the request impossible to serve, or ''."""
        problem = problem_of(request, self._n_tools, self._n_seam)
        return problem or problem_of_anchor(request, self._n_seam, self._knows_stiffness)

    def _why(self, status: int) -> str:
        return why(status, self._memo, self._region.cells, divided=self._scheme.kind != SYMPLECTIC_EULER)

    def _failed(self, request: Advance, text: str, began: float) -> Advanced:
        now, end = self._committed, self._next
        end.x[:], end.v[:], end.contact[:] = now.x, now.v, now.contact
        end.history[:], end.past, end.level = now.history, now.past, now.level
        self._tentative = False
        self._wrench[:] = 0.0
        self._out[:] = 0.0
        self._substeps = None
        for _, memo in self._both:
            memo[FACTORED] = 0.0
        self._seam_x[:] = now.x[self._region.seam]
        return self._reply(request, text, began)

    def _reply(self, request: Advance, status: str, began: float) -> Advanced:
        out, numbers = self._out, self._out.tolist()
        taken = self._substeps or _AT_ONCE
        whole = request.compliance and status == "converged"
        settles = status == "converged" and self._settles()
        return Advanced(
            request.header,
            status,
            self._seam_x.copy(),
            self._inverse.copy() if whole else np.zeros((0, 0)),
            self._wrench.copy(),
            numbers[kernel.KINETIC],
            numbers[kernel.STRAIN],
            numbers[kernel.GRAVITY],
            numbers[kernel.TOOL_WORK],
            numbers[kernel.SEAM_WORK],
            out[kernel.MOMENTUM : kernel.MOMENTUM + 3].copy(),
            out[kernel.ANGULAR : kernel.ANGULAR + 3].copy(),
            numbers[kernel.PENETRATION],
            numbers[kernel.SLIPPED],
            int(numbers[kernel.N_CONTACTS]),
            int(numbers[kernel.N_ITERATIONS]),
            time.perf_counter() - began,
            self._distance.copy(),
            out[kernel.LOWEST : kernel.LOWEST + 6].copy().reshape(2, 3),
            self._work.seam_actual.copy(),
            n_crushed=int(self._work.mixed[0]),
            n_substeps=taken.n_accepted,
            n_rejected=taken.n_rejected,
            step_error=taken.error,
            seam_v=self.state.v[self._region.seam] if len(request.seam_force_start) else np.zeros((0, 3)),
            settles=settles,
            seam_yield_root=self._news_of_yield() if settles else np.zeros((0, 0)),
        )

    def _settles(self) -> bool:
        """Whether the tentative step has a factor that says how it would answer the seam beside the other side."""
        at_once = self._substeps is None and self._scheme.kind == IMPLICIT_EULER and self._tree.kind == NONE
        return bool(at_once and self._work.seam_coupled[0] and self._memo[FACTORED])

    def _news_of_yield(self) -> Floats:
        """A root of d(seam_x)/d(seam_force) of the factor at hand (3s, 3s); empty where that was told before."""
        if self._told == self._memo[N_FACTORS]:
            return np.zeros((0, 0))
        self._told = float(self._memo[N_FACTORS])
        work, root = self._work, np.empty_like(self._inverse)
        seam_root(self._tree, work.values, work.seam_block, root, work.ints)
        return root

    def settle(self, force: Floats) -> None:
        """Move the tentative step on by its linear answer to a force (s, 3) [N] on the seam; see `kernels.settle`."""
        if not (self._tentative and self._settles()) or force.shape != (self._n_seam, 3):
            raise ValueError(
                "this step cannot be settled: only one that was solved with a seam anchor, and at once, can"
            )
        settle(self._model, self._tree, self._work, force, self._dt, self._next.x, self._next.v)

    def commit(self) -> None:
        """Accept the tentative step; does nothing if there is none."""
        if self._tentative:
            self._committed, self._next = self._next, self._committed
            self._tentative = False

    def discard(self) -> None:
        """Take the tentative step back; does nothing if there is none."""
        self._tentative = False

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Fields of the last advanced step."""
        return self._reader.read(request_header, self.state, self._work, indicators, own)

    def snapshot(self) -> bytes:
        """Commit, drop the factor and the first guess, and return the state."""
        self.commit()
        self._forget()
        now = self._committed
        return pack(now.x, now.v, now.contact, now.history, np.array([now.past, float(now.level)]))

    def restore(self, state: bytes) -> None:
        """Replace the state by one that `snapshot` of an equal region returned."""
        now = self._committed
        x, v, contact, history, past = unpack(
            state, now.x.shape, now.v.shape, now.contact.shape, now.history.shape, (2,)
        )
        self._committed = FemState(x, v, contact, history, float(past[0]), int(past[1]))
        self._next = self._committed.copy()
        self._forget()

    def _forget(self) -> None:
        self._tentative = False
        self._step = None
        self._knows_stiffness = False
        self._told = -1.0
        for work, memo in self._both:
            memo[:] = 0.0
            work.factored_state[:] = 0
