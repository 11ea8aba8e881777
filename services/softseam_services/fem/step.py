"""One step of a region, in whichever way gets through it.

At once, as a rule; where an error in time is bounded, in substeps that keep it (`substeps`). Where Newton's method does
not converge the step is tried again with a new factor, then carefully, then in 2, 4 ... 32 equal parts.
"""

from dataclasses import replace

import numpy as np

from softseam_protocol.messages.participant import Correct
from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Floats, Ints
from softseam_services.body.turning import Turning, with_change

from . import substeps
from .answers import root_of, root_of_all
from .failures import alarm, why
from .inputs import AT_ONCE, NO_PUSH, Inputs, NewtonSettings, StepInputs, StepResult, Tools, build_result, part_of
from .integrators.scheme import IMPLICIT_EULER, STATIC, SYMPLECTIC_EULER
from .integrators.static import raised
from .integrators.table import build_scheme, forces_at, velocity_gain, works_at
from .kernels import step as kernel
from .kernels.contact import force_moment
from .kernels.elements import remember
from .kernels.newton import CONVERGED, FACTORED, N_FACTORS, STALLED
from .model import FemModel
from .parameters import FemParameters
from .state import FemState
from .turning import begins, free_to_turn
from .work import build_work

CAREFUL_ITERATIONS = 200
# A careful step that takes longer is sooner done in parts.
_CAREFUL_AT_FIRST = 60
_MOST_HALVINGS = 5
# Of the error that a substep may make in time, the share that Newton's method may leave.
_UNSEEN = 1e-2
_NOWHERE = np.zeros(0, dtype=np.int32)
_SUMMED = [kernel.TOOL_WORK, kernel.SEAM_WORK, kernel.N_ITERATIONS]


class Stepper:
    """Takes steps of one region, and keeps what a step works in: scratch, the factor, what the other side sent."""

    def __init__(self, spec: FemSpec, model: FemModel, parameters: FemParameters, n_tools: int) -> None:
        self._spec, self._n_tools = spec, n_tools
        self._parts: substeps.Substeps | None = None
        self._told, self._told_of = -1.0, _NOWHERE  # factor whose answers were last reported, and of which nodes
        self._turn, self.given = np.zeros(0), 0.0
        """to a rotation in the last step, beyond the work of contact along the chords of ways [J]"""
        self._moment = np.zeros((3, 3))
        self.knows_impedance = False
        """whether the other side's stiffness at the seam was ever received"""
        self._take_up(model, parameters)

    def _take_up(self, model: FemModel, parameters: FemParameters) -> None:
        """Go on with this structure and these numbers: with scratch of their sizes, and without a factor."""
        spec, n_tools = self._spec, self._n_tools
        self._model, self._parameters = model, parameters
        self.work = build_work(model, parameters, n_tools)
        self.scheme = build_scheme(spec, model, parameters, self.work, n_tools > 0)
        self._tolerance = spec.tolerance * parameters.edge
        self._turning = free_to_turn(self.scheme.kind, model, parameters)
        # substeps alternate between two lengths, of which each keeps a factor of its own
        self._both = [self.work]
        self._spare: list[FemState] = []
        if spec.step_error is not None:
            self._bound = spec.step_error * parameters.edge
            self._tolerance = min(self._tolerance, _UNSEEN * self._bound)
            self._both.append(build_work(model, parameters, n_tools))
        self._settings: dict[tuple[int, bool], NewtonSettings] = {}
        self._inputs: Inputs | None = None
        self.result = build_result(len(model.cell_nodes), len(model.seam), n_tools, kernel.N_OUT)
        self.forget()

    def step(
        self,
        model: FemModel,
        parameters: FemParameters,
        state: FemState,
        inputs: StepInputs,
        dt: float,
        end: FemState | None = None,
    ) -> tuple[FemState, StepResult]:
        """The state at the end of a step of length dt [s] from `state`, which stays as it is, and what it came to.

        Other parameters than in the last step, or another structure, cost new scratch and a new factor.
        end: a state to write into, whose x is the first guess; where None, a new one, which flies on at first.
        """
        if model is not self._model or parameters is not self._parameters:
            self._take_up(model, parameters)
        if end is None:
            end = state.copy()
            end.x += dt * state.v
        self.given, self._turn = 0.0, inputs.turn
        if len(inputs.turn):
            state = replace(state, v=with_change(inputs.turn, state.x, state.v))
        if inputs.parts > 1 and not self.by_error:
            status = self._take_parts(state, end, inputs, dt)
        else:
            self._couple(inputs.seam_target, inputs.seam_impedance)
            status = self._take(state, end, inputs, dt)
        return end, StepResult(status, self.result, self._parts or AT_ONCE)

    @property
    def factorisations(self) -> int:
        """Matrices factored since the last `forget`."""
        return int(sum(work.memo[N_FACTORS] for work in self._both))

    @property
    def by_error(self) -> bool:
        """Whether steps are taken in substeps that keep an error in time."""
        return self._spec.step_error is not None

    def _couple(self, anchor: Floats, stiffness: Floats) -> None:
        """Take over how the other side resists at the seam, or that it does not; as of `Advance`."""
        work, coupled = self.work, len(anchor) > 0
        same = coupled == bool(work.seam_coupled[0])
        if coupled:
            work.seam_target[:] = anchor
            if stiffness.size and not np.array_equal(stiffness, work.seam_impedance):
                work.seam_impedance[:] = stiffness
                same = False
            self.knows_impedance = True
        if not same:
            self.work.memo[FACTORED] = 0.0
        work.seam_coupled[0] = coupled

    def _take(self, now: FemState, end: FemState, inputs: StepInputs, dt: float) -> int:
        """The step from `now` into `end`, whose x is the first guess; returns a status of `kernels.newton`."""
        self._parts = None
        if self.by_error:
            return self._adapt(now, end, inputs, dt)
        force, most = self._seam_force(inputs, now), self._spec.iterations
        status = self._advance(now, end, dt, force, inputs.tools, most, False)
        if status == STALLED:
            # slow, but not lost: points that slip on the bound of friction; go on with a new factor
            self.work.memo[FACTORED] = 0.0
            status = self._advance(now, end, dt, force, inputs.tools, most, False)
        if status != CONVERGED and self.scheme.kind != SYMPLECTIC_EULER:
            status = self._insist(now, end, inputs, dt)
        if status == CONVERGED and self._parts is None:
            self.result.out[kernel.SEAM_WORK] = self._seam_work(inputs, now, end)
        return status

    def _take_parts(self, now: FemState, end: FemState, inputs: StepInputs, dt: float) -> int:
        """The step as so many shorter ones; returns a status of `kernels.newton`."""
        begin, sums, n_accepted = now.copy(), np.zeros(3), 0
        self._couple(inputs.seam_target[:0], inputs.seam_impedance)
        for number in range(inputs.parts):
            end.x[:] = begin.x + dt / inputs.parts * begin.v
            status = self._take(begin, end, inputs.part(number), dt / inputs.parts)
            if status != CONVERGED:
                break
            sums += self.result.out[_SUMMED]
            n_accepted += self._parts.n_accepted if self._parts else 1
            begin = end.copy()
        self.result.out[_SUMMED] = sums
        self._parts = substeps.Substeps(n_accepted=n_accepted)
        return status

    def derive(self, now: FemState, end: FemState, inputs: StepInputs, dt: float) -> int:
        """The compliance at the end of the step that was taken, into the result; returns a status of the kernels."""
        status = self._advance(now, end, dt, inputs.seam_force, inputs.tools, 0, False, task=kernel.DERIVE)
        if status == CONVERGED and len(inputs.seam_force_start):
            at = forces_at(self.scheme, now.past)
            compliance = self.result.compliance
            compliance *= at * velocity_gain(self.scheme, dt, now.past)
        return status

    def alarm(self, end: FemState, times: int) -> str:
        """What is wrong with the step that was taken, and was not noticed within it; '' where nothing is.

        Only a step that was hard, so that it was cut, is doubted.
        """
        return "" if self._parts is None else alarm(end.x, self._model, self.work, times)

    def why(self, status: int, cells: Ints) -> str:
        """What to say of a step that failed; cells (c,) are global ids."""
        return why(status, self.work.memo, cells, divided=self.scheme.kind != SYMPLECTIC_EULER)

    def fail(self, now: FemState) -> None:
        """The step failed: it came to nothing, and the body is where it was."""
        self.result.wrench[:] = 0.0
        self.result.out[:] = 0.0
        self.result.seam_x[:] = now.x[self._model.seam]
        self._parts, self.given = None, 0.0
        for work in self._both:
            work.memo[FACTORED] = 0.0

    def forget(self) -> None:
        """Drop the factors, and what the other side sent."""
        self.knows_impedance = False
        self._told, self._told_of = -1.0, _NOWHERE
        for work in self._both:
            work.memo[:] = 0.0
            work.factored_state[:] = 0

    # ---- what the factor at hand says of the seam

    @property
    def at_once(self) -> bool:
        """Whether steps are taken by implicit Euler, in one, with a factor: their linear answers are known then."""
        return bool(self.scheme.kind == IMPLICIT_EULER and not self.by_error)

    @property
    def correctable(self) -> bool:
        """Whether the last step has a factor that says how it would answer a force on the seam."""
        return bool(self.at_once and self._parts is None and self.work.memo[FACTORED])

    def new_compliance_root(self, anyway: bool, asked: Ints) -> Floats:
        """A root of d(coupling_x)/d(coupling_force) of the factor at hand (3a, r), of nodes at these places among the
        seam's (a,), or of all where these are eliminated last; empty if sent, unless `anyway`."""
        last = self._model.tree.seam_front >= 0
        if not last and not len(asked):
            return np.zeros((0, 0))
        if self._told == self.work.memo[N_FACTORS] and not anyway and (last or np.isin(asked, self._told_of).all()):
            return np.zeros((0, 0))
        self._told, self._told_of = float(self.work.memo[N_FACTORS]), asked
        return root_of_all(self._model, self.work) if last else root_of(self._model, self.work, asked)

    def correct(self, now: FemState, end: FemState, dt: float, request: Correct, tools: Tools) -> None:
        """Move the step of length dt [s] that led to `end` on by its linear answer."""
        self._advance(now, end, dt, request.force, tools, 0, False, task=kernel.CORRECT, push=request.push)

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
        push: Floats = NO_PUSH,
    ) -> int:
        """One step, or one of the parts left of it, from `now` into `end`, whose x is the first guess.

        task, push: as of `kernels.step.advance`.

        Returns a status of `kernels.newton`.
        """
        static = self.scheme.kind == STATIC
        past = raised(now.past, parts_left) if static and task == kernel.STEP else now.past
        if self._model.n_state:
            self.look(now, dt)
        inputs = self._inputs_of(dt, tools, past, pace)
        inputs.seam_force[:] = force
        if task == kernel.CORRECT:
            inputs.push[:] = push
        turning = self._turns(now, dt, pace) if task == kernel.STEP else None
        begun = now.arrays
        if turning is not None and self.scheme.kind == IMPLICIT_EULER:
            flies = np.array_equal(end.x, now.x + dt * now.v)
            begun = begun._replace(v=turning.start(now.x, now.v))
            if flies:
                end.x[:] = now.x + dt * begun.v
        status: int = kernel.advance(
            *(self.scheme, self._model, self._parameters, begun, end.arrays),
            *(inputs, self._newton(most, careful), self.work, self.result, task),
        )
        if task == kernel.STEP:
            end.past = past if static else dt
        if turning is not None and status == CONVERGED and not (self.scheme.n_history and self.result.wrench.any()):
            self._give_back(turning, end, tools)
        self._remember(status, task, now, end)
        return status

    def _turns(self, now: FemState, dt: float, pace: float) -> Turning | None:
        """What gives a rotation back in a step of dt [s]; None where it is too slow, or a part's step is cut."""
        turning = self._turning
        if turning is None or (len(self._model.seam) and (pace != 1.0 or not len(self._turn))):
            return None
        if len(self._model.seam):
            turning.of_whole(self._turn, dt)
            return turning
        return turning if begins(turning, self.scheme, now, dt) else None

    def _give_back(self, turning: Turning, end: FemState, tools: Tools) -> None:
        """Velocities, and what is reported of them, at the end of a step in which the body turned."""
        if len(self._model.seam):
            turning.end_of_part(end.x, end.v)
        else:
            turning.end(end.x, end.v, self.result.wrench, tools.position_next)
        out = self.result.out
        force_moment(end.contact, end.x, self._model, self._parameters, turning.centre, self._moment)
        self.given += turning.given(self._moment)
        out[kernel.KINETIC], out[kernel.MOMENTUM : kernel.MOMENTUM + 3] = turning.kinetic(end.v), turning.mass @ end.v
        out[kernel.ANGULAR : kernel.ANGULAR + 3] = turning.angular(end.x, end.v)

    def _inputs_of(self, dt: float, tools: Tools, past: float, pace: float) -> Inputs:
        """With forces to be filled in; one record as long as nothing else changes, since making it takes its time."""
        kept = self._inputs
        if kept is None or kept.tools is not tools or (kept.dt, kept.past, kept.pace) != (dt, past, pace):
            forces = np.zeros((2, len(self._model.seam), 3))
            kept = self._inputs = Inputs(dt, tools, forces[0], past, pace, forces[1])
        return kept

    def _newton(self, most: int, careful: bool) -> NewtonSettings:
        """So many iterations at most, careful or not."""
        key = most, careful
        if key not in self._settings:
            self._settings[key] = NewtonSettings(self._tolerance, most, careful)
        return self._settings[key]

    def look(self, begin: FemState, dt: float = 0.0) -> None:
        """What the material remembers as a step of length dt begins; with 0, forces and energies are of that state."""
        self.work.material_state[:], self.work.material_dt[0] = begin.material, dt

    def _remember(self, status: int, task: int, now: FemState, end: FemState) -> None:
        """What the material remembers at the end of a step that was solved, and what it dissipated by then."""
        if self._model.n_state and status == CONVERGED and task != kernel.DERIVE:
            lost = remember(end.x, self._model, self._parameters, self.work, end.material)
            end.dissipated[0] = now.dissipated[0] + lost

    def _adapt(self, now: FemState, end: FemState, inputs: StepInputs, length: float) -> int:
        """The step in substeps as long as the error in time allows; returns a status of `kernels.newton`."""

        def take(begin: FemState, end: FemState, level: int, place: int) -> tuple[int, float, float]:
            self.work = self._both[level % 2]
            share = 0.5**level
            dt, tools = length * share, part_of(inputs.tools, place * share, (place + 1) * share)
            iterations = 0.0
            for careful in (False, True) if level >= substeps.DEEPEST else (False,):
                most = CAREFUL_ITERATIONS if careful else self._spec.iterations
                status = self._advance(begin, end, dt, inputs.seam_force, tools, most, careful, pace=share)
                iterations += self.result.out[kernel.N_ITERATIONS]
                if status == CONVERGED:
                    break
                self.work.memo[FACTORED] = 0.0
                end.x[:] = begin.x
            return status, float(self.result.out[kernel.TOOL_WORK]), iterations

        self._spare = self._spare or [now.copy() for _ in range(4)]
        report = substeps.advance(take, self.scheme, now, end, self._spare, length, self._bound)
        self.result.out[kernel.TOOL_WORK], self.result.out[kernel.N_ITERATIONS] = report.tool_work, report.iterations
        self._parts, self.given = report, 0.0  # of pieces that were rejected, too, it was
        return report.status

    def _insist(self, now: FemState, end: FemState, inputs: StepInputs, length: float) -> int:
        """What is left when the plain step failed: a careful one from `now`, then 2, 4 ... 32 parts."""
        status, given = STALLED, self.given
        for halvings in range(_MOST_HALVINGS + 1):
            pieces = 1 << halvings
            begin, self.given = now.copy(), given
            tool_work = seam_work = iterations = 0.0
            for piece in range(pieces):
                tools = part_of(inputs.tools, piece / pieces, (piece + 1) / pieces)
                self.work.seam_coupled[0] &= pieces == 1  # over parts of a step the seam force is constant
                dt = length / pieces
                force = self._seam_force(inputs, begin, piece, pieces)
                for careful in (False, True):
                    if careful or pieces > 1:
                        self.work.memo[FACTORED] = 0.0
                        end.x[:] = begin.x
                        most = CAREFUL_ITERATIONS if pieces > 1 else min(_CAREFUL_AT_FIRST, CAREFUL_ITERATIONS)
                        most = most if careful else self._spec.iterations
                        status = self._advance(
                            begin, end, dt, force, tools, most, careful, pieces - piece, 1.0 / pieces
                        )
                        iterations += self.result.out[kernel.N_ITERATIONS]
                        if status == CONVERGED:
                            break
                if status != CONVERGED:
                    break
                tool_work += self.result.out[kernel.TOOL_WORK]
                seam_work += self._seam_work(inputs, begin, end, pieces)
                begin = end.copy()
            if status == CONVERGED:
                self.result.out[kernel.TOOL_WORK], self.result.out[kernel.SEAM_WORK] = tool_work, seam_work
                self.result.out[kernel.N_ITERATIONS] = iterations
                self._parts = substeps.Substeps(n_accepted=pieces)
                break
        self.work.memo[FACTORED] = 0.0
        return status

    def _seam_force(self, inputs: StepInputs, begin: FemState, part: int = 0, parts: int = 1) -> Floats:
        """Force on the seam over one of equal parts of the step, where the integrator takes it (s, 3) [N]."""
        start = inputs.seam_force_start
        if not len(start):
            return inputs.seam_force
        at = (part + forces_at(self.scheme, begin.past)) / parts
        return np.asarray(start + at * (inputs.seam_force - start))

    def _seam_work(self, inputs: StepInputs, begin: FemState, end: FemState, parts: int = 1) -> float:
        """Work of the seam force in the last of equal parts of the step, which led from `begin` to `end` [J]."""
        work = float(self.result.out[kernel.SEAM_WORK])  # of the force where it acts
        if len(inputs.seam_force_start):
            later = works_at(self.scheme, begin.past) - forces_at(self.scheme, begin.past)
            seam, growth = self._model.seam, (inputs.seam_force - inputs.seam_force_start) / parts
            work += later * float(np.sum(growth * (end.x[seam] - begin.x[seam])))
        return work
