"""The FEM participant's solver: what a request asks of one region, and the answer; how a step is taken is in `step`."""

import time
from functools import cached_property

import numpy as np

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Detail, Figure, Status
from softseam_protocol.messages.participant import Advance, Advanced, BodyState, Capabilities, Correct, Coupled, Fields
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.internal import internal_of
from softseam_services.body.kernels.bounds import bound_points
from softseam_services.body.turning import sums_of
from softseam_services.request_check import problem_of, problem_of_correction, problem_of_target
from softseam_services.tools.edged import with_round_edges
from softseam_services.tools.tool_set import ToolSet
from softseam_services.tools.travel import parts_needed
from softseam_services.totals import Totals, fastest

from .face_forces import taken_over
from .failures import STATUS
from .field_reader import FieldReader
from .figures import seldom
from .inputs import AT_ONCE, StepInputs, StepResult, at_rest, moved
from .joints import follow_roots
from .kernels import step as kernel
from .kernels.contact_columns import N_STATE
from .kernels.elements import strain_energy
from .kernels.newton import CONVERGED
from .model import FemModel, with_seam_last
from .region_tables import RegionTables
from .state import FemState, pack, unpack
from .step import Stepper
from .step_derivative import Augmentation, FemTape
from .structures import Tables
from .work import Work, build_work

_NONE, _FREE = np.zeros((0, 0)), np.zeros((0, 3))
"""no matrix of the seam, and no vectors"""
_ALONE = Coupled(), Coupled(correctable=True)
"""of a region that nothing joins, whose step cannot be corrected, and can"""


class FemSolver:
    """One region computed with finite elements, or what its symmetry leaves of it; a `participant.Solver`."""

    def __init__(
        self,
        scene: Scene,
        body: Body,
        region: Region,
        tools: ToolSet,
        state: BodyState | None = None,
        tables: RegionTables | None = None,
    ) -> None:
        """state: of the whole body, taken over at a region switch; None is rest with the initial velocities.
        tables: of this region, where they are built already.

        Neither has an integrator's history, so one that needs it begins with a step of midpoint.
        """
        self._body, self._region, self._n_tools, self._tool_set = body, region, len(tools.names), tools
        self._whole_body = len(region.cells) == body.n_cells
        self._models, self._sleeps = scene.models, scene.sleep is not None
        self.tables = tables or RegionTables(body, region, tools, scene)
        self._reduction = reduction = self.tables.reduction
        self._solved = region if reduction is None else reduction.region
        solved = self.tables.whole if reduction is None else reduction.tables
        self.model, self.parameters = solved
        self.stepper = Stepper(scene.models.fem, *solved, self._n_tools)
        """of these two"""
        self._tentative = False
        self._energy_known = False  # whether work.energy is that of cells at the end of the tentative step
        self._step: tuple[int, int] | None = None
        self._request: Advance  # the last
        self._result: StepResult  # of that
        self._tools = at_rest(with_round_edges(tools, body))
        if state is None:
            nodes, n_points = self._solved.nodes, len(self._solved.points)
            force, tool = np.zeros((n_points, 3)), np.full(n_points, -1, dtype=np.int32)
            self._go_on(self._start(solved, body.x_rest[nodes], body.v_initial[nodes], force, tool))
        else:
            force, tool = state.contact_force[region.points], state.contact_tool[region.points]
            whole = self.tables.whole
            x = follow_roots(whole.model.joints, whole.parameters.joints, state.x[region.nodes])
            begun = self._start(whole, x, state.v[region.nodes], force, tool)
            if self.model.n_state:
                begun.material = internal_of(body, state, region.cells)
            self._take_over(begun)

    def _start(self, tables: Tables, x: Floats, v: Floats, force: Floats, tool: Ints) -> FemState:
        """A state without history, of the whole region or of what is solved for."""
        return FemState(
            np.ascontiguousarray(x, dtype=np.float64),
            np.ascontiguousarray(v, dtype=np.float64),
            taken_over(tables.model, tables.parameters, x, force, tool, self._n_tools),
            np.zeros((self.stepper.scheme.n_history, len(x), 3)),
            material=np.zeros(self._remembered),
            share=np.full(_n_blending(tables.model), -1.0),
        )

    @property
    def _remembered(self) -> tuple[int, int, int]:
        """Shape of what the material remembers."""
        model = self.model
        return (len(model.cell_nodes) if model.n_state else 0, 8, model.n_state)

    def _go_on(self, state: FemState) -> None:
        """Go on from a state of what is solved for."""
        self.committed = state
        """that steps begin with, of what is solved for"""
        self._next = state.copy()

    def _take_over(self, whole: FemState) -> None:
        """Go on from a state of the whole region."""
        reduction = self._reduction
        self._go_on(whole if reduction is None else reduction.restrict(whole, self.tables.images))

    def _extended(self, state: FemState) -> FemState:
        """Of the whole region."""
        return state if self._reduction is None else self._reduction.extend(state, self.tables.images)

    @property
    def n_nodes(self) -> int:
        return len(self._region.nodes)

    @property
    def times(self) -> int:
        """The region is so many times what is solved for."""
        return 1 if self._reduction is None else self._reduction.times

    @property
    def factorisations(self) -> int:
        """Matrices factored since the state was last set."""
        return self.stepper.factorisations

    @property
    def state(self) -> FemState:
        """State at the end of the last advanced step, or the committed one."""
        return self._extended(self._now)

    @property
    def _now(self) -> FemState:
        return self._next if self._tentative else self.committed

    @property
    def strain(self) -> float:
        """Strain energy of the last advanced step [J]."""
        self._look()
        return self.times * float(strain_energy(self._now.x, self.model, self.parameters, self.stepper.work))

    def _look(self) -> None:
        """Have kernels see the material as it is now."""
        if self.model.n_state:
            self.stepper.look(self._now)

    @property
    def moving(self) -> tuple[float, float]:
        """Kinetic energy, and that in gravity, of the last advanced step [J]."""
        parameters, state = self.parameters, self._now
        sunk = (state.x - parameters.x_rest) @ parameters.acceleration
        kinetic = 0.5 * float(parameters.mass @ (state.v * state.v).sum(axis=1))
        return self.times * kinetic, -self.times * float(parameters.mass @ sunk)

    def advance(self, request: Advance) -> Advanced:
        """Advance tentatively by request.dt; a new step number commits the tentative step before it.

        Raises SettingError where tools leave the symmetry that the scene says.
        """
        began = time.perf_counter()
        key = (request.header.epoch, request.header.step)
        again = self._tentative and self._step == key
        if not again:
            self.commit()
        self._step, self._request = key, request
        problem = problem_of(request, self._n_tools, len(self._region.seam))
        self._take_order(request)
        problem = problem or problem_of_target(request, len(self._region.seam), self.stepper.knows_impedance)
        if problem:
            return self._failed(request, Status.REFUSED, problem, began)
        tools = moved(self._tools, request.tools)
        if self._reduction is not None:
            self._reduction.check(tools)
        stepper, now, end = self.stepper, self.committed, self._next
        self._energy_known = False
        if not again:
            np.multiply(now.v, request.dt, out=end.x)
            end.x += now.x
        parts = parts_needed(self._tool_set, request.tools, now.x, now.v, request.dt)
        inputs = StepInputs.of(request, tools, parts)
        end, self._result = stepper.step(self.model, self.parameters, now, inputs, request.dt, end)
        status = self._result.status
        if status == CONVERGED and request.compliance and not stepper.by_error:
            status = stepper.derive(now, end, inputs, request.dt)
        if status != CONVERGED:
            return self._failed(request, STATUS[status], stepper.why(status, self._solved.cells), began)
        self._tentative = True
        return self._reply(request, Status.CONVERGED, "", began)

    @property
    def _last(self) -> bool:
        """Whether the seam's nodes are eliminated last."""
        return self.model.tree.seam_front >= 0

    def _take_order(self, request: Advance) -> None:
        """Solve with the coupling nodes of a whole body last only where more is wanted than how some of them answer."""
        asked, n = request.coupling_asked, len(self.model.seam)
        some = 0 < 2 * len(asked) <= n and (self.stepper.at_once or not request.compliance)
        if n and self._whole_body and some == self._last:
            self.model = self.tables.whole.model if some else self._seam_last

    @cached_property
    def _seam_last(self) -> FemModel:
        return with_seam_last(self.tables.whole.model)

    def _failed(self, request: Advance, status: Status, why: str, began: float) -> Advanced:
        now, end = self.committed, self._next
        now.into(end)
        self._tentative = self._energy_known = False
        self.stepper.fail(now)
        self._stand(now)
        return self._reply(request, status, why, began)

    def _stand(self, now: FemState) -> None:
        """What a step that failed reports: the whole region where it stands."""
        whole, out = self._extended(now), self.stepper.result.out
        standing = Totals.of(whole.x, whole.v, self.tables.whole.parameters.mass)
        out[kernel.KINETIC], out[kernel.STRAIN] = standing.kinetic, self.strain
        out[kernel.GRAVITY] = self.moving[1]
        out[kernel.MOMENTUM : kernel.MOMENTUM + 3] = standing.momentum
        out[kernel.ANGULAR : kernel.ANGULAR + 3] = standing.angular
        out[kernel.LOWEST : kernel.LOWEST + 6] = standing.bounds.ravel()
        if self._body.cut:
            self._bound(whole.x, out)

    def _bound(self, x: Floats, out: Floats) -> None:
        """How far a surface that runs through cells reaches, whose nodes are at x (n, 3) [m]. Such a body has no
        symmetry."""
        model, parameters = self.tables.whole
        points = model.point_ptr, model.point_node, parameters.point_weight
        bound_points(len(self._region.points), *points, x, out[kernel.LOWEST : kernel.LOWEST + 6])

    def _reply(
        self, request: Advance, status: Status, why: str, began: float, correction: Correct | None = None
    ) -> Advanced:
        """What became of a request, or of its correction."""
        stepper, reduction = self.stepper, self._reduction
        found, taken = stepper.result, self._result.substeps if status is Status.CONVERGED else AT_ONCE
        out, wrench = found.out.copy(), found.wrench.copy()
        converged = status is Status.CONVERGED
        if self._body.cut and converged:
            self._bound(self._next.x, out)
        if reduction is not None and converged:
            reduction.add_up(self._next, self._tools, out, wrench)
        numbers = out.tolist()
        self._energy_known = converged and taken is AT_ONCE and not (request.compliance or self.model.n_state)
        alarm = stepper.alarm(self._next, self.times) if converged else ""
        return Advanced(
            (correction or request).header,
            status,
            wrench,
            numbers[kernel.KINETIC],
            numbers[kernel.STRAIN],
            numbers[kernel.GRAVITY],
            numbers[kernel.TOOL_WORK],
            out[kernel.MOMENTUM : kernel.MOMENTUM + 3],
            out[kernel.ANGULAR : kernel.ANGULAR + 3],
            out[kernel.LOWEST : kernel.LOWEST + 6].reshape(2, 3),
            time.perf_counter() - began,
            found.distance.copy() if reduction is None else found.distance[reduction.cell],
            self._coupled(request, numbers[kernel.SEAM_WORK], converged),
            extras={
                Figure.CONTACTS: numbers[kernel.N_CONTACTS],
                Figure.PENETRATION: numbers[kernel.PENETRATION],
                Figure.SLIP: numbers[kernel.SLIPPED],
                Figure.ITERATIONS: numbers[kernel.N_ITERATIONS],
                Figure.SUBSTEPS: float(taken.n_accepted),
                **seldom(self.model, stepper, self.committed, self._next, taken, self.times),
                **({Figure.FASTEST: fastest(self._next.v)} if self._sleeps else {}),
            },
            why=why,
            alarms={Detail.INSIDE_OUT: alarm} if alarm else {},
        )

    def _coupled(self, request: Advance, work: float, converged: bool) -> Coupled:
        """What a step, in which their force did this work [J], did at the coupling nodes."""
        stepper, now = self.stepper, self._now
        correctable, asked = converged and stepper.correctable, request.coupling_asked
        if not len(self.model.seam):
            return _ALONE[correctable]
        return Coupled(
            x=stepper.result.seam_x.copy(),
            v=now.v[self._region.seam] if len(request.coupling_force_start) else _FREE,
            force=stepper.work.seam_actual.copy(),
            work=work,
            compliance=stepper.result.compliance.copy() if request.compliance and converged and self._last else _NONE,
            root=stepper.new_compliance_root(request.repeat_compliance, asked) if correctable else _NONE,
            correctable=correctable,
            sums=sums_of(self.parameters.mass, now.x, now.v),
        )

    def correct(self, request: Correct) -> Advanced:
        """Move the tentative step on by its linear answer to a force on the seam; see `kernels.linear_answer`."""
        began, stepper = time.perf_counter(), self.stepper
        if not (self._tentative and stepper.correctable):
            raise ValueError("this step cannot be corrected: only one that implicit Euler solved at once can")
        problem = problem_of_correction(request, len(self._region.seam))
        if problem:
            raise ValueError(problem)
        stepper.correct(self.committed, self._next, self._request.dt, request, self._tools)
        return self._reply(self._request, Status.CONVERGED, "", began, request)

    def begin_tape(self, tools: ToolSet, dt: float) -> FemTape:
        """Keeps a run from here, in steps of dt [s], between tools that never turn; see `differentiable`."""
        return FemTape(self, self.stepper.scheme, with_round_edges(tools, self._body), dt)

    @property
    def augmented(self) -> list[Augmentation]:
        """Solutions of the last step before its end, where it was solved again as points were in deep."""
        work, found = self.stepper.work, []
        for number in range(int(work.augmentations[0])):
            state = self._now.copy()
            state.x[:] = work.augmented_x[number]
            found.append(Augmentation(state, work.augmented_force[number].copy()))
        return found

    @property
    def capabilities(self) -> Capabilities:
        """What it can do for its region."""
        at_once = self.stepper.at_once
        return Capabilities(True, at_once, at_once, 1, True, True, 0.0)

    def commit(self) -> None:
        """Accept the tentative step; does nothing if there is none."""
        if self._tentative:
            self.committed, self._next = self._next, self.committed
            self._tentative = False

    def discard(self) -> None:
        """Take the tentative step back; does nothing if there is none."""
        self._tentative = self._energy_known = False

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Fields of the last advanced step."""
        work = self.stepper.work
        if not self._energy_known:
            self._look()
            strain_energy(self._now.x, self.model, self.parameters, work)
        energy = work.energy.copy() if self._reduction is None else work.energy[self._reduction.cell]
        return self._reader.read(request_header, self.state, energy, self._scratch, indicators, own)

    @property
    def _scratch(self) -> Work:
        """Of the whole region."""
        return self.stepper.work if self._reduction is None else self._scratch_of_whole

    @cached_property
    def _scratch_of_whole(self) -> Work:
        return build_work(*self.tables.whole, self._n_tools)

    @cached_property
    def _reader(self) -> FieldReader:
        return FieldReader(self._body, self._region, self.tables, self._models.pbd.hourglass)

    def snapshot(self) -> bytes:
        """Commit, drop the factor and the first guess, and return the state."""
        self.commit()
        whole = self._extended(self.committed)
        self._take_over(whole)  # as who restores it does, to the last bit
        self._forget()
        past = np.array([whole.past, float(whole.level)])
        more = [whole.material, whole.dissipated] if self.model.n_state else []
        return pack(whole.x, whole.v, whole.contact, whole.history, past, whole.share, whole.passed, *more)

    def restore(self, state: bytes) -> None:
        """Replace the state by one that `snapshot` of an equal region returned."""
        n_history, n_points = self.committed.history.shape[0], len(self.tables.whole.model.point_face)
        place, contact_shape = (self.n_nodes, 3), (n_points, self._n_tools, N_STATE)
        shapes = [place, place, contact_shape, (n_history, *place), (2,), (_n_blending(self.tables.whole.model),), (1,)]
        shapes += [self._remembered, (1,)] if self.model.n_state else []
        x, v, contact, history, past, share, passed, *others = unpack(state, *shapes)
        material, lost = others or (np.zeros(self._remembered), np.zeros(1))
        times = float(past[0]), int(past[1])
        self._take_over(FemState(x, v, contact, history, *times, material, lost, share, passed))
        self._forget()

    def _forget(self) -> None:
        self._tentative = self._energy_known = False
        self._step = None
        self.stepper.forget()


def _n_blending(model: FemModel) -> int:
    """Cells whose share of full quadrature is remembered."""
    return len(model.cell_nodes) if model.blends else 0
