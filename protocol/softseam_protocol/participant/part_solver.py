"""A part's committed state, the tentative one beside it, and what was reported of both: the solver of a `Part`."""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Figure, Status
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Capabilities,
    Configure,
    Configured,
    Correct,
    Coupled,
    Fields,
)
from softseam_protocol.participant.part import Part, Unconverged
from softseam_protocol.participant.requests import Participant
from softseam_protocol.participant.state import NotFinite, State, finite, load, save, sound

Floats = NDArray[np.float64]


def participant_of(make: Callable[[Configure], Part]) -> Participant:
    """A participant whose parts `make` makes, which raises ValueError for a part that it cannot take."""

    def build(request: Configure) -> tuple[PartSolver, Configured]:
        solver = PartSolver(make(request), request)
        return solver, solver.configured(request.header)

    return Participant(build, PartSolver.check)


class PartSolver:
    """A `Solver` whose state is a value."""

    def __init__(self, part: Part, request: Configure) -> None:
        self.part = part
        self.committed = sound(part.begin, part.begin)
        self.tentative: State | None = None
        self._asked: Advance | None = None  # which led to the tentative state
        self._told: tuple[State, float, Floats] | None = None  # begin, dt and response that the coupling counts with
        self._rows = (3 * part.coupling[:, None] + np.arange(3)).ravel()
        shape = part.mesh.nodes.tobytes() + part.mesh.x_rest.tobytes() + request.coupling_nodes.tobytes()
        self._kind = hashlib.sha256(shape).digest()

    @property
    def capabilities(self) -> Capabilities:
        """What the part's class overrides is what it can do."""
        own = type(self.part)
        responds, stress = own.response is not Part.response, own.stress is not Part.stress
        return Capabilities(responds, responds and own.corrects, False, own.substeps, stress, False, own.cost)

    @property
    def now(self) -> State:
        """The tentative state, where there is one, or the committed one."""
        return self.tentative or self.committed

    @property
    def strain(self) -> float:
        """Strain energy of the state as it stands [J]."""
        return float(self.part.strain_energy(self.now).sum())

    def configured(self, header: Header) -> Configured:
        """What the part says of itself."""
        mesh, moving = self.part.mesh, self._moving(self.now)
        able = self.capabilities
        return Configured(header, len(mesh.nodes), len(mesh.cell_nodes), able.substeps, self.strain, *moving, 0.0, able)

    def check(self, request: Advance | Correct) -> None:
        """Raises ValueError for a request that cannot be served, before anything changes."""
        if isinstance(request, Correct):
            if not self._correctable:
                raise ValueError(
                    "this step cannot be corrected: redo it, or ask for the compliance of steps of its length first"
                )
            forces = [request.push, request.force]
        else:
            forces, motion = [request.coupling_force], request.tools
            if not (np.isfinite(request.dt) and request.dt > 0.0):
                raise ValueError(f"the time step is {request.dt} s: send one that is positive")
            if len(request.coupling_target) or len(request.coupling_force_start):
                raise ValueError("this participant takes constant forces alone: send no anchor and no force at first")
            if request.compliance and not self.capabilities.compliance:
                raise ValueError("this participant reports no compliance, as its capabilities say: ask for none")
            poses = (motion.position, motion.orientation, motion.position_next, motion.orientation_next)
            if not all(np.isfinite(pose).all() and len(pose) == len(poses[0]) for pose in poses):
                raise ValueError("poses of tools that are not finite, or not of the same tools: send a row for each")
        n = len(self.part.coupling)
        for force in forces:
            if force.shape != (n, 3) or not np.isfinite(force).all():
                raise ValueError(f"a force of shape {force.shape}: the coupling nodes need ({n}, 3) finite numbers")

    def advance(self, request: Advance) -> Advanced:
        """Take a step from the committed state, tentatively; where the part raises, nothing changes."""
        began, begin, dt, reported = perf_counter(), self.committed, request.dt, self._told
        try:
            end = sound(self.part.step(begin, dt, request.coupling_force, request.tools), begin)
            reply = self._reply(request.header, request, end, request.coupling_force)
            coupling = reply.coupling
            if request.compliance:
                reported = begin, dt, self._response(begin, dt)
                coupling = replace(coupling, compliance=reported[2][self._rows])
        except NotFinite as error:
            status, why = Status.DIVERGED, f"{error}: take a shorter step"
        except (Unconverged, np.linalg.LinAlgError) as error:
            status, why = Status.UNCONVERGED, str(error)
        else:
            self.tentative, self._asked, self._told = end, request, reported
            coupling = replace(coupling, correctable=self._correctable)
            return replace(reply, coupling=coupling, seconds=perf_counter() - began)
        still = self._reply(request.header, request, replace(begin, advanced={}), request.coupling_force)
        self.tentative = self._asked = None
        return replace(still, status=status, why=why, seconds=perf_counter() - began)

    def correct(self, request: Correct) -> Advanced:
        """Move the tentative step on by the response that was reported last; see `check`."""
        began, end, asked, reported = perf_counter(), self.tentative, self._asked, self._told
        assert end is not None and asked is not None and reported is not None
        way = (reported[2] @ request.push.ravel()).reshape(-1, 3)
        end = sound(replace(end, x=end.x + way, v=end.v + way / asked.dt), end)
        reply = self._reply(request.header, asked, end, request.force)
        self.tentative = end
        coupling = replace(reply.coupling, correctable=True)
        return replace(reply, coupling=coupling, seconds=perf_counter() - began)

    def commit(self) -> None:
        """Accept the tentative step, where there is one."""
        self.committed, self.tentative = self.now, None

    def discard(self) -> None:
        """Take the tentative step back."""
        self.tentative = None

    def snapshot(self) -> bytes:
        """The committed state, and the one whose response was reported: that is computed again."""
        begin, dt, _ = self._told or (self.committed, 0.0, None)
        return save((self.committed, begin), dt, self._kind)

    def restore(self, state: bytes) -> None:
        """Continue from a snapshot of the same part. Raises ValueError."""
        (committed, begin), dt = load(state, self.committed, 2, self._kind)
        self._told = (begin, dt, self._response(begin, dt)) if dt else None
        self.committed, self.tentative = committed, None

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Of the state as it stands; errors are not estimated. Raises NotFinite."""
        part, mesh, state = self.part, self.part.mesh, self.now
        reported = Fields(
            header=request_header,
            nodes=mesh.nodes,
            x=state.x,
            v=state.v,
            cauchy=part.stress(state),
            points=mesh.points,
            point_x=part.surface(state),
            contact_force=np.zeros((len(mesh.points), 3)),
            contact_tool=np.full(len(mesh.points), -1, dtype=np.int32),
            cell_energy=part.strain_energy(state),
        )
        reported = replace(reported, **state.fields)
        finite(reported)
        return reported

    @property
    def _correctable(self) -> bool:
        """Whether what was reported is of steps as long as the tentative one, of which positions say all: how contact
        changes, a linear answer does not know."""
        end, reported, asked = self.tentative, self._told, self._asked
        if end is None or reported is None or asked is None or end.advanced or end.fields:
            return False
        return self.part.corrects and reported[1] == asked.dt

    def _response(self, begin: State, dt: float) -> Floats:
        """Raises TypeError for one of another shape, and NotFinite."""
        found, wanted = self.part.response(begin, dt), (begin.x.size, 3 * len(self.part.coupling))
        if found.shape != wanted:
            raise TypeError(f"a response of shape {found.shape}: this part's is {wanted}")
        if not np.isfinite(found).all():
            raise NotFinite("the response is not finite")
        return found

    def _moving(self, state: State) -> tuple[float, float]:
        """Kinetic energy, and that in gravity [J]."""
        mass, sunk = self.part.mesh.mass, (state.x - self.part.mesh.x_rest) @ self.part.gravity
        return 0.5 * float(mass @ (state.v * state.v).sum(axis=1)), -float(mass @ sunk)

    def _reply(self, header: Header, asked: Advance, end: State, force: Floats) -> Advanced:
        """What a step that ends so says of itself, under these forces. Raises NotFinite."""
        part = self.part
        kinetic, gravity = self._moving(end)
        momentum = part.mesh.mass[:, None] * end.v
        reported = Advanced(
            header=header,
            status=Status.CONVERGED,
            wrench=np.zeros((len(asked.tools.position), 6)),
            kinetic=kinetic,
            strain=float(part.strain_energy(end).sum()),
            gravity=gravity,
            tool_work=0.0,
            momentum=momentum.sum(axis=0),
            angular_momentum=np.cross(end.x, momentum).sum(axis=0),
            bounds=np.stack([end.x.min(axis=0), end.x.max(axis=0)]),
            seconds=0.0,
            cell_distance=np.full(len(part.mesh.cell_nodes), np.inf),
            coupling=Coupled(
                x=end.x[part.coupling], work=float((force * (end.x - self.committed.x)[part.coupling]).sum())
            ),
            extras={Figure.FASTEST: float(np.sqrt((end.v * end.v).sum(axis=1).max(initial=0.0)))},
        )
        reported = replace(reported, **end.advanced)
        finite(reported)
        return reported
