"""The PBD participant's solver: what a request asks of one region, and the answer; how a step is taken is in `step`."""

import time

import numpy as np

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Figure
from softseam_protocol.messages.participant import Advance, Advanced, BodyState, Capabilities, Correct, Coupled, Fields
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Floats, Region
from softseam_services.body.kernels.bounds import bound_points
from softseam_services.body.turning import sums_of
from softseam_services.request_check import problem_of, problem_of_correction
from softseam_services.tools.tool_set import ToolSet

from . import watch
from .compliance import SeamProbe, Ways, no_ways
from .field_reader import FieldReader
from .kernels import summary as k
from .kernels import trust
from .kernels.linear_correction import correct_linearly
from .model import PbdModel, build_model
from .parameters import build_parameters
from .records import PbdState, decode_state, encode_state, new_state
from .step import NO_FORCES, NO_TURN, StepInputs, StepResult, StepScratch, leap_ahead, start_state, stay, step


class PbdSolver:
    """Block XPBD, or leapfrog on the same blocks, on one region. Implements `Solver`."""

    def __init__(
        self,
        scene: Scene,
        body: Body,
        region: Region,
        tools: ToolSet,
        state: BodyState | None = None,
        model: PbdModel | None = None,
    ) -> None:
        """model: the region's structure, where it is known"""
        spec = scene.models.pbd
        self.model = model = build_model(body, region, tools, spec) if model is None else model
        self.parameters = parameters = build_parameters(model, body, region, tools, spec)
        self._body, self._region = body, region
        self._scratch = StepScratch(model, parameters, scene.step)
        self._reader = FieldReader(model, body, region, self._scratch.ws, self._scratch.arrays.xw)
        self.substeps = self._scratch.planned
        sizes = model.n_nodes, model.blocks.n_batches, model.n_points, model.n_tools
        self.committed = new_state(*sizes, parameters.blocks.n_state)
        """that steps begin with"""
        self._tentative = False
        self._taken: StepResult  # what became of it
        self._probe: SeamProbe | None = None
        self._probed = np.zeros(0)  # the state that was probed, see `_compliance`; empty: none
        self._ways = no_ways()  # what came of it, see `SeamProbe.compliance`; empty: not found yet
        self._to_plan = False  # whether the tentative step was taken in one attempt
        start_state(model, parameters, body, region, state, self._scratch, self.committed)
        if parameters.explicit:
            self._load_kernel()

    def _load_kernel(self) -> None:
        """Compile or load the explicit step before anybody waits for one: a substep that leaves no trace."""
        np.copyto(self._scratch.next.buffer, self.committed.buffer)
        leap_ahead(self.model, self.parameters, 1e-9, 1, self._scratch)
        self._scratch.outputs.result[:] = 0.0

    @property
    def strain(self) -> float:
        """Strain energy of the last committed step [J]."""
        return float(self.committed.monitor[trust.STRAIN])

    @property
    def moving(self) -> tuple[float, float]:
        """Kinetic energy, and that in gravity, of the last committed step [J]."""
        return float(self.committed.monitor[trust.KINETIC]), float(self.committed.monitor[trust.GRAVITY])

    @property
    def state(self) -> PbdState:
        """Of the last advanced step, as long as it is not taken back."""
        return self._scratch.next if self._tentative else self.committed

    @property
    def positions(self) -> Floats:
        """Positions of the region's nodes at the end of the last committed step (n, 3) [m]."""
        return self.committed.x

    def advance(self, request: Advance) -> Advanced:
        start = time.perf_counter()
        refused = problem_of(request, self.model.n_tools, len(self._region.seam))
        if not refused and len(request.coupling_target):
            refused = watch.Fault.ANCHOR.text
        if refused:
            self._taken = stay(self.parameters, self.committed, self._scratch)
        else:
            inputs = StepInputs(request.tools, request.coupling_force, request.coupling_force_start, request.turn)
            _, self._taken = step(self.model, self.parameters, self.committed, inputs, request.dt, self._scratch)
        self._tentative, self._to_plan = True, self._taken.to_plan
        compliance = np.zeros((0, 0))
        if request.compliance and not refused:
            compliance = self._compliance(request)
        ramp = len(request.coupling_force_start) > 0
        seam_v = self._scratch.next.v.take(self._region.seam, axis=0) if ramp else NO_FORCES
        return self._reply(request.header, refused or self._taken.fault.why, compliance, seam_v, start)

    def _reply(self, header: Header, why: str, compliance: Floats, seam_v: Floats, start: float) -> Advanced:
        """What became of the last request."""
        work, taken = self._scratch.next, self._taken
        result, numbers = taken.figures.copy(), taken.figures.tolist()
        if self._body.cut:
            points = self.model.indptr, self.model.node, self.parameters.arrays.weight
            bound_points(self.model.n_surface, *points, work.x, result[k.BOUNDS : k.BOUNDS + 6])
        return Advanced(
            header,
            taken.fault.status,
            taken.wrench.copy(),
            numbers[k.KINETIC],
            numbers[k.STRAIN],
            numbers[k.GRAVITY],
            numbers[k.TOOL_WORK],
            result[k.MOMENTUM : k.MOMENTUM + 3],
            result[k.ANGULAR : k.ANGULAR + 3],
            result[k.BOUNDS : k.BOUNDS + 6].reshape(2, 3),
            time.perf_counter() - start,
            taken.distance.copy(),
            Coupled(
                x=work.x.take(self._region.seam, axis=0),
                v=seam_v,
                work=numbers[k.SEAM_WORK],
                compliance=compliance,
                correctable=self._correctable(),
                sums=sums_of(self.parameters.arrays.mass, work.x, work.v) if len(self._region.seam) else NO_TURN,
            ),
            extras={
                Figure.CONTACTS: numbers[k.N_CONTACTS],
                Figure.PENETRATION: numbers[k.PENETRATION],
                Figure.SLIP: numbers[k.SLIP],
                Figure.ITERATIONS: float(taken.sweeps),
                Figure.SUBSTEPS: float(taken.n_substeps),
                Figure.RESIDUAL: numbers[k.RESIDUAL],
                Figure.FASTEST: numbers[k.FASTEST],
                Figure.DISSIPATED: taken.dissipated,
            },
            why=why,
            alarms=dict(taken.notice),
        )

    def _compliance(self, request: Advance) -> Floats:
        """Probe the committed state, and keep what was probed, so that a restored participant can probe it again."""
        committed, tools, ramp = self.committed, request.tools, len(request.coupling_force_start) > 0
        parts = (committed.x, committed.force, committed.lean, tools.position, tools.orientation, committed.memory)
        self._probed = np.concatenate([[request.dt], *(part.ravel() for part in parts)])
        compliance, self._ways = self._probe_again(ramp)
        if ramp:
            self._probed, self._ways = np.zeros(0), no_ways()  # steps of such forces are not settled
        return compliance

    def _probe_for(self, dt: float) -> SeamProbe:
        """The probe of steps of dt [s]: the one at hand, or a new one."""
        known = self._probe
        return known if known is not None and known.dt == dt else SeamProbe(self.model, self.parameters, dt)

    def _probe_again(self, ramp: bool = False) -> tuple[Floats, Ways]:
        """Compliance of the seam and ways of the nodes in the state that is in `_probed`."""
        model = self.model
        self._probe = self._probe_for(float(self._probed[0]))
        of_points = model.n_points, model.n_tools
        of_tools, remembered = ((model.n_tools, 3), (model.n_tools, 4)), self.committed.memory.shape
        shapes = ((model.n_nodes, 3), (*of_points, 3), (*of_points, 2), *of_tools, remembered)
        ends = np.cumsum([1, *(int(np.prod(shape)) for shape in shapes)])
        x, force, lean, position, orientation, memory = (
            self._probed[ends[at] : ends[at + 1]].reshape(shape) for at, shape in enumerate(shapes)
        )
        self.parameters.blocks.hold(memory, self._probe.dt)
        return self._probe.compliance(x, force, lean, position, orientation, ramp)

    def _correctable(self) -> bool:
        """Whether the tentative step is one that the probe speaks of."""
        planned = self._to_plan and not self.parameters.explicit and len(self._probed) > 0
        return bool(
            planned and self._probe is not None and self._probed[0] == self._scratch.dt and self._probe.keeps_ways
        )

    def correct(self, request: Correct) -> Advanced:
        """Move the tentative step on by its linear answer to a force on the seam, as the probe found it."""
        began = time.perf_counter()
        if not (self._tentative and self._correctable()):
            raise ValueError("this step cannot be corrected: only one as long as the probed one, taken to plan, can")
        problem = problem_of_correction(request, len(self._region.seam))
        if problem:
            raise ValueError(problem)
        if len(self._ways) == 0:
            self._ways = self._probe_again()[1]
        probe, work, scratch, seam = self._probe, self._scratch.next, self._scratch, self._region.seam
        assert probe is not None
        self.parameters.blocks.hold(work.memory)
        result = self._taken.figures
        correct_linearly(
            *(self.model.arrays, self.parameters.arrays, work, self.model.seam_force(request.push)),
            *(probe.ids, probe.beyond, self._ways, np.empty(self._ways.shape[1:]), scratch.arrays, result, scratch.ws),
        )
        watch.settle(work.monitor, result)
        moved = work.x.take(seam, axis=0) - self.committed.x.take(seam, axis=0)
        result[k.SEAM_WORK] = float(np.vdot(request.force, moved))
        return self._reply(request.header, self._taken.fault.why, np.zeros((0, 0)), NO_FORCES, began)

    @property
    def capabilities(self) -> Capabilities:
        """What it can do for its region."""
        return Capabilities(True, not self.parameters.explicit, False, self.substeps, True, True, 0.0)

    def commit(self) -> None:
        """Accept the tentative step; does nothing if there is none."""
        if self._tentative:
            self.committed, self._scratch.next = self._scratch.next, self.committed
            self._tentative = False

    def discard(self) -> None:
        """Take the tentative step back; does nothing if there is none."""
        self._tentative = False

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Fields of the last advanced step."""
        return self._reader.read(request_header, self.parameters, self.state, indicators, own)

    def snapshot(self) -> bytes:
        """Commit, then everything that the future depends on; there is no cache that could change later bits."""
        self.commit()
        return encode_state(self.committed, self._probed)

    def restore(self, state: bytes) -> None:
        """Take over a snapshot of the same region; a tentative step is dropped."""
        model, t = self.model, self.model.n_tools
        most_probed = 1 + 3 * model.n_nodes + 5 * model.n_points * t + 7 * t + self.committed.memory.size
        self._probed = decode_state(state, self.committed, most_probed)
        self._ways = no_ways()
        if len(self._probed):
            self._probe = self._probe_for(float(self._probed[0]))
        self._tentative = False
