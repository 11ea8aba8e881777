"""Between the orchestrator and participants."""

from __future__ import annotations

import math
from dataclasses import field

from softseam_protocol.messages.arrays import (
    NO_INTERNAL,
    NO_MATRIX,
    NO_SCALARS,
    NO_VECTORS,
    CellNodes,
    Count,
    Distances,
    Ids,
    Internal,
    Labels,
    Matrix,
    NameText,
    Quaternions,
    Scalars,
    Stresses,
    ToolIds,
    Vector3,
    Vectors,
    Wrenches,
    no_ids,
    no_labels,
)
from softseam_protocol.messages.header import Header, message
from softseam_protocol.messages.names import ONLY_BODY
from softseam_protocol.messages.outcomes import ONE_AT_LEAST, Detail, FailureKind, Figure, Status
from softseam_protocol.messages.pile import Begun, Guest, Members


@message
class Bundle:
    """A scene and the files it names, so that a participant needs no shared file system."""

    scene: str
    """the scene as JSON"""
    files: dict[str, bytes]
    """file contents by the path the scene gives them"""


@message
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
    internal: Internal = field(default_factory=NO_INTERNAL)
    """the n numbers that the material remembers in each octant of the C cells (C, 8, n); empty: none, or all are 0"""


@message
class PartMesh:
    """The mesh of a part, for a participant that does not build the body itself (n nodes, c cells, p points)."""

    nodes: Ids
    """global ids, ascending (n,)"""
    x_rest: Vectors
    """positions at rest (n, 3) [m]"""
    mass: Scalars
    """that the part's cells give to each node (n,) [kg]"""
    fixed: Labels
    """1 for clamped nodes (n,)"""
    cell_nodes: CellNodes
    """places among `nodes` of each cell's 3 x 3 x 3 lattice, i + 3 j + 9 k along its x, y, z; a cell that is a
    tetrahedron has those with i >= j >= k, and the others repeat the middle one (c, 27)"""
    points: Ids
    """global ids of the surface points that the part carries, ascending (p,)"""
    point_cell: Ids
    """place of the cell that carries each; without cells, of the node that it follows (p,)"""
    point_local: Vectors
    """where in that cell, -1 to 1 along its x, y, z; beyond, by a cell at most, for points across a seam; without
    cells, from that node along x, y, z [m] (p, 3)"""


@message
class Configure:
    """Build a part: these cells of a body, with this model, in this state (rest if absent)."""

    header: Header
    bundle: Bundle
    model: str
    cells: Ids
    coupling_nodes: Ids
    """global node ids tied to the other side, ascending, clamped nodes left out (s,)"""
    state: BodyState | None = None
    owns_coupling_points: bool = True
    """whether contact at surface points on the coupling nodes is this part's"""
    body: NameText = ONLY_BODY
    """of the scene, whose cells they are"""
    mesh: PartMesh | None = None
    """of the cells, in their order, or of points; None: of particles, or from an older orchestrator"""
    bodies: list[NameText] = field(default_factory=list)
    """of a pile: whole bodies of the scene that are to be one part, in place of `body` and `cells`"""
    states: list[BodyState] = field(default_factory=list)
    """and the state of each; empty: at rest"""
    guests: list[NameText] = field(default_factory=list)
    """of a pile: bodies of the scene, of other models, that may touch its own"""


@message
class Capabilities:
    """What a participant can do for the region that it was configured with; who couples it asks for no more."""

    compliance: bool
    """reports how its coupling nodes yield to forces"""
    corrects: bool
    """moves a tentative step on by its linear answer to a force (`Correct`)"""
    impedance: bool
    """takes the parts beyond its coupling nodes into its own solve (`Advance.coupling_impedance`)"""
    substeps: Count
    """substeps a step; 1: none"""
    stress: bool
    """reports stress in its cells"""
    error: bool
    """estimates what its cells err by"""
    cost: float
    """expected processor time of a step [s]; 0: not known"""


@message
class Configured:
    header: Header
    n_nodes: Count
    n_cells: Count
    substeps: Count
    """substeps a step that the participant takes (1 for FEM)"""
    strain: float = math.nan
    """strain energy of the state it begins with [J]; NaN, as for the next two: not reported, by an older participant"""
    kinetic: float = math.nan
    """kinetic energy of that state, with the masses of the model that has it now [J]"""
    gravity: float = math.nan
    """its energy in gravity, likewise [J]"""
    seconds: float = 0.0
    """wall time spent [s]; diagnostics only"""
    capabilities: Capabilities | None = None
    """None: of a region without coupling nodes none are asked for"""
    begun: Begun | None = None
    """of a pile"""


@message
class ToolMotion:
    """Poses of all tools at the start and the end of the step, in the scene's order (t tools)."""

    position: Vectors
    orientation: Quaternions
    """unit quaternions w, x, y, z (t, 4)"""
    position_next: Vectors
    orientation_next: Quaternions
    gripping: Labels = field(default_factory=no_labels)
    """1 for tools that hold the particles that they found within reach as they began to grip (t,); empty: none does"""


@message
class Advance:
    """Advance tentatively by one step; a new step number commits the tentative step before it.

    The same step with a higher exchange number rolls back and redoes the step with the new coupling force.
    """

    header: Header
    dt: float
    coupling_force: Vectors
    """force on the part's coupling nodes, constant over the step, or at its end (s, 3) [N]; see coupling_force_start"""
    tools: ToolMotion
    compliance: bool = False
    """also return `Coupled.compliance`, of x, or where the force is linear in time of v, by coupling_force"""
    coupling_target: Vectors = field(default_factory=NO_VECTORS)
    """where the other side would be without a change of force (s, 3) [m]; empty: the coupling force is constant"""
    coupling_impedance: Matrix = field(default_factory=NO_MATRIX)
    """how the other side resists (3s, 3s) [N/m]: the force on these nodes is coupling_force + stiffness (anchor - x);
    empty beside an anchor: the last one sent since the last Configure, Snapshot or Restore"""
    fields: bool = False
    """also return the fields, which spares an `Observe` where this exchange is the step's last"""
    coupling_force_start: Vectors = field(default_factory=NO_VECTORS)
    """as the step begins, from which it goes to coupling_force linearly in time (s, 3) [N]; empty: it is constant"""
    repeat_compliance: bool = False
    """report `Coupled.root` also if it was reported before"""
    turn: Scalars = field(default_factory=NO_SCALARS)
    """of a body in several parts that turns: as the step begins, of all its nodes, mass, m x, m v, m x x v, and m x x
    as xx yy zz yz xz xy; then angular velocity about their centre [rad/s] and velocity [m/s] that every node is to be
    given before the step (22,); empty: nothing is"""
    asleep: Labels = field(default_factory=no_labels)
    """of a pile: 1 for bodies that stay as they are (b,); empty: none does"""
    guests: list[Guest] = field(default_factory=list)
    """of a pile: those of `Configure.guests`, in their order"""
    coupling_asked: Ids = field(default_factory=no_ids)
    """places among the coupling nodes of those whose answers to forces are wanted, ascending (a,); empty: all"""


@message
class Correct:
    """Move the tentative step on by its linear answer to a force on the coupling nodes; it stays tentative."""

    header: Header
    push: Vectors
    """by whose answer it is moved on, with the stiffness beyond these nodes behind it (s, 3) [N]"""
    force: Vectors
    """that acts on the coupling nodes from then on (s, 3) [N]"""
    fields: bool = False
    """also return the fields"""
    then: Advance | None = None
    """the first request for the next step, to be served at once, which spares a message; a participant may leave it"""


@message
class Coupled:
    """What a step did at a part's coupling nodes (s of them, none of a part that nothing joins)."""

    x: Vectors = field(default_factory=NO_VECTORS)
    """positions at the end of the step (s, 3) [m]"""
    v: Vectors = field(default_factory=NO_VECTORS)
    """velocities at the end of the step (s, 3) [m/s]; empty where the force was constant"""
    force: Vectors = field(default_factory=NO_VECTORS)
    """that acted on them (s, 3) [N]; empty: the one that was asked for"""
    work: float = 0.0
    """of that force on this part in the step [J]"""
    compliance: Matrix = field(default_factory=NO_MATRIX)
    """(3s, 3s) [m/N], of a force that is linear in time [m/(N s)]; empty: not reported"""
    root: Matrix = field(default_factory=NO_MATRIX)
    """R of dx/dforce = R R^T, by which the step is corrected (3s, r) [(m/N)^(1/2)]; of `Advance.coupling_asked` alone
    (3a, r), where a participant makes use of that; empty: as before"""
    correctable: bool = False
    """whether this tentative step can be corrected (`Correct`)"""
    sums: Scalars = field(default_factory=NO_SCALARS)
    """of all nodes of the part as the step ends, like the first 16 of `Advance.turn`; empty: what steps lose of a
    rotation is not given back"""


@message
class Advanced:
    header: Header
    status: Status
    wrench: Wrenches
    """force and torque about each tool's centre that the body exerts on the tool (t, 6) [N, N m]"""
    kinetic: float
    strain: float
    gravity: float
    """potential energy of gravity relative to the rest position [J]"""
    tool_work: float
    """work of the tools on this part in the step [J]"""
    momentum: Vector3
    angular_momentum: Vector3
    """about the world's origin [kg m^2/s]"""
    bounds: Matrix
    """axis-aligned bounds of the part's nodes, min and max (2, 3) [m]"""
    seconds: float
    """wall time spent [s]; diagnostics only"""
    cell_distance: Distances
    """least distance of each of the part's cells to a tool that makes cells near, inf without one (n_cells,) [m]"""
    coupling: Coupled
    extras: dict[str, float] = field(default_factory=dict)
    """what else is to be said in numbers, by the names of `Figure`"""
    why: str = ""
    """what went wrong and the remedy, where the status is not `converged`"""
    alarms: dict[Detail, str] = field(default_factory=dict)
    """what the participant's monitor saw and did about it in this step, by what it says for programs"""
    fields: Fields | None = None
    members: Members | None = None
    """of a pile: the same by body"""
    then: Advanced | None = None
    """the answer to `Correct.then`; None: that was not served"""

    def figure(self, name: Figure) -> float:
        """One of the extras; where it is left out 0, of iterations and substeps 1."""
        found = self.extras.get(name)
        return found if found is not None else 1.0 if name in ONE_AT_LEAST else 0.0


@message
class Commit:
    """Accept the tentative step (done by the next Advance otherwise)."""

    header: Header
    fields: bool = False
    """also return the fields"""


@message
class Committed:
    header: Header
    fields: Fields | None = None
    seconds: float = 0.0
    """wall time spent [s]; diagnostics only"""


@message
class Observe:
    """Ask for the fields of the last advanced step."""

    header: Header
    indicators: bool = False
    """also estimate the errors of model and mesh"""
    own: bool = False
    """of these only what the region's own model errs, at a bounded cost: what is looked at as a run ends"""


@message
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
    point_strain: Scalars = field(default_factory=NO_SCALARS)
    """of a sheet or rope: largest stretch of what holds each surface point (p,) [1]"""
    cell_energy: Scalars = field(default_factory=NO_SCALARS)
    """strain energy of each cell (n_cells,) [J]"""
    model_error: Scalars = field(default_factory=NO_SCALARS)
    """energy by which each cell is off, or would be, if PBD has it (n_cells,) [J]; empty: not asked, or PBD cannot"""
    mesh_error: Scalars = field(default_factory=NO_SCALARS)
    """FEM: energy by which each cell is off because it is no smaller (n_cells,) [J]; empty: not asked for, or of PBD"""
    seconds: float = 0.0
    """wall time spent on an `Observe` [s], 0 within another reply; diagnostics only"""
    internal: Internal = field(default_factory=NO_INTERNAL)
    """the n numbers that the material remembers in each octant of each cell (n_cells, 8, n); empty where it has none"""
    bodies: list[Fields] = field(default_factory=list)
    """of a pile: those of each body, beside no others"""


@message
class Snapshot:
    """Commit, then return everything that the participant's future depends on."""

    header: Header


@message
class SnapshotTaken:
    header: Header
    state: bytes
    seconds: float = 0.0
    """wall time spent [s]; diagnostics only"""


@message
class Restore:
    header: Header
    state: bytes


@message
class Restored:
    header: Header
    seconds: float = 0.0
    """wall time spent [s]; diagnostics only"""


@message
class Release:
    """Forget a session's participant."""

    header: Header


@message
class Released:
    header: Header


@message
class Failure:
    """The answer to a request that cannot be served."""

    kind: FailureKind
    message: str
    """what is wrong and the remedy"""


Request = Configure | Advance | Correct | Commit | Observe | Snapshot | Restore | Release
Worked = Configured | Advanced | Committed | Fields | SnapshotTaken | Restored
"""replies that say how long the participant worked for them"""
Reply = Worked | Released | Failure
