"""What kernels of a PBD region take by reference: structure, parameters, inputs, scratch and what comes out."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints
from softseam_services.jit import record

from .kernels.block import Constants
from .kernels.block_rows import N_STRESS
from .kernels.damping import N_FRAME
from .kernels.hanging import Hanging
from .kernels.lanes import LANES, aligned
from .kernels.monitor import N_FIGURES
from .kernels.pairs import EIGHT, N_ROWS, WIDTH
from .kernels.summary import N_RESULTS
from .kernels.trust import N_MONITOR


@record
class PbdState(NamedTuple):
    """n nodes, b batches, p points, t tools, r numbers that a block remembers; all are views of `buffer`, updated
    in place by the step."""

    buffer: Floats
    x: Floats
    """positions (n, 3) [m]"""
    v: Floats
    """velocities (n, 3) [m/s]"""
    a: Floats
    """accelerations from blocks and contacts (n, 3) [m/s^2]"""
    stress: Floats
    """Lambda of each block: P (3, 3) [N m] then T (4, 3) [N], each entry for 4 lanes (b, 84)"""
    force: Floats
    """contact force of each tool on each point (p, t, 3) [N]"""
    slip: Floats
    """slip of each touching point on each tool since it began to touch (p, t, 3) [m]"""
    steady: Floats
    """of each tool on each point: pressure with a memory, by which friction is bounded, and how far friction went
    beyond the pressure so far, see kernels/contact.py (p, t, 2) [N]"""
    lean: Floats
    """where on its patch each tool presses each point inside a face, in the patch's edges from its middle; 0 at others
    (p, t, 2) [1]"""
    force_mean: Floats
    """contact forces, mean over the substeps of the last step (p, t, 3) [N]"""
    memory: Floats
    """what the material of each block remembers, for 4 lanes (b, r, 4)"""
    monitor: Floats
    """what the last step left for the monitor, see `watch` (N_MONITOR,)"""


def _shapes(n: int, b: int, p: int, t: int, r: int) -> tuple[tuple[int, ...], ...]:
    of_points = (p, t, 3), (p, t, 3), (p, t, 2), (p, t, 2), (p, t, 3)
    return ((n, 3), (n, 3), (n, 3), (b, N_STRESS), *of_points, (b, r, LANES), (N_MONITOR,))


def size_of(n: int, b: int, p: int, t: int, r: int = 0) -> int:
    """Numbers of such a state."""
    return sum(int(np.prod(shape)) for shape in _shapes(n, b, p, t, r))


def new_state(n: int, b: int, p: int, t: int, r: int = 0, buffer: Floats | None = None) -> PbdState:
    """A state for n nodes, b batches, p points and t tools, of blocks that remember r numbers: zero, or in a buffer of
    `size_of` numbers."""
    shapes = _shapes(n, b, p, t, r)
    sizes = [int(np.prod(shape)) for shape in shapes]
    buffer = np.zeros(sum(sizes)) if buffer is None else buffer
    ends = np.cumsum(sizes)
    views = [buffer[end - size : end].reshape(shape) for end, size, shape in zip(ends, sizes, shapes, strict=True)]
    return PbdState(buffer, *views)


MAGIC = b"softseam pbd 8\n"


def encode_state(state: PbdState, probed: Floats) -> bytes:
    """Magic line, counts of float64 in the state, in `probed`, and of those of both that are not 0, as 8 bytes
    little-endian each; a bit for each of both that says whether it is not 0, first ones first; and these. Most are 0 of
    a body that touches few of the tools and bodies that it may touch."""
    values: Floats = np.concatenate([state.buffer, probed])
    some = values.view(np.int64) != 0
    counts = (len(state.buffer), len(probed), np.count_nonzero(some))
    head = b"".join(int(each).to_bytes(8, "little") for each in counts)
    bits, others = np.packbits(some).tobytes(), values[some].astype("<f8", copy=False).tobytes()
    return MAGIC + head + bytes(bits) + bytes(others)


def decode_state(data: bytes, state: PbdState, most_probed: int) -> Floats:
    """Overwrite `state` by a snapshot; returns `probed`, of none or so many numbers.

    Raises ValueError where it is no snapshot of this region.
    """
    head = len(MAGIC) + 24
    if data[: len(MAGIC)] != MAGIC or len(data) < head:
        raise ValueError("this is not a snapshot of a PBD participant: restore the bytes that `snapshot` returned")
    count, probed, some = (int.from_bytes(data[at : at + 8], "little") for at in range(len(MAGIC), head, 8))
    n_bits = (count + probed + 7) // 8
    if count != len(state.buffer) or probed not in (0, most_probed) or len(data) != head + n_bits + 8 * some:
        raise ValueError(
            f"the snapshot holds {count} numbers in {len(data)} bytes, this region needs {len(state.buffer)}: "
            "configure the region that the snapshot was taken from"
        )
    bits = np.unpackbits(np.frombuffer(data, np.uint8, n_bits, head), count=count + probed).astype(np.bool_)
    if np.count_nonzero(bits) != some:
        raise ValueError(f"the snapshot says that {some} numbers are not 0, and has others: it is damaged")
    values = np.zeros(count + probed)
    values[bits] = np.frombuffer(data, dtype="<f8", offset=head + n_bits)
    state.buffer[:] = values[:count]
    return values[count:]


@record
class ModelArrays(NamedTuple):
    """Structure, as of `PbdModel`: n nodes, c cells, b batches, p points."""

    blocks: Ints
    """nodes of the blocks (b, 8, LANES)"""
    cell_nodes: Ints
    seam: Ints
    hanging: Hanging
    indptr: Ints
    node: Ints
    touches: NDArray[np.bool_]
    visits: Ints
    n_surface: int
    """points of the surface; those inside faces come after them"""


@record
class ParameterArrays(NamedTuple):
    """Numbers of a region: n nodes, b batches, p points, t tools."""

    mass: Floats
    """of nodes, those that hang have given theirs away (n,) [kg]"""
    inverse_mass: Floats
    """0 for clamped nodes and nodes without mass (n,) [1/kg]"""
    x_rest: Floats
    """(n, 3) [m]"""
    gravity: Floats
    """(3,) [m/s^2]"""
    # blocks
    volume: Floats
    softness: Floats
    """8 times the largest inverse mass of each block's nodes, where no tool holds one (b, LANES) [1/kg]"""
    constants: Constants
    law: int
    kappa: float
    renewed: float
    """how long what folds branches that relax does, see `kernels.renew`: less than any substep where one yields, 0
    where there are none [s]"""
    # points
    weight: Floats
    """of the nodes that points follow, see `point_weights` (entries,)"""
    tilt: Floats
    """how each weight changes on a point's patch, see `FacePoints.tilt` (entries, 2)"""
    point_softness: Floats
    """sum of w_i N_i^2 of each point (p,) [1/kg]"""
    point_give: Floats
    """as of `Points.give` (p,) [m/N]"""
    point_lag: Floats
    """as of `Points.lag` (p, t) [m]"""
    ease: float
    """as of `Points.ease` [1]"""
    friction_factor: Floats
    """of each point, on the friction of every tool (p,) [1]"""
    # tools
    kind: NDArray[np.int64]
    shape: Floats
    reach: Floats
    places: NDArray[np.int64]
    short: Floats
    """how far a point may go in a substep and have passed no wall, of tools with edges (t,) [m]"""
    friction: Floats
    followed: NDArray[np.bool_]
    margin: float
    """points within it of a tool, and what speeds add to it, are tried for contact [m]"""
    # damping
    mass_rate: float
    """damping that is proportional to mass [1/s]"""
    stiffness_time: float
    """damping that is proportional to stiffness [s]"""
    lag: float
    """by how much sweeps show less of it, see `kernels.damping` [1/s^2]"""
    tolerance: float
    """residual at which sweeps stop, see `kernels.monitor`; 0: never [1]"""


@record
class Inputs(NamedTuple):
    """What a step is given: t tools, m nodes that the seam follows."""

    position: Floats
    """at the start of the step (t, 3) [m]"""
    orientation: Floats
    """(t, 4)"""
    position_next: Floats
    """and at its end"""
    orientation_next: Floats
    seam_force: Floats
    """in the first substep (m, 3) [N]"""
    seam_growth: Floats
    """what each later substep adds to it (m, 3) [N]"""


@record
class Outputs(NamedTuple):
    """What a step gives beside the state, overwritten: t tools, c cells."""

    wrench: Floats
    """on the body (t, 6) [N, N m]"""
    distance: Floats
    """of each cell from the nearest tool (c,) [m]"""
    result: Floats
    """see `kernels.summary` (N_RESULTS,)"""


@record
class Contacts(NamedTuple):
    """Points that may touch tools in a step, t tools, and their places now; see `kernels.pairs` and `kernels.hold`."""

    start: Ints
    rows: Ints
    pairs: Floats
    clear: Floats
    """least gap of a group that nothing touched when it was found; -inf once one of its points may touch (p t,) [m]"""
    found: Floats
    """of the points, see `kernels.pairs` (p, 6)"""
    found_at: Floats
    """xw as pairs were found (n + 8, 4)"""
    before: Floats
    """xw as the substep began (n + 8, 4)"""
    travel: Floats
    """how far a point of each tool goes in the step, at most (t,) [m]"""
    ahead: Floats
    """gaps that a tool may close in the step, if no node gets faster (t,) [m]"""
    held: Ints
    held_blocks: Ints
    newest: Ints
    """the last group that holds a node (n,)"""
    position: Floats
    """before and after a substep (2, t, 3) [m]"""
    orientation: Floats
    """(2, t, 4)"""
    motion: Floats
    """see `kernels.tool_motion` (2, t, 12)"""
    point_x: Floats
    """places of the points (p, 3) [m]"""
    patch: Floats
    """edges of points' patches as the step begins, 0 but inside faces that tools with edges press (p, 2, 3) [m]"""
    slow: NDArray[np.bool_]
    """tools that go by less than a patch in the step (t,)"""
    lanes: int
    """EIGHT, which the compiler does not know here: loops over so few lanes it would write out, number by number"""


@record
class Scratch(NamedTuple):
    """Of a step; n nodes, b batches."""

    xw: Floats
    """positions and inverse masses (n + 8, 4)"""
    x_star: Floats
    push: Floats
    pull: Floats
    node_gap: Floats
    softness: Floats
    """of blocks, as tools hold the nodes now, see `kernels.hold` (b, LANES)"""
    figures: Floats
    """of each batch, see `kernels.monitor` (b, N_FIGURES)"""
    used: Ints
    """sweeps of each substep of a step, where they may stop (substeps,)"""
    asked: Floats
    """stress that shapes ask for, see `kernels.damping` (b, N_STRESS), or (0, N_STRESS) without damping"""
    frame: Floats
    """F at the start of a substep (b, N_FRAME), or (0, N_FRAME)"""
    contacts: Contacts


@record
class Leap(NamedTuple):
    """Scratch of the explicit step; n nodes, b batches. The rows after the nodes are the padding's."""

    place: Floats
    """positions (n + 8, 4) [m]; the fourth column is not used"""
    speed: Floats
    """velocities half a substep ahead (n + 8, 4) [m/s], and inverse masses [1/kg]"""
    push: Floats
    """g of free nodes (n, 4) [m/s^2]"""
    pull: Floats
    """forces of the blocks (n + 8, 4) [N]"""
    figures: Floats
    """of each batch, see `kernels.monitor` (b, N_FIGURES)"""


@record
class Member(NamedTuple):
    """One body of a pile, which is a region of its own."""

    model: ModelArrays
    parameters: ParameterArrays
    before: PbdState
    """the last committed state"""
    after: PbdState
    """the tentative one"""
    scratch: Scratch
    outputs: Outputs
    all: Ints
    """from the first batch to the last (2,)"""
    own_mass: Floats
    """of nodes, see `PbdParameters` (n,) [kg]"""
    substeps: int
    """that are planned"""
    plans: bool
    """whether these are as many as are stable, see `PbdParameters`"""
    sweeps: int
    """of the scene, in each"""
    slowly: float
    """see `PbdParameters` [m]"""
    roundoff: float
    """[J]"""
    turns: bool
    """whether it gets back what substeps lose of a rotation"""


def new_inputs(t: int, m: int) -> Inputs:
    """Room for t tools and m nodes that the seam follows."""
    poses = np.zeros((t, 3)), np.zeros((t, 4)), np.zeros((t, 3)), np.zeros((t, 4))
    return Inputs(*poses, np.zeros((m, 3)), np.zeros((m, 3)))


def new_outputs(t: int, c: int) -> Outputs:
    """Room for t tools and c cells."""
    return Outputs(np.zeros((t, 6)), np.zeros(c), np.zeros(N_RESULTS))


def new_contacts(model: ModelArrays, n: int, t: int) -> Contacts:
    """Room for n nodes and t tools."""
    p, b = len(model.touches), len(model.blocks)
    return Contacts(
        start=np.zeros(t + 1, dtype=np.int32),
        rows=np.zeros((p * t, N_ROWS), dtype=np.int32),
        pairs=aligned(p * t, WIDTH),
        clear=np.zeros(p * t),
        found=np.zeros((p, 6)),
        found_at=aligned(n + 8, 4),
        before=aligned(n + 8, 4),
        travel=np.zeros(t),
        ahead=np.zeros(t),
        held=np.zeros(n + 8, dtype=np.int32),
        held_blocks=np.zeros(LANES * b + 1, dtype=np.int32),
        newest=np.zeros(n, dtype=np.int32),
        position=np.zeros((2, t, 3)),
        orientation=np.zeros((2, t, 4)),
        motion=np.zeros((2, t, 12)),
        point_x=np.zeros((p, 3)),
        patch=np.zeros((p, 2, 3)),
        slow=np.ones(t, dtype=np.bool_),
        lanes=EIGHT,
    )


def new_scratch(model: ModelArrays, parameters: ParameterArrays, padding_x: Floats, substeps: int) -> Scratch:
    """With the inverse masses of the nodes and the places of the padding in xw; for at most so many substeps."""
    n, b = len(parameters.mass), len(model.blocks)
    damped = b if parameters.stiffness_time > 0.0 else 0
    xw = aligned(n + 8, 4)
    xw[:n, 3] = parameters.inverse_mass
    xw[n:, :3] = padding_x
    return Scratch(
        xw=xw,
        x_star=np.zeros((n, 3)),
        push=np.zeros((n, 3)),
        pull=aligned(n + 8, 4),
        node_gap=np.zeros(n),
        softness=parameters.softness.copy(),
        figures=np.zeros((b, N_FIGURES)),
        used=new_used(parameters, substeps),
        asked=aligned(damped, N_STRESS),
        frame=aligned(damped, N_FRAME),
        contacts=new_contacts(model, n, len(parameters.kind)),
    )


def new_used(parameters: ParameterArrays, substeps: int) -> Ints:
    """Room for the sweeps of so many substeps, where sweeps may stop."""
    return np.zeros(substeps if parameters.tolerance > 0.0 else 0, dtype=np.int32)


def new_leap(parameters: ParameterArrays, padding_x: Floats, figures: Floats) -> Leap:
    """Scratch in which each node has a row of four; figures (b, N_FIGURES)."""
    n = len(parameters.mass)
    leap = Leap(aligned(n + 8, 4), aligned(n + 8, 4), aligned(n, 4), aligned(n + 8, 4), figures)
    leap.place[n:, :3] = padding_x
    leap.speed[:n, 3] = parameters.inverse_mass
    leap.push[parameters.inverse_mass > 0.0, :3] = parameters.gravity
    return leap
