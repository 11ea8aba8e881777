"""Every message of softseam, declared once.

Each message is a frozen dataclass. `codec` derives its protobuf form from the annotations: a field's number is
its place in the class plus one (number 1 names the message), so fields are only ever appended. Arrays are validated
tensors: `Array("f8", None, 3)` is a float64 array of shape (n, 3) for any n.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.outcomes import Detail, EventKind, Status

SCHEMA_VERSION = 2


class Array:
    """Shape and dtype that a tensor field must have; None leaves an axis free.

    `least` is the smallest value allowed; `unbounded` lets +inf through (NaN never).
    """

    __slots__ = ("dtype", "least", "name", "shape", "unbounded")

    def __init__(self, dtype: str, *shape: int | None, least: int | None = None, unbounded: bool = False) -> None:
        self.name = dtype
        self.dtype = np.dtype("<" + dtype)
        self.shape = shape
        self.least = least
        self.unbounded = unbounded


class Least:
    """The smallest value that an integer field may have."""

    __slots__ = ("value",)

    def __init__(self, value: int) -> None:
        self.value = value


class Name:
    """Marks a text that may stand in a key expression or a file name: letters, digits, _ and -, or empty."""

    __slots__ = ()


Count = Annotated[int, Least(0)]
NameText = Annotated[str, Name()]


Vectors = Annotated[NDArray[np.float64], Array("f8", None, 3)]
Scalars = Annotated[NDArray[np.float64], Array("f8", None)]
Vector3 = Annotated[NDArray[np.float64], Array("f8", 3)]
Matrix = Annotated[NDArray[np.float64], Array("f8", None, None)]
Wrenches = Annotated[NDArray[np.float64], Array("f8", None, 6)]
Quaternions = Annotated[NDArray[np.float64], Array("f8", None, 4)]
Distances = Annotated[NDArray[np.float64], Array("f8", None, unbounded=True)]
Ids = Annotated[NDArray[np.int32], Array("i4", None, least=0)]
ToolIds = Annotated[NDArray[np.int32], Array("i4", None, least=-1)]
Labels = Annotated[NDArray[np.int8], Array("i1", None)]
Stresses = Annotated[NDArray[np.float64], Array("f8", None, 8, 6)]
Octants = Annotated[NDArray[np.float64], Array("f8", None, 8)]
OctantIds = Annotated[NDArray[np.int32], Array("i4", None, 8, least=-1)]
Lines = Annotated[NDArray[np.int32], Array("i4", None, 2, least=0)]
Triangles = Annotated[NDArray[np.int32], Array("i4", None, 3, least=0)]

# defaults of fields that are left out where they say nothing
_NO_VECTORS = partial(np.zeros, (0, 3))
_NO_MATRIX = partial(np.zeros, (0, 0))
_NO_SCALARS = partial(np.zeros, 0)


def _no_octants() -> NDArray[np.int32]:
    return np.zeros((0, 8), dtype=np.int32)


def _no_lines() -> NDArray[np.int32]:
    return np.zeros((0, 2), dtype=np.int32)


def _no_labels() -> NDArray[np.int8]:
    return np.zeros(0, dtype=np.int8)


@dataclass(frozen=True, slots=True)
class Header:
    """Names a message: a request with the same header and kind is the same request."""

    schema: Count
    session: NameText
    participant: NameText
    epoch: Count
    step: Count
    exchange: Count
    time: float
    """simulation time at the start of the step [s]"""


# ---- orchestrator to participant, and back ---------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Bundle:
    """A scene and the files it names, so that a participant needs no shared file system."""

    scene: str
    """the scene as JSON"""
    files: dict[str, bytes]
    """file contents by the path the scene gives them"""


@dataclass(frozen=True, slots=True)
class BodyState:
    """State of the whole body (N nodes, P surface points) as it is handed over at a region switch."""

    x: Vectors
    """positions (N, 3) [m]"""
    v: Vectors
    """velocities (N, 3) [m/s]"""
    contact_force: Vectors
    """contact force on each surface point, world frame (P, 3) [N]"""
    contact_tool: ToolIds
    """tool that each surface point touches, -1 for none (P,)"""


@dataclass(frozen=True, slots=True)
class Configure:
    """Build a region: these cells of the body, with this model, in this state (rest if absent)."""

    header: Header
    bundle: Bundle
    model: str
    cells: Ids
    seam_nodes: Ids
    """global node ids tied to the other side, ascending, clamped nodes left out (s,)"""
    state: BodyState | None = None
    owns_seam_points: bool = True
    """whether contact at surface points on the seam is this side's"""


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a participant can do for the region that it was configured with; who couples it asks for no more."""

    compliance: bool
    """tells how its coupling nodes yield to forces"""
    corrects: bool
    """moves a tentative step on by its linear answer to a force (`Correct`)"""
    impedance: bool
    """takes the parts beyond its coupling nodes into its own solve (`Advance.seam_stiffness`)"""
    substeps: Count
    """substeps a step; 1: none"""
    stress: bool
    """tells stress in its cells"""
    error: bool
    """estimates what its cells err by"""
    cost: float
    """expected processor time of a step [s]; 0: not known"""


@dataclass(frozen=True, slots=True)
class Configured:
    header: Header
    n_nodes: Count
    n_cells: Count
    substeps: Count
    """substeps a step that the participant takes (1 for FEM)"""
    strain: float = math.nan
    """strain energy of the state it begins with [J]; NaN, as for the next two: not told, by an older participant"""
    kinetic: float = math.nan
    """kinetic energy of that state, with the masses of the model that has it now [J]"""
    gravity: float = math.nan
    """its energy in gravity, likewise [J]"""
    seconds: float = 0.0
    """wall time spent [s]; diagnostics only"""
    capabilities: Capabilities | None = None
    """None: of a region without coupling nodes none are asked for"""


@dataclass(frozen=True, slots=True)
class ToolMotion:
    """Poses of all tools at the start and the end of the step, in the scene's order (t tools)."""

    position: Vectors
    orientation: Quaternions
    """unit quaternions w, x, y, z (t, 4)"""
    position_next: Vectors
    orientation_next: Quaternions
    gripping: Labels = field(default_factory=_no_labels)
    """1 for tools that hold the particles that they found within reach as they began to grip (t,); empty: none does"""


@dataclass(frozen=True, slots=True)
class Advance:
    """Advance tentatively by one step; a new step number commits the tentative step before it.

    The same step with a higher exchange number rolls back and redoes the step with the new seam force.
    """

    header: Header
    dt: float
    seam_force: Vectors
    """force on this side's seam nodes, constant over the step, or at its end (s, 3) [N]; see seam_force_start"""
    tools: ToolMotion
    compliance: bool = False
    """also return d(seam_x)/d(seam_force); where the force is linear in time, d(seam_v)/d(seam_force)"""
    seam_anchor: Vectors = field(default_factory=_NO_VECTORS)
    """where the other side would be without a change of force (s, 3) [m]; empty: the seam force is constant"""
    seam_stiffness: Matrix = field(default_factory=_NO_MATRIX)
    """how the other side resists (3s, 3s) [N/m]: the force on the seam is seam_force + stiffness (anchor - seam_x);
    empty beside an anchor: the last one sent since the last Configure, Snapshot or Restore"""
    fields: bool = False
    """also return the fields, which spares an `Observe` where this exchange is the step's last"""
    seam_force_start: Vectors = field(default_factory=_NO_VECTORS)
    """force at the start of the step, from which it goes to seam_force linearly in time (s, 3) [N]; empty: constant"""
    repeat_yield: bool = False
    """tell `Advanced.seam_yield_root` also if it was told before"""


@dataclass(frozen=True, slots=True)
class Correct:
    """Move the tentative step on by its linear answer to a force on the seam nodes; it stays tentative."""

    header: Header
    push: Vectors
    """by whose answer it is moved on, with the stiffness beyond the seam behind it (s, 3) [N]"""
    force: Vectors
    """that acts on the seam nodes from then on (s, 3) [N]"""
    fields: bool = False
    """also return the fields"""


@dataclass(frozen=True, slots=True)
class Advanced:
    header: Header
    status: Status
    seam_x: Vectors
    """seam positions at the end of the step (s, 3) [m]"""
    compliance: Matrix
    """(3s, 3s) [m/N], of a force that is linear in time [m/(N s)], or empty (0, 0)"""
    wrench: Wrenches
    """force and torque about each tool's centre that the body exerts on the tool (t, 6) [N, N m]"""
    kinetic: float
    strain: float
    gravity: float
    """potential energy of gravity relative to the rest position [J]"""
    tool_work: float
    """work of the tools on this region in the step [J]"""
    seam_work: float
    """work of the seam force on this region in the step [J]"""
    momentum: Vector3
    angular_momentum: Vector3
    """about the world's origin [kg m^2/s]"""
    penetration: float
    """deepest penetration of a surface point into a tool [m]"""
    slip: float
    """largest accumulated slip of a touching point on a moving tool [m]"""
    n_contacts: Count
    iterations: Count
    """Newton iterations, or sweeps"""
    seconds: float
    """wall time spent [s]; diagnostics only"""
    cell_distance: Distances
    """least distance of each of the region's cells to a tool that makes cells near, inf without one (n_cells,) [m]"""
    bounds: Matrix
    """axis-aligned bounds of the region's nodes, min and max (2, 3) [m]"""
    seam_force: Vectors = field(default_factory=_NO_VECTORS)
    """force that acted on the seam nodes (s, 3) [N]; empty: the one that was asked for"""
    fields: Fields | None = None
    n_crushed: Count = 0
    """cells squeezed so far that they count in part with full quadrature"""
    particles: ParticleReport | None = None
    """of a sheet or rope"""
    n_substeps: Count = 1
    """steps of the participant's own that the motion is made of"""
    n_rejected: Count = 0
    """substeps that were taken and given up, because their error was too large"""
    step_error: float = 0.0
    """largest estimated error in position that a substep made in time, 0 where it is not estimated [m]"""
    residual: float = 0.0
    """PBD: what the stress of the blocks lacks to that of their shapes at the end of the step, relative [1]"""
    alarm: str = ""
    """what the participant's monitor saw and did about it in this step; empty where that was nothing"""
    seam_v: Vectors = field(default_factory=_NO_VECTORS)
    """seam velocities at the end of the step (s, 3) [m/s]; empty where the seam force was constant"""
    settles: bool = False
    """whether this tentative step can be corrected (`Correct`)"""
    seam_yield_root: Matrix = field(default_factory=_NO_MATRIX)
    """R with d(seam_x)/d(seam_force) = R R^T by which it would be corrected, beside an anchor with the stiffness
    (3s, 3s) [(m/N)^(1/2)]; empty: as in the reply before"""
    why: str = ""
    """what went wrong and the remedy, where the status is not `converged`"""
    alarm_details: list[Detail] = field(default_factory=list)
    """what the alarm says, for programs"""


@dataclass(frozen=True, slots=True)
class ParticleReport:
    """How well the constraints of a body of particles are met at the end of a step."""

    worst_stretch: float
    """largest change of length of a spring, relative, or largest strain of a tetrahedron [1]"""
    stretch_violation: float
    """farthest that a spring is from its own law, relative to its length [1]"""
    stretch_violation_mean: float
    bending_violation: float
    """farthest that a bend is from its own law, relative to the particles' spacing [1]"""
    bending_violation_mean: float
    stretch_energy: float
    """[J]"""
    bending_energy: float
    """[J]"""
    held: Count
    """particles that tools hold"""


@dataclass(frozen=True, slots=True)
class Commit:
    """Accept the tentative step (done by the next Advance otherwise)."""

    header: Header
    fields: bool = False
    """also return the fields"""


@dataclass(frozen=True, slots=True)
class Committed:
    header: Header
    fields: Fields | None = None
    seconds: float = 0.0
    """wall time spent [s]; diagnostics only"""


@dataclass(frozen=True, slots=True)
class Observe:
    """Ask for the fields of the last advanced step."""

    header: Header
    indicators: bool = False
    """also estimate the errors of model and mesh"""
    own: bool = False
    """of these only what the region's own model errs, at a bounded cost: what is looked at as a run ends"""


@dataclass(frozen=True, slots=True)
class Fields:
    """Fields of one region: its nodes, cells and surface points in ascending global order."""

    header: Header
    nodes: Ids
    x: Vectors
    v: Vectors
    cauchy: Stresses
    """Cauchy stress xx yy zz yz xz xy per octant of each cell (n_cells, 8, 6) [Pa]"""
    points: Ids
    point_x: Vectors
    """positions of the region's surface points (p, 3) [m]"""
    contact_force: Vectors
    """contact force on each of them (p, 3) [N]"""
    contact_tool: ToolIds
    point_strain: Scalars = field(default_factory=_NO_SCALARS)
    """of a sheet or rope: largest stretch of what holds each surface point (p,) [1]"""
    cell_energy: Scalars = field(default_factory=_NO_SCALARS)
    """strain energy of each cell (n_cells,) [J]"""
    model_error: Scalars = field(default_factory=_NO_SCALARS)
    """energy by which each cell is off because PBD computes it; of FEM, would be off if PBD did (n_cells,) [J]; empty:
    not asked for, or the cells are none that PBD can compute"""
    mesh_error: Scalars = field(default_factory=_NO_SCALARS)
    """FEM: energy by which each cell is off because it is no smaller (n_cells,) [J]; empty: not asked for, or of PBD"""
    seconds: float = 0.0
    """wall time spent on an `Observe` [s], 0 within another reply; diagnostics only"""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Commit, then return everything that the participant's future depends on."""

    header: Header


@dataclass(frozen=True, slots=True)
class SnapshotTaken:
    header: Header
    state: bytes
    seconds: float = 0.0
    """wall time spent [s]; diagnostics only"""


@dataclass(frozen=True, slots=True)
class Restore:
    header: Header
    state: bytes


@dataclass(frozen=True, slots=True)
class Restored:
    header: Header
    seconds: float = 0.0
    """wall time spent [s]; diagnostics only"""


@dataclass(frozen=True, slots=True)
class Release:
    """Forget a session's participant."""

    header: Header


@dataclass(frozen=True, slots=True)
class Released:
    header: Header


@dataclass(frozen=True, slots=True)
class Failure:
    """The answer to a request that cannot be served."""

    kind: str
    """'not_configured', 'stale', 'schema', 'invalid', 'busy', 'internal'"""
    message: str
    """what is wrong and the remedy"""


Request = Configure | Advance | Correct | Commit | Observe | Snapshot | Restore | Release
Worked = Configured | Advanced | Committed | Fields | SnapshotTaken | Restored
"""replies that tell how long the participant worked for them"""
Reply = Worked | Released | Failure


# ---- orchestrator to clients and recorders ---------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class SeamReport:
    """How well the two sides agree."""

    gap: float
    """largest position gap at commit [m]"""
    exchanges: Count
    n_nodes: Count
    force: float
    """largest multiplier [N]"""
    work: float
    """work of the seam, both sides together, in this step [J]"""


@dataclass(frozen=True, slots=True)
class RegionReport:
    """One region's size and energies [J]."""

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


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class StepReport:
    """What happened in one committed step; one is published for every step."""

    header: Header
    phase: int
    """index of the motion phase in which the step ends, or -1"""
    tool_position: Vectors
    tool_orientation: Quaternions
    wrench: Wrenches
    quantities: dict[str, float]
    seam: SeamReport
    regions: dict[str, RegionReport]
    energy: dict[str, float]
    """ledger of the step [J]: kinetic, strain and gravity at its end; drive_work of the tools' motion, of which
    contact_loss goes into friction and tool_work into the body; seam_work, dissipation of the integrators, switch"""
    momentum: Vector3
    angular_momentum: Vector3
    penetration: float
    seconds: dict[str, float]
    """wall seconds of the step by fem, pbd, coupling, bus, record, total"""
    done: bool
    command: Vectors
    """tool velocities that were applied (t, 3) [m/s]"""
    turning: Vectors = field(default_factory=_NO_VECTORS)
    """angular velocities about the tools' positions that were applied (t, 3) [rad/s]; empty: none turned"""
    gripping: Labels = field(default_factory=_no_labels)
    """1 for tools that gripped (t,); empty: none did"""
    estimate: ErrorEstimate | None = None
    """with the step that ends a scene's own motion or duration, of a body in cells"""


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class Frame:
    """The whole body at the end of a step: what a replay draws."""

    header: Header
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
    seam_nodes: Ids
    multiplier: Vectors
    """seam force on the near side (s, 3) [N]"""
    tool_position: Vectors
    tool_orientation: Quaternions
    point_strain: Scalars = field(default_factory=_NO_SCALARS)
    """of a sheet or rope: largest stretch of what holds each surface point (P,) [1]"""
    cell_energy: Scalars = field(default_factory=_NO_SCALARS)
    """strain energy of each cell (n_cells,) [J]; empty in recordings from before there was one"""
    indicators: Indicators | None = None
    """where the scene asks for one of them"""


@dataclass(frozen=True, slots=True)
class Event:
    """Something worth telling: a region switch, a phase, a fallback, an alarm, a recovery."""

    header: Header
    kind: EventKind
    message: str
    """for people; programs read the rest"""
    details: list[Detail] = field(default_factory=list)
    count: Count = 0
    """of what the kind counts: the parts of a cut step"""


# ---- client to orchestrator, and back --------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Open:
    """Open a session on a scene."""

    header: Header
    bundle: Bundle
    record: bool = False


@dataclass(frozen=True, slots=True)
class Reset:
    header: Header
    seed: int


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class Save:
    """Return the state of the whole simulation."""

    header: Header


@dataclass(frozen=True, slots=True)
class Load:
    header: Header
    state: bytes


@dataclass(frozen=True, slots=True)
class Estimate:
    """Ask how far the answer may be off as the body stands."""

    header: Header


@dataclass(frozen=True, slots=True)
class Saved:
    header: Header
    state: bytes


@dataclass(frozen=True, slots=True)
class Estimated:
    header: Header
    estimate: ErrorEstimate | None
    """None of a body of particles, whose errors nobody estimates"""


@dataclass(frozen=True, slots=True)
class Close:
    header: Header


@dataclass(frozen=True, slots=True)
class Closed:
    header: Header


@dataclass(frozen=True, slots=True)
class Observation:
    """The answer to Open, Reset, Step and Load: the last step's report, its frame if asked for, and events since."""

    header: Header
    report: StepReport
    frame: Frame | None
    events: list[Event]


@dataclass(frozen=True, slots=True)
class Observations:
    """The answer to a Step that asks for each: one Observation a step, the same as steps asked for one by one."""

    header: Header
    steps: list[Observation]


# ---- to recorders and viewers, once a session; and back -----------------------------------------------------


@dataclass(frozen=True, slots=True)
class ToolSurface:
    """A tool that is a triangle mesh, in its own frame."""

    vertices: Vectors
    """(n, 3) [m]"""
    triangles: Triangles
    """counter-clockwise from outside (T, 3)"""


@dataclass(frozen=True, slots=True)
class SurfaceMesh:
    """What a viewer needs to draw a body's frames (C cells, P surface points, T triangles)."""

    header: Header
    point_rest: Vectors
    """surface points at rest (P, 3) [m]"""
    triangles: Triangles
    """counter-clockwise from outside (T, 3)"""
    cell_center: Vectors
    """centres of the cells at rest (C, 3) [m]"""
    edges: Vector3
    """edge lengths of a cell [m]"""
    fill: Octants
    """filled fraction of each octant (C, 8)"""
    tools: dict[str, ToolSurface] = field(default_factory=dict)
    """the tools that are meshes, by name"""
    point_octants: OctantIds = field(default_factory=_no_octants)
    """octants 8 cell + octant that meet at each surface point, -1 for none (P, 8); empty where cells are boxes"""
    cell_lines: Lines = field(default_factory=_no_lines)
    """ends of the lines along cells' edges on the surface, as surface points (L, 2); empty where cells are boxes"""
    cell_volume: Scalars = field(default_factory=_NO_SCALARS)
    """(C,) [m^3]; empty where cells are boxes"""
    octant_material: OctantIds = field(default_factory=_no_octants)
    """number of each octant's material, 0 the body's own (C, 8); empty where there is but one"""
    border_lines: Lines = field(default_factory=_no_lines)
    """ends of the lines along borders of materials, as nodes (L, 2)"""


@dataclass(frozen=True, slots=True)
class Begin:
    """A session begins: what its recording must hold to be drawn and simulated again."""

    header: Header
    bundle: Bundle
    seed: int
    facts: dict[str, str]
    """versions and machine of the process that simulates"""
    surface: SurfaceMesh


@dataclass(frozen=True, slots=True)
class End:
    """A session has ended: its recording can be closed."""

    header: Header
    reason: str


@dataclass(frozen=True, slots=True)
class Recorded:
    """Progress of a recorder: everything up to here is in the file, but for `lost` messages."""

    header: Header
    path: str
    messages: Count
    lost: Count
    bytes: Count
    note: str
    """'recording', 'closed', or why messages are lost"""


# ---- operations --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
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
