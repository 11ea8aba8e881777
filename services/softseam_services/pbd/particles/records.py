"""What kernels of particles take by reference: structure, parameters, inputs, scratch and what comes out."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints
from softseam_services.jit import record
from softseam_services.pbd.kernels.lanes import aligned

from .kernels import bending, distance, neo_hookean, strain, volume
from .kernels.contact import N_PUSH
from .kernels.substep import N_OUTCOMES
from .kernels.summary import N_RESULTS

Longs = NDArray[np.int64]

PAIRS = 24
"""pairs of touching layers that find room, per particle"""


@record
class ModelArrays(NamedTuple):
    """Structure, as of `ParticleModel`: particles of the constraints in each lane, and whose lane it is."""

    springs: Ints
    spring_row: Longs
    bends: Ints
    bend_row: Longs
    tetrahedra: Ints
    tetrahedron_row: Longs
    paired: Ints
    volumes: Ints
    volume_row: Longs


@record
class ParameterArrays(NamedTuple):
    """Numbers of n particles, of constraints laid out as the batches of the structure are; 8 lanes."""

    x_rest: Floats
    mass: Floats
    weight: Floats
    """inverse masses, 0 for clamped particles (n,) [1/kg]"""
    gravity: Floats
    drag: float
    """[1/s]"""
    spring_rest: Floats
    """(b, 8) [m]; 1 in empty lanes"""
    spring_compliance: Floats
    """(b, 8) [m/N]"""
    stretch_share: float
    """stiffness of classic PBD, 0 for XPBD, as is that of bends [1]"""
    bend_coefficient: Floats
    """(c, 4, 8)"""
    bend_compliance: Floats
    """(c, 8) [m/N]"""
    bending_share: float
    strain_inverse: Floats
    """D_m^-1 of tetrahedra held by strains (d, 9, 8) [1/m]"""
    strain_compliance: Floats
    """of stretches, shears and the trace (d, 3, 8) [1/J]"""
    pair_inverse: Floats
    """D_m^-1 of tetrahedra held by neo-Hookean pairs (e, 9, 8) [1/m]"""
    pair_compliance: Floats
    """of C_D and C_H (e, 2, 8) [1/J]"""
    pair_gamma: Floats
    """(e, 8) [1]"""
    volume_rest: Floats
    """of tetrahedra in classic PBD (f, 8) [m^3]; 1 in empty lanes"""
    volume_share: float
    """stiffness of classic PBD's volumes [1]"""
    # constraints that the scene adds, as of `constraints.Joined`
    families: Longs
    particle: Longs
    parameter: Floats
    compliance: Floats
    # contact
    kind: Longs
    shape: Floats
    reach: Floats
    friction: Floats
    friction_factor: Floats
    """on that of every tool (n,) [1]"""
    radius: float
    """[m]"""
    restitution: float
    apart: float
    """pairs at least so far apart at rest keep 2 radius; 0 for none [m]"""
    self_friction: float
    margin: float
    """way that a particle may make before contacts are listed anew [m]"""
    hold: float
    """distance at which tools that grip take particles [m]"""


@record
class Inputs(NamedTuple):
    """What a step is given: t tools."""

    position: Floats
    """at the start of the step (t, 3) [m]"""
    orientation: Floats
    """(t, 4)"""
    position_next: Floats
    """and at its end"""
    orientation_next: Floats
    gripping: NDArray[np.int8]
    """1 for tools that hold what is within reach (t,)"""


@record
class Outputs(NamedTuple):
    """What a step gives beside the state, overwritten: n particles, t tools."""

    mean: Floats
    """contact force on particles, mean over the step (n, 3) [N]"""
    felt: Floats
    """its size by tool (n, t) [N]"""
    wrench: Floats
    """on the body (t, 6) [N, N m]"""
    outcome: Floats
    """(N_OUTCOMES,)"""
    result: Floats
    """see `kernels.summary` (N_RESULTS,)"""


@record
class Contacts(NamedTuple):
    """Candidates for contact with tools, where tools are before and after a substep, and pairs of layers."""

    particle: Ints
    tool: Ints
    push: Floats
    position: Floats
    """before and after a substep in turn (2, t, 3) [m]"""
    orientation: Floats
    motion: Floats
    """see `tool_motion` (2, t, 12)"""
    cube: Longs
    """as of `self_contact`, and so is the rest"""
    start: Ints
    order: Ints
    first: Ints
    second: Ints


@record
class Multipliers(NamedTuple):
    """Multipliers, alpha~ and inverses of denominators of every family of constraints."""

    spring_inverse: Floats
    spring_soft: Floats
    spring: Floats
    bend_inverse: Floats
    bend_soft: Floats
    bend: Floats
    strain_soft: Floats
    strain: Floats
    pair_soft: Floats
    pair: Floats
    volume: Floats
    joined_soft: Floats
    joined: Floats


@record
class Scratch(NamedTuple):
    """Of a step; n particles. Rows after the particles' are those of empty lanes."""

    xw: Floats
    """positions and inverse masses (n + 8, 4)"""
    x_prev: Floats
    x_listed: Floats
    """where particles were as contacts with tools, and of layers, were listed (2, n, 3)"""
    ids: Longs
    """of particles that tools hold"""
    v_prev: Floats
    """their velocities before a substep"""
    force: Floats
    """of constraints on them (n + 8, 3) [N]"""
    spring_work: Floats
    bend_work: Floats
    pair_work: Floats
    volume_work: Floats
    pull: Floats
    """see `neo_hookean.begin_pairs` (n + 8, 4)"""
    x: Floats
    """of one constraint that the scene adds: places, parameters and gradient"""
    p: Floats
    g: Floats
    multipliers: Multipliers
    contacts: Contacts


def new_inputs(t: int) -> Inputs:
    """Room for t tools."""
    poses = np.zeros((t, 3)), np.zeros((t, 4)), np.zeros((t, 3)), np.zeros((t, 4))
    return Inputs(*poses, np.zeros(t, dtype=np.int8))


def new_outputs(n: int, t: int) -> Outputs:
    """Room for n particles and t tools."""
    return Outputs(np.zeros((n, 3)), np.zeros((n, t)), np.zeros((t, 6)), np.zeros(N_OUTCOMES), np.zeros(N_RESULTS))


def new_scratch(model: ModelArrays, parameters: ParameterArrays, most: tuple[int, int]) -> Scratch:
    """most: particles and parameters of any constraint that the scene adds"""
    n, particles = len(parameters.mass), most[0]
    return Scratch(
        xw=aligned(n + 8, 4),
        x_prev=np.zeros((n, 3)),
        x_listed=np.zeros((2, n, 3)),
        ids=np.zeros(n, dtype=np.int64),
        v_prev=np.zeros((n, 3)),
        force=np.zeros((n + 8, 3)),
        spring_work=aligned(distance.N_WORK),
        bend_work=aligned(bending.N_WORK),
        pair_work=aligned(neo_hookean.N_WORK),
        volume_work=aligned(volume.N_WORK),
        pull=aligned(n + 8, 4),
        x=np.zeros((particles, 3)),
        p=np.zeros(most[1]),
        g=np.zeros((particles, 3)),
        multipliers=new_multipliers(model, parameters),
        contacts=new_contacts(n, len(parameters.kind), parameters.apart > 0.0),
    )


def new_multipliers(model: ModelArrays, parameters: ParameterArrays) -> Multipliers:
    """All zero."""
    springs, bends, c = model.spring_row.shape, model.bend_row.shape, parameters.compliance
    strains, pairs = parameters.strain_compliance, parameters.pair_compliance
    of_springs = np.zeros(springs), np.zeros(springs), np.zeros(springs)
    of_bends = np.zeros(bends), np.zeros(bends), np.zeros((len(model.bends), 3, 8))
    of_strains = np.zeros_like(strains), np.zeros((len(model.tetrahedra), strain.N_STRAINS, 8))
    return Multipliers(
        *(*of_springs, *of_bends, *of_strains, np.zeros_like(pairs), np.zeros_like(pairs)),
        *(np.zeros_like(parameters.volume_rest), np.zeros_like(c), np.zeros_like(c)),
    )


def new_contacts(n: int, t: int, layers: bool) -> Contacts:
    """Room for n particles and t tools, and for pairs of layers where these may touch."""
    m = n if layers else 0
    buckets = 1 << max(1, (2 * m - 1).bit_length()) if m else 2
    return Contacts(
        particle=np.zeros(n * t, dtype=np.int32),
        tool=np.zeros(n * t, dtype=np.int32),
        push=np.zeros((n * t, N_PUSH)),
        position=np.zeros((2, t, 3)),
        orientation=np.zeros((2, t, 4)),
        motion=np.zeros((2, t, 12)),
        cube=np.zeros((m, 3), dtype=np.int64),
        start=np.zeros(buckets + 1, dtype=np.int32),
        order=np.zeros(m, dtype=np.int32),
        first=np.zeros(PAIRS * m, dtype=np.int32),
        second=np.zeros(PAIRS * m, dtype=np.int32),
    )


MAGIC = b"softseam particles 1\n"


@record
class ParticleState(NamedTuple):
    """n particles, t tools; all fields are views of `buffer`, updated in place by the step."""

    buffer: Floats
    x: Floats
    """positions (n, 3) [m]"""
    v: Floats
    """velocities (n, 3) [m/s]"""
    held: Floats
    """tool that holds each particle, -1 for none (n,)"""
    local: Floats
    """place of held particles in their tool's frame (n, 3) [m]"""
    grips: Floats
    """1 for tools that grip (t,)"""
    strain: Floats
    """strain energy [J] (1,)"""
    slip: Floats
    """of a solid: how far each particle that touches a tool slid along it since it began to (n, t, 3), else none [m]"""


def new_state(n: int, t: int, solid: bool) -> ParticleState:
    """A zero state for n particles, of a solid or not, and t tools."""
    shapes = ((n, 3), (n, 3), (n,), (n, 3), (t,), (1,), (n if solid else 0, t, 3))
    sizes = [int(np.prod(shape)) for shape in shapes]
    buffer = np.zeros(sum(sizes))
    ends = np.cumsum(sizes)
    views = [buffer[end - size : end].reshape(shape) for end, size, shape in zip(ends, sizes, shapes, strict=True)]
    return ParticleState(buffer, *views)


def encode_state(state: ParticleState) -> bytes:
    """Magic line, count of float64 as 8 bytes little-endian, the values little-endian."""
    return MAGIC + len(state.buffer).to_bytes(8, "little") + state.buffer.astype("<f8", copy=False).tobytes()


def decode_state(data: bytes, state: ParticleState) -> None:
    """Overwrite `state` by a snapshot. Raises ValueError where it is not one of this body."""
    head = len(MAGIC) + 8
    if data[: len(MAGIC)] != MAGIC or len(data) < head:
        raise ValueError("this is not a snapshot of a sheet or rope: restore the bytes that `snapshot` returned")
    count = int.from_bytes(data[len(MAGIC) : head], "little")
    if count != len(state.buffer) or len(data) != head + 8 * count:
        raise ValueError(
            f"the snapshot holds {count} numbers in {len(data)} bytes, this body needs {len(state.buffer)}: "
            "configure the body that the snapshot was taken from"
        )
    state.buffer[:] = np.frombuffer(data, dtype="<f8", offset=head)
