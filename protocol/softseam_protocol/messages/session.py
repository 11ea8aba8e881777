"""Between the orchestrator, its clients and who watches: reports, frames, events, heartbeats; requests."""

from dataclasses import field

from softseam_protocol.messages.arrays import (
    NO_SCALARS,
    NO_VECTORS,
    Count,
    Ids,
    Labels,
    NameText,
    Quaternions,
    Scalars,
    Stresses,
    ToolIds,
    Vector3,
    Vectors,
    Wrenches,
    no_labels,
)
from softseam_protocol.messages.header import Header, message
from softseam_protocol.messages.outcomes import Detail, EventKind
from softseam_protocol.messages.participant import Bundle, Failure


@message
class InterfaceReport:
    """How well two parts agree that meet at an interface."""

    gap: float
    """largest position gap at commit [m]"""
    exchanges: Count
    n_nodes: Count
    force: float
    """largest multiplier [N]"""
    work: float
    """work of the interface on both parts together, in this step [J]"""
    force_x: float = 0.0
    """of all nodes or points on the first body, or the near part, the mean of the step [N]"""
    force_y: float = 0.0
    force_z: float = 0.0

    @property
    def total(self) -> tuple[float, float, float]:
        """That force along x, y and z [N]."""
        return self.force_x, self.force_y, self.force_z


@message
class PartReport:
    """Size and energies [J] of a part: some of a body under one model."""

    body: NameText
    model: str
    n_cells: Count
    n_nodes: Count
    kinetic: float
    strain: float
    gravity: float
    iterations: Count
    seconds: float
    substeps: Count = 1
    """the participant's own steps that this one is made of"""
    rejected: Count = 0
    """substeps that were taken and given up, because their error was too large"""
    step_error: float = 0.0
    """largest estimated error in position that a substep made in time, 0 where it is not estimated [m]"""


@message
class ErrorEstimate:
    """How far a run's answer may be off, by what its participants estimate of their errors."""

    time: float
    """when the fields were looked at: where the body was strained most among the looks [s]"""
    mesh_error: float
    """of FEM, because its cells are no smaller: in the energy norm, relative to the strain energy [1]"""
    model_error: float
    """of PBD against quadratic finite elements, in the same measure [1]"""
    answer: float
    """what forces and displacements may be off by [1]; 0 where nothing can be said of them"""
    judged: float
    """share of the strain energy that sits in cells which can be judged: filled, and of one material [1]"""
    text: str
    """all this in words, with a remedy where the answer is off by more than a run may be"""
    too_large: bool
    """whether it is"""
    goal: str = ""
    """the scene's goal, '' for none: grip_force, or the probe whose von Mises stress it is"""
    goal_error: float = 0.0
    """by how much of itself the goal ought to be larger, with its sign [1]; of a probe, by FEM on the same cells"""


@message
class StepReport:
    """What happened in one committed step; one is published for every step."""

    header: Header
    phase: int
    """index of the motion phase in which the step ends, or -1"""
    tool_position: Vectors
    tool_orientation: Quaternions
    wrench: Wrenches
    quantities: dict[str, float]
    """by name: grip_force; where the scene has several bodies, BODY.grip_force; of probes PROBE.von_mises"""
    interfaces: dict[str, InterfaceReport]
    """by id: BODY.seam between the parts of a body; the name that the scene has of what is between two bodies; A+B of
    bodies that may touch because its `contacts` say so, where they pressed in the step"""
    parts: dict[str, PartReport]
    """by id: BODY.near and BODY.far"""
    energy: dict[str, float]
    """ledger of the step [J]: kinetic, strain and gravity at its end; drive_work of the tools' motion, of which
    contact_loss goes into friction and what contact stores, and tool_work into the body; seam_work, dissipation of the
    integrators, switch; where the material has internal state material, what it dissipated; of bodies that interfaces
    join interface_work, what the others do to each"""
    momentum: Vector3
    angular_momentum: Vector3
    penetration: float
    seconds: dict[str, float]
    """wall seconds of the step by fem, pbd, coupling, bus, record, total"""
    done: bool
    command: Vectors
    """tool velocities that were applied (t, 3) [m/s]"""
    turning: Vectors = field(default_factory=NO_VECTORS)
    """angular velocities about the tools' positions that were applied (t, 3) [rad/s]; empty: none turned"""
    gripping: Labels = field(default_factory=no_labels)
    """1 for tools that gripped (t,); empty: none did"""
    estimate: ErrorEstimate | None = None
    """with the step that ends a scene's own motion or duration: of the body in cells that is off most"""

    @property
    def seam(self) -> InterfaceReport:
        """All interfaces together: the largest gap, exchanges and force, the sums of nodes, work and whole forces; one
        exchange where there are none."""
        joined = self.interfaces.values()
        return InterfaceReport(
            max((one.gap for one in joined), default=0.0),
            max((one.exchanges for one in joined), default=1),
            sum(one.n_nodes for one in joined),
            max((one.force for one in joined), default=0.0),
            sum(one.work for one in joined),
            *(sum(one.total[axis] for one in joined) for axis in range(3)),
        )


@message
class Indicators:
    """How far the answer may be off, as fields on the body's cells (n_cells,)."""

    model_error: Scalars
    """energy of the error that a PBD cell makes against quadratic finite elements, 0 of FEM [J]"""
    mesh_error: Scalars
    """energy of the error that a FEM cell makes because it is no smaller, 0 of PBD [J]"""
    traction_jump: Scalars
    """root mean square over a cell's seam faces of what one side's traction lacks to the other's, 0 elsewhere [Pa]"""
    gap: Scalars
    """largest distance between the two sides at a cell's seam nodes, 0 elsewhere [m]"""


@message
class Frame:
    """One body, whole, at the end of a step, or at the start: what a replay draws. A step has one for each body."""

    header: Header
    body: NameText
    x: Vectors
    """positions (N, 3) [m]; seam nodes are the near side's"""
    cauchy: Stresses
    """(n_cells, 8, 6) [Pa]"""
    cell_near: Labels
    """1 where a cell is near, 0 where far (n_cells,)"""
    point_x: Vectors
    contact_force: Vectors
    """(P, 3) [N]"""
    contact_tool: ToolIds
    coupling_nodes: Ids
    multiplier: Vectors
    """seam force on the near side (s, 3) [N]"""
    tool_position: Vectors
    tool_orientation: Quaternions
    point_strain: Scalars = field(default_factory=NO_SCALARS)
    """of a sheet or rope: largest stretch of what holds each surface point (P,) [1]"""
    cell_energy: Scalars = field(default_factory=NO_SCALARS)
    """strain energy of each cell (n_cells,) [J]; empty in recordings from before there was one"""
    indicators: Indicators | None = None
    """where the scene asks for one of them"""
    start: bool = False
    """it is from before the step that the header names, with which the run starts"""


@message
class Event:
    """Something worth a line: a region switch, a phase, a fallback, an alarm, a recovery."""

    header: Header
    kind: EventKind
    message: str
    """for people; programs read the rest"""
    details: list[Detail] = field(default_factory=list)
    count: Count = 0
    """of what the kind counts: the parts of a cut step"""


@message
class Open:
    """Open a session on a scene."""

    header: Header
    bundle: Bundle
    record: bool = False


@message
class Reset:
    """Begin the scene anew, or another one in its place."""

    header: Header
    seed: int
    bundle: Bundle | None = None
    """the other scene; where it is refused, the session stands at the start of the one that it had"""


@message
class Step:
    """Take `count` steps with these tool velocities, or with the scene's motion where `program` is set."""

    header: Header
    count: Count
    program: bool
    velocities: dict[str, Vector3]
    """[m/s]"""
    fields: bool = True
    turning: dict[str, Vector3] = field(default_factory=dict)
    """angular velocities about the tools' positions [rad/s]"""
    each: bool = False
    """answer with the Observations of all steps; fewer than `count` may be taken, so that the answer comes soon"""
    gripping: dict[str, float] = field(default_factory=dict)
    """1 for tools that are to hold the particles within reach, 0 for those that are to let go"""


@message
class Save:
    """Return the state of the whole simulation."""

    header: Header


@message
class Load:
    header: Header
    state: bytes


@message
class Estimate:
    """Ask how far the answer may be off as the body stands."""

    header: Header


@message
class Saved:
    header: Header
    state: bytes


@message
class Estimated:
    header: Header
    estimate: ErrorEstimate | None
    """of the body that is off most; None of bodies of particles, whose errors nobody estimates"""


@message
class Close:
    header: Header


@message
class Closed:
    header: Header


@message
class Observation:
    """The answer to Open, Reset, Step and Load: the last step's report, its frames if asked for, and events since."""

    header: Header
    report: StepReport
    frames: dict[str, Frame]
    """by body; empty where they were not asked for"""
    events: list[Event]


@message
class Observations:
    """The answer to a Step that asks for each: one Observation a step, the same as steps asked for one by one."""

    header: Header
    steps: list[Observation]


ClientRequest = Open | Reset | Step | Save | Load | Estimate | Close
ClientReply = Observation | Observations | Saved | Estimated | Closed | Failure


@message
class Progress:
    """A service's heartbeat; `requests` stands still while `busy` grows when its solver hangs."""

    service: NameText
    instance: NameText
    """names the process: differs after a restart"""
    session: NameText
    """session of the last request, or empty"""
    step: Count
    requests: Count
    """requests answered since the service started"""
    busy: float
    """wall time spent in the request at hand, 0 when idle [s]"""
