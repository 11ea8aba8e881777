"""The FEM participant's solver: what a request asks of one region, and the answer; how a step is taken is in `step`."""

from __future__ import annotations

import time

import numpy as np

from softseam_protocol.messages import Advance, Advanced, BodyState, Fields, Header
from softseam_protocol.scene import Scene
from softseam_services.body.body import Body, Floats, Region
from softseam_services.fem.face_forces import taken_over
from softseam_services.fem.field_reader import FieldReader
from softseam_services.fem.kernels import step as kernel
from softseam_services.fem.kernels.elements import strain_energy
from softseam_services.fem.kernels.newton import CONVERGED
from softseam_services.fem.model import Tables, build_model
from softseam_services.fem.snapshot import pack, unpack
from softseam_services.fem.state import FemState
from softseam_services.fem.step import Stepper
from softseam_services.fem.tool_motion import at_rest, moved
from softseam_services.request_check import problem_of, problem_of_anchor
from softseam_services.tools.tool_set import ToolSet

_NONE, _FREE = np.zeros((0, 0)), np.zeros((0, 3))
"""no matrix of the seam, and no vectors"""


class FemSolver:
    """One region computed with finite elements; a `participant.Solver`."""

    def __init__(
        self,
        scene: Scene,
        body: Body,
        region: Region,
        tools: ToolSet,
        state: BodyState | None = None,
        tables: Tables | None = None,
    ) -> None:
        """state: of the whole body, taken over at a region switch; None is rest with the initial velocities.
        tables: of this region, where they are built already.

        Neither has an integrator's history, so one that needs it begins with a step of midpoint.
        """
        self._region, self._n_tools = region, len(tools.names)
        self.tables = tables or build_model(body, region, tools, scene.models.fem)
        self._model, tree = self.tables
        self._stepper = Stepper(scene.models.fem, self._model, tree, self._n_tools, body.material.retardation_time)
        self._reader = FieldReader(body, region, self._model, scene.models)
        if state is None:
            x, v = body.x_rest[region.nodes], body.v_initial[region.nodes]
            force, tool = np.zeros((len(region.points), 3)), np.full(len(region.points), -1, dtype=np.int32)
        else:
            x, v = state.x[region.nodes], state.v[region.nodes]
            force, tool = state.contact_force[region.points], state.contact_tool[region.points]
        self._committed = FemState(
            np.ascontiguousarray(x, dtype=np.float64),
            np.ascontiguousarray(v, dtype=np.float64),
            taken_over(self._model, x, force, tool, self._n_tools),
            np.zeros((self._stepper.scheme.n_history, len(region.nodes), 3)),
        )
        self._next = self._committed.copy()
        self._tentative = False
        self._step: tuple[int, int] | None = None
        self._dt = 0.0  # of the last advance [s]
        self._whole = at_rest(tools)

    @property
    def n_nodes(self) -> int:
        return len(self._region.nodes)

    @property
    def factorisations(self) -> int:
        """Matrices factored since the state was last set."""
        return self._stepper.factorisations

    @property
    def state(self) -> FemState:
        """State at the end of the last advanced step, or the committed one."""
        return self._next if self._tentative else self._committed

    @property
    def strain(self) -> float:
        """Strain energy of the last advanced step [J]."""
        return float(strain_energy(self.state.x, self._model, self._stepper.work))

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
        stepper, now, end = self._stepper, self._committed, self._next
        problem = problem_of(request, self._n_tools, len(self._region.seam))
        problem = problem or problem_of_anchor(request, len(self._region.seam), stepper.knows_stiffness)
        if problem:
            return self._failed(request, problem, began)
        if not again:
            np.multiply(now.v, request.dt, out=end.x)
            end.x += now.x
        stepper.couple(request.seam_anchor, request.seam_stiffness)
        whole = moved(self._whole, request.tools)
        status = stepper.take(now, end, request, whole)
        if status == CONVERGED and request.compliance and not stepper.by_error:
            status = stepper.derive(now, end, request, whole)
        if status != CONVERGED:
            return self._failed(request, stepper.why(status, self._region.cells), began)
        self._tentative = True
        return self._reply(request, "converged", began)

    def _failed(self, request: Advance, text: str, began: float) -> Advanced:
        now, end = self._committed, self._next
        end.x[:], end.v[:], end.contact[:] = now.x, now.v, now.contact
        end.history[:], end.past, end.level = now.history, now.past, now.level
        self._tentative = False
        self._stepper.fail(now)
        return self._reply(request, text, began)

    def _reply(self, request: Advance, status: str, began: float) -> Advanced:
        stepper = self._stepper
        out, numbers, taken = stepper.out, stepper.out.tolist(), stepper.taken
        whole = request.compliance and status == "converged"
        settles = status == "converged" and stepper.settles
        return Advanced(
            request.header,
            status,
            stepper.seam_x.copy(),
            stepper.compliance.copy() if whole else _NONE,
            stepper.wrench.copy(),
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
            stepper.distance.copy(),
            out[kernel.LOWEST : kernel.LOWEST + 6].copy().reshape(2, 3),
            stepper.work.seam_actual.copy(),
            n_crushed=int(stepper.work.mixed[0]),
            n_substeps=taken.n_accepted,
            n_rejected=taken.n_rejected,
            step_error=taken.error,
            seam_v=self.state.v[self._region.seam] if len(request.seam_force_start) else _FREE,
            settles=settles,
            seam_yield_root=stepper.news_of_yield() if settles else _NONE,
        )

    def settle(self, force: Floats) -> None:
        """Move the tentative step on by its linear answer to a force (s, 3) [N] on the seam; see `kernels.settle`."""
        if not (self._tentative and self._stepper.settles) or force.shape != (len(self._region.seam), 3):
            raise ValueError(
                "this step cannot be settled: only one that was solved with a seam anchor, and at once, can"
            )
        self._stepper.settle(force, self._dt, self._next)

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
        return self._reader.read(request_header, self.state, self._stepper.work, indicators, own)

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
        self._stepper.forget()
